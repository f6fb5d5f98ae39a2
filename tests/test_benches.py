"""The same engine on other machines: benches of the referee's own code, and a real machine."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from referee.bench_cases import ACTUATORS, DAMPERS, BenchCase, draw_case
from referee.benches import (
    ActuatorTruth,
    DamperTruth,
    actuator_position,
    damper_force,
    sample,
    wander,
)
from rigtwin.description.catalogue import SHIPPED, find
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.localisation import distance_since_reversal
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.importing.convert import convert
from rigtwin.recording import RecordedTest, load
from tests.helpers.benches import recording_of

EMPS = Path(__file__).parents[2] / "shared" / "real" / "emps"
SINGLE = {
    "lag": (ActuatorTruth(lags=(0.02,)), {"lag@actuator": 0.02}),
    "two lags": (ActuatorTruth(lags=(0.03, 0.009)), {"two_lags@actuator": 0.03}),
    "lag and delay": (
        ActuatorTruth(lags=(0.025,), delay=0.012),
        {"lag@actuator": 0.025, "delay@actuator": 0.012},
    ),
    "resonance": (ActuatorTruth(resonance=(6.0, 0.4)), {"resonance@actuator": 6.0}),
    "friction": (DamperTruth(slip=80.0), {"coulomb@damper": 80.0}),
    "spring": (
        DamperTruth(slip=80.0, spring=4e4),
        {"coulomb@damper": 80.0, "compliance@damper": 2.5e-5},
    ),
    "play": (
        DamperTruth(slip=80.0, play=0.003),
        {"coulomb@damper": 80.0, "backlash@damper": 0.003},
    ),
    "spring and play": (
        DamperTruth(slip=80.0, spring=4e4, play=0.003),
        {"coulomb@damper": 80.0, "compliance@damper": 2.5e-5, "backlash@damper": 0.003},
    ),
    "one way": (
        DamperTruth(slip=30.0, viscous=(2000.0, 900.0)),
        {"viscous@damper": 1450.0, "viscous_asymmetry@damper": 1100.0, "coulomb@damper": 30.0},
    ),
}
"""Truth → effects to be named, with their magnitudes."""


@cache
def answered(truth: ActuatorTruth | DamperTruth) -> Diagnosis:
    machine = "actuator" if isinstance(truth, ActuatorTruth) else "damper"
    recording = recording_of(BenchCase(machine, frozenset(), truth, 1e-3, 5))
    return diagnose(find(recording.machine), [recording])


FAST = ("friction",)
"""The others take longer."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in FAST else pytest.mark.slow) for name in SINGLE],
)
def test_the_effects_of_a_bench_are_named_with_their_magnitude(name: str):
    truth, effects = SINGLE[name]
    found = answered(truth)
    assert {str(effect.name) for effect in found.effects} == set(effects)
    for effect in found.effects:
        value = next(iter(effect.parameters.values())).value
        # Half a tick is nobody's to know.
        slack = 6e-4 if effect.name.kind == "delay" else 0.0
        assert value == pytest.approx(effects[str(effect.name)], rel=0.02, abs=slack)
    assert found.gap is not None
    assert found.gap.shrinkage_held_out.value > 0.9


@pytest.mark.slow
def test_a_slow_logger_and_a_stepping_command():
    """50 Hz, steps, half a millimetre a bit: a lag and a delay are not taken for one effect of
    second order."""
    random, period = np.random.default_rng(4), 0.02
    command = np.repeat(random.uniform(-0.05, 0.05, 50), 60)
    truth = ActuatorTruth(lags=(0.06,), delay=0.08, speed_limit=0.15)
    position = sample(random, actuator_position(truth, command, period), 1e-4, 5e-4)
    time = np.arange(len(command)) * period
    columns = {"/command": {"position": command}, "/sensor": {"position": position}}
    machine = find("position-actuator")
    recording = RecordedTest(Path("slow"), machine.name, "", period, time, columns, {})
    found = diagnose(machine, [recording])
    values = {str(effect.name): next(iter(effect.parameters.values())) for effect in found.effects}
    assert set(values) == {"lag@actuator", "delay@actuator", "rate_limit@actuator"}
    assert values["rate_limit@actuator"].value == pytest.approx(0.15, rel=0.03)
    assert values["delay@actuator"].low <= 0.08 + 0.5 * period
    assert values["lag@actuator"].value == pytest.approx(0.06, abs=0.01)


@pytest.mark.parametrize("truth", [ActuatorTruth(), DamperTruth()], ids=["actuator", "damper"])
def test_a_bench_without_effects_has_no_gap(truth):
    found = answered(truth)
    assert found.verdict == "no gap"
    assert not found.effects


