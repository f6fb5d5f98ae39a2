"""The cylinders against H(s) and against their speed limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lsim

from controllers import Mode, Settings
from controllers.closed_loop import state_space
from rigtwin.components import Cylinder
from rigtwin.components.cylinder import closed_loop
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.rig.component import replay_cylinder
from rigtwin.signals.excitation import schroeder
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.twin import Twin

NOMINAL = Cylinder()


def response(frequency: float, cylinder: Cylinder = NOMINAL) -> complex:
    """H(s)/H(0) as printed, thesis Eq. 6.2."""
    s = 2j * math.pi * frequency
    above = cylinder.b2 * s**2 + cylinder.b1 * s + cylinder.b0
    below = s**4 + cylinder.a3 * s**3 + cylinder.a2 * s**2 + cylinder.a1 * s + cylinder.a0
    return above / below * cylinder.a0 / cylinder.b0


def test_facts_of_the_thesis():
    """Delay 19 ms at 0.5 Hz, 35 ms at 1 Hz; +1.6 dB near 2 Hz, −13 dB at 10 Hz."""
    for frequency, delay in ((0.5, 0.019), (1.0, 0.035)):
        assert -np.angle(response(frequency)) / (2 * math.pi * frequency) == pytest.approx(
            delay, abs=5e-4
        )
    assert 20 * math.log10(abs(response(2.0))) == pytest.approx(1.6, abs=0.2)
    assert 20 * math.log10(abs(response(10.0))) == pytest.approx(-13, abs=0.5)


@pytest.mark.parametrize("frequency", [0.1, 1.0, 7.0])
def test_state_space_is_the_transfer_function(frequency):
    a, b, c = state_space(closed_loop(NOMINAL))
    assert c @ np.linalg.solve(2j * math.pi * frequency * np.eye(4) - a, b) == pytest.approx(
        response(frequency), rel=1e-9
    )


def test_sampling_is_exact_for_held_commands():
    configuration = Configuration()
    commands = 1e-3 * np.cumsum(np.random.default_rng(0).standard_normal(2000)) * 0.05
    commands[0] = 0.0
    ours = replay_cylinder(NOMINAL, configuration, commands, 0.0)
    a, b, c = state_space(closed_loop(NOMINAL))
    time = np.arange(2000 * 20) * 5e-5
    _, fine, _ = lsim(
        (a, b[:, None], c[None, :], [[0.0]]), np.repeat(commands, 20), time, interp=False
    )
    assert np.max(np.abs(ours - np.asarray(fine)[::20])) < 1e-9


def test_speed_limit_is_never_exceeded_and_the_plate_catches_up():
    configuration = Configuration(timing=Timing(timestep=2.5e-4))
    commands = np.full(3000, 0.1)
    position = replay_cylinder(NOMINAL, configuration, commands, 0.0)
    assert np.max(np.abs(np.diff(position))) <= 0.3e-3 * (1 + 1e-9)
    assert np.max(np.diff(position)) == pytest.approx(0.3e-3)
    assert position[-1] == pytest.approx(0.1, abs=1e-5)


def test_frequency_response_identified_from_the_running_twin():
    """Schroeder multisine through the whole loop; the hold's half a tick is taken out. Within 0.2
    dB and 2° to 10 Hz."""
    frequencies = np.arange(1.0, 31.0)
    configuration = Configuration(
        controller=Settings(mode=Mode.IMPOSED, start=0.0), timing=Timing(duration=5.0)
    )
    time = np.arange(configuration.ticks) * 1e-3
    command = schroeder(time, frequencies, 1e-4)
    command -= command[0]
    demands = np.column_stack([command, command, np.full_like(time, 200.0)])
    twin = Twin(configuration, 0.0, seed=0)
    truth = np.concatenate(
        [
            block.truth
            for block in run_compiled(twin, configuration, demands)
            if block.truth is not None
        ]
    )
    assert np.max(np.abs(np.diff(truth[:, 0]))) <= 0.3e-3
    last = slice(4000, 5000)
    for column in (0, 1):
        ratio = np.fft.rfft(truth[last, column]) / np.fft.rfft(command[last])
        for frequency in range(1, 11):
            found = ratio[frequency] * np.exp(2j * math.pi * frequency * 0.5e-3)
            exact = response(float(frequency))
            assert abs(20 * math.log10(abs(found) / abs(exact))) < 0.2
            assert abs(np.angle(found / exact, deg=True)) < 2.0
