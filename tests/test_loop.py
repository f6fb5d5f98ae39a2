"""The loop: stepwise and compiled alike, seeded, ended by trips; the force loop identified from the
running twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controllers import Commands, Measurements, Mode, Settings
from experiments import EXPERIMENTS
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.errors import RigtwinError
from rigtwin.recording import load
from rigtwin.signals.excitation import schroeder
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.loop import Block, run
from rigtwin.simulation.runner import record
from rigtwin.simulation.trip import Trip
from rigtwin.simulation.twin import Twin
from tests.helpers.settings import from_assignments

SHORT = Timing(duration=0.6)


def all_of(blocks) -> tuple[np.ndarray, np.ndarray, np.ndarray, Trip]:
    kept: list[Block] = list(blocks)
    truth = [block.truth for block in kept if block.truth is not None]
    return (
        np.concatenate([block.commands for block in kept]),
        np.concatenate([block.measurements for block in kept]),
        np.concatenate(truth),
        kept[-1].trip,
    )


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_stepwise_and_compiled_are_the_same(name):
    experiment = EXPERIMENTS[name]
    configuration = experiment.configuration._replace(timing=SHORT)
    demands = experiment.demands(configuration, 3)
    first = float(demands[0, 0])
    stepwise = all_of(run(Twin(configuration, first, 3), configuration, demands))
    compiled = all_of(run_compiled(Twin(configuration, first, 3), configuration, demands))
    whole = all_of(run_compiled(Twin(configuration, first, 3), configuration, demands, block=333))
    for one, other, third in zip(stepwise[:3], compiled[:3], whole[:3], strict=True):
        assert np.max(np.abs(one - other)) <= 1e-12 * np.max(np.abs(one))
        assert np.array_equal(other, third)
    assert stepwise[3] == compiled[3] == whole[3]


def test_same_seed_same_bytes(tmp_path):
    experiment = EXPERIMENTS["road10"]
    configuration = experiment.configuration._replace(timing=Timing(duration=2.0))
    data = []
    for number, seed in enumerate((5, 5, 6)):
        path = tmp_path / f"{number}.mcap"
        record(path, "road10", configuration, experiment.demands(configuration, seed), seed)
        data.append(path.read_bytes())
    assert data[0] == data[1]
    assert data[0] != data[2]


def test_a_trip_ends_the_test_and_keeps_the_recording(tmp_path):
    experiment = EXPERIMENTS["drop"]
    configuration = from_assignments(experiment.configuration, ["safety.structure=0.05"])
    outcome = record(
        tmp_path / "t.mcap", "drop", configuration, experiment.demands(configuration, 0), 0
    )
    assert outcome.tripped
    assert "structure_lvdt" in outcome.reason
    recording = load(outcome.path)
    structure = recording.column("/sensor", "structure_lvdt")
    assert recording.ticks == outcome.ticks
    assert abs(structure[-1]) > 0.05
    assert np.all(np.abs(structure[:-1]) <= 0.05)
    assert recording.end == outcome.reason


class FaultyRig:
    """Gives a number that is none at the fifth tick."""

    def __init__(self) -> None:
        self.ticks, self.stopped, self.written = 0, False, 0

    def start(self) -> None: ...

    def read(self) -> Measurements:
        self.ticks += 1
        return Measurements(0.0, -0.004, 0.0, math.nan if self.ticks == 5 else 200.0)

    def write(self, commands: Commands) -> None:
        self.written += 1

    def stop(self) -> None:
        self.stopped = True


def test_not_a_number_is_never_written_to_the_rig():
    rig, configuration = FaultyRig(), Configuration(timing=SHORT)
    blocks = list(run(rig, configuration, np.zeros((100, 3))))
    assert (blocks[-1].trip, rig.written, rig.stopped) == (Trip.NOT_A_NUMBER, 4, True)


def test_period_must_be_a_multiple_of_the_timestep():
    configuration = Configuration(timing=Timing(timestep=3e-4))
    with pytest.raises(RigtwinError, match="whole multiple"):
        Twin(configuration, 0.0, 0)


def force_response(noise_free: Configuration, frequencies: np.ndarray) -> np.ndarray:
    """Force sensed and filtered over force demanded, plates at rest, whole hertz, from the last
    second of three."""
    timing = noise_free.timing
    time = np.arange(noise_free.ticks) * timing.period
    force = 230.0 + schroeder(time, frequencies, 1.0)
    demands = np.column_stack([np.zeros_like(time), np.full_like(time, -0.004), force])
    commands, measured, *_ = all_of(run_compiled(Twin(noise_free, 0.0, 0), noise_free, demands))
    filtered = np.empty(len(measured))
    filtered[0] = measured[0, 3]
    for tick in range(1, len(measured)):
        filtered[tick] = filtered[tick - 1] + (measured[tick, 3] - filtered[tick - 1]) / 11.0
    last = slice(-1000, None)
    lines = frequencies.astype(int)
    return np.fft.rfft(filtered[last])[lines] / np.fft.rfft(commands[last, 2])[lines]


def test_force_loop_follows_its_linear_model():
    """With neither friction nor noise the loop is linear: compare with the sampled loop worked out
    by hand."""
    frequencies = np.arange(1.0, 41.0)
    changes = [
        "rail.coulomb=500",
        "motor.coulomb=0",
        "load_cell.white=0",
        "load_cell.hum=0",
        "load_cell.resolution=0",
    ]
    settings = Settings(mode=Mode.IMPOSED)
    configuration = from_assignments(
        Configuration(controller=settings, timing=Timing(duration=3.0)), changes
    )
    found = force_response(configuration, frequencies)
    z = np.exp(2j * math.pi * frequencies * 1e-3)
    decay = math.exp(-1.0 / 1.26)
    motor = (1 - decay) / (z - decay)
    smooth = (1 / 11.0) / (1 - (10 / 11.0) / z)
    integral = 10.0 * 1e-3 / (1 - 1 / z)
    loop = motor * (1.0 + 0.3 + integral) / (1 + motor * smooth * (0.3 + integral)) * smooth
    assert np.max(np.abs(found - loop)) < 1e-3