@pytest.mark.slow
def test_play_lies_within_a_few_millimetres_after_a_reversal():
    found = answered(SINGLE["play"][0])
    (place,) = [place for place in found.where if place.evidence.startswith("backlash")]
    assert place.region.endswith("mm after a reversal")
    assert 2.0 < float(place.region.split()[1]) < 8.0


@pytest.mark.slow
def test_what_was_found_one_after_another_is_told():
    found = answered(SINGLE["play"][0])
    residuals = [step.residual["load_cell"] for step in found.answer.steps]
    assert found.answer.steps[0].added == "nominal"
    assert residuals[-1] < 0.05 * residuals[0]
    document = found.document()
    assert document["steps"][1]["added"].startswith("with ")
    assert document["machine"] == "damper-bench"


def test_distance_since_a_reversal():
    there = np.concatenate(
        [np.linspace(0, 1, 101), np.linspace(1, 0.4, 61)[1:], np.linspace(0.4, 0.9, 51)[1:]]
    )
    found = distance_since_reversal(there)
    assert found[99] == pytest.approx(0.99)
    assert found[100] == 0.0
    assert found[110] == pytest.approx(0.1)
    assert found[159] == pytest.approx(0.59)
    assert found[170] == pytest.approx(0.1)


# The referee's benches themselves.


def test_the_bench_actuator_has_its_frequency_response():
    time = np.arange(20_000) * 1e-3
    truth = ActuatorTruth(lags=(0.02, 0.01), delay=0.005)
    w = 2 * np.pi * 3.0
    out = actuator_position(truth, np.sin(w * time), 1e-3)
    last = slice(10_000, 20_000)
    found = 2.0j * np.mean(out[last] * np.exp(-1j * w * time[last]))
    expected = np.exp(-1j * w * (0.005 + 0.5e-3)) / ((1 + 0.02j * w) * (1 + 0.01j * w))
    assert abs(found - expected) < 0.003


def test_the_bench_damper_loses_what_its_friction_eats():
    """Work over a cycle: 4·F·(a − F/k − b/2) of a stop behind a spring and a play, and π·c·w·a² of
    the viscous part."""
    time = np.arange(100_001) * 1e-5
    motion = 0.02 * np.cos(2 * np.pi * time)
    speed = np.gradient(motion, 1e-5)
    truth = DamperTruth(slip=80.0, spring=4e4, play=0.003, viscous=(200.0, 200.0))
    force = damper_force(truth, np.concatenate([motion, motion]), np.concatenate([speed, speed]))[
        100_001:
    ]
    work = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(motion)))
    expected = 4 * 80.0 * (0.02 - 80.0 / 4e4 - 0.0015) + np.pi * 200.0 * 2 * np.pi * 0.02**2
    assert work == pytest.approx(expected, rel=0.002)


def test_motions_start_at_rest_and_keep_their_reach():
    motion = wander(np.random.default_rng(1), 5.0, 1e-3, 0.03, 0.1, 3.0)
    assert np.max(np.abs(motion)) == pytest.approx(0.03)
    assert abs(motion[0]) < 1e-9


def test_cases_are_drawn_the_same_again_and_hold_every_sort():
    assert draw_case(7, 1) == draw_case(7, 1)
    names = {tuple(sorted(draw_case(n, 1).names)) for n in range(2 * len(ACTUATORS) * len(DAMPERS))}
    assert names == {tuple(sorted(set(sort.split()) - {"none"})) for sort in (*ACTUATORS, *DAMPERS)}


# A real machine.


@pytest.mark.skipif(not EMPS.is_dir(), reason="the EMPS data are not here")
@pytest.mark.slow
def test_emps_on_its_held_out_recording(tmp_path: Path):
    for data, name in (("DATA_EMPS", "emps"), ("DATA_EMPS_PULSES", "emps_pulses")):
        convert(
            [EMPS / f"{data}.mat"], SHIPPED / "maps" / f"{name}.toml", tmp_path / f"{name}.mcap"
        )
    machine = find("emps")
    fitted, held_out = (load(tmp_path / f"{name}.mcap") for name in ("emps", "emps_pulses"))
    found = diagnose(machine, [fitted], held_out=[held_out])
    effects = {str(effect.name): effect for effect in found.effects}
    # Janot, Gautier and Brunot give 20.4 N.
    friction = effects["coulomb@guide"].parameters["coulomb"]
    assert friction.value == pytest.approx(20.4, abs=1.5)
    residuals = [step.residual["force"] for step in found.answer.steps]
    assert residuals[0] == pytest.approx(21.9, abs=0.2)
    assert residuals[1] < 5.0
    # A least-squares fit of mass, viscous, Coulomb and offset leaves 2.9 N.
    assert min(residuals) < 2.5
    assert found.gap is not None
    assert found.gap.shrinkage_held_out.low > 0.85
    assert found.verdict == "partly explained"
    assert found.answer.leftovers
