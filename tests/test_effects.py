"""Effects: every one listed, bounded, felt where it is, absent at its nominal value, and right in
closed form."""

from __future__ import annotations

import math
import pickle
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from controllers import Measurements
from experiments import EXPERIMENTS
from rigtwin.components import (
    KINDS,
    Carriage,
    Computer,
    Cylinder,
    ForceActuator,
    LoadCell,
    Lvdt,
    Motor,
    Rail,
    RigPlant,
    Tyre,
    candidates,
)
from rigtwin.components.conditioning import actuator, condition, hold
from rigtwin.components.dry_friction import breakaway, friction, gap_at
from rigtwin.components.starts import around_nominal
from rigtwin.description.catalogue import find, shipped
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import apply_effects, with_effect
from rigtwin.description.settings import Timing
from rigtwin.errors import RigtwinError
from rigtwin.recording import load
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.converters import build_sensing, sample_sensors
from rigtwin.simulation.loop import run
from rigtwin.simulation.mechanics import build, handles
from rigtwin.simulation.plant_forces import drive, touch
from rigtwin.simulation.rig_contacts import contacts
from rigtwin.simulation.runner import record
from rigtwin.simulation.twin import Twin
from tests.helpers.effects import text

EFFECTS = {effect.name: effect for effect in candidates(RigPlant())}
IMPOSED = EXPERIMENTS["imposed"]
SHORT = IMPOSED.configuration._replace(timing=Timing(duration=2.0))
START = 500
"""Ticks of a test's beginning."""
DEMANDS = IMPOSED.demands(SHORT, 0)


def all_measurements(configuration: Configuration, demands: np.ndarray = DEMANDS) -> np.ndarray:
    blocks = run_compiled(Twin(configuration, float(demands[0, 0]), 0), configuration, demands)
    return np.concatenate([block.measurements for block in blocks])


@pytest.fixture(scope="module")
def nominal() -> np.ndarray:
    return all_measurements(SHORT)


@pytest.fixture(scope="module")
def nominal_start() -> np.ndarray:
    return all_measurements(SHORT, DEMANDS[:START])


def test_the_list_is_that_of_the_design():
    slides = {"coulomb", "viscous", "stribeck", "asymmetry", "backlash"}
    actuators = {"gain", "lag", "delay", "saturation", "deadband", "rate_limit"}
    sensors = {"gain", "offset", "drift", "lag", "delay", "hum", "noise", "quantisation"}
    expected = {
        "rail": slides,
        "carriage": {"mass"},
        "tyre": {"stiffness", "damping", "hardening"},
        "motor": slides | actuators | {"cogging", "load_friction"},
        "structure_cylinder": actuators | {"compliance", "backlash"},
        "ground_cylinder": actuators | {"compliance", "backlash"},
        **dict.fromkeys(("load_cell", "suspension_lvdt", "structure_lvdt", "ground_lvdt"), sensors),
        "controller": {"missed_ticks", "delay"},
    }
    found: dict[str, set[str]] = {}
    for effect in EFFECTS.values():
        found.setdefault(effect.component, set()).add(effect.kind.name)
    assert found == expected
    assert all(kind.meaning for kind in KINDS)


@pytest.mark.parametrize("name", EFFECTS)
def test_nominal_value_is_no_effect(name, nominal_start):
    effect = EFFECTS[name]
    values = effect.nominal(SHORT.plant)
    for parameter, quantity in effect.quantities().items():
        assert quantity.low <= values[parameter] <= quantity.high
    changed = all_measurements(with_effect(SHORT, effect, values), DEMANDS[:START])
    assert np.array_equal(changed, nominal_start)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_felt_and_stays_finite(name, nominal):
    changed = all_measurements(apply_effects(SHORT, [text(name)]))
    count = min(len(changed), len(nominal))
    assert np.isfinite(changed).all()
    difference = np.std(changed[:count] - nominal[:count], axis=0) + np.abs(
        np.mean(changed[:count] - nominal[:count], axis=0)
    )
    assert np.any(difference > [2e-5, 2e-5, 2e-5, 0.5])
    component = EFFECTS[name].component
    if component.endswith("lvdt"):
        column = Measurements._fields.index(component)
        others = [number for number in range(4) if number != column]
        assert np.array_equal(changed[:, others], nominal[:, others]), (
            "an imposed test does not feed back its LVDTs"
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_stepwise_and_compiled_agree_with_effects(name):
    configuration = apply_effects(SHORT._replace(timing=Timing(duration=0.3)), [text(name)])
    first = float(DEMANDS[0, 0])
    compiled = [
        b.measurements
        for b in run_compiled(Twin(configuration, first, 4), configuration, DEMANDS[:300])
    ]
    stepwise = [
        b.measurements for b in run(Twin(configuration, first, 4), configuration, DEMANDS[:300])
    ]
    assert np.max(np.abs(np.concatenate(compiled) - np.concatenate(stepwise))) < 1e-12 * 300


def test_a_recording_keeps_its_effects_but_not_among_the_operators_settings(tmp_path):
    effects = ["coulomb@rail=80", "setting@controller=kp:0.9"]
    record(tmp_path / "e.mcap", "imposed", SHORT, DEMANDS, 0, effects=effects)
    recording = load(tmp_path / "e.mcap")
    assert recording.twin["effects"] == '["coulomb@rail=80", "setting@controller=kp:0.9"]'
    assert recording.controller["kp"] == 0.3


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ("coulomb@rail", "KIND@COMPONENT=VALUE"),
        ("coulomb=3", "a component of carriage, rail, tyre"),
        ("coulomb@tyre=3", "at tyre; there are stiffness, damping, hardening"),
        ("coulomb@rail=much", "rail.coulomb = much: expected a number from 0 to 1000 N"),
        (
            "stribeck@rail=20,speed=0.1",
            "stribeck@rail has stribeck, stribeck_velocity, stribeck_exponent, not 'speed'",
        ),
        ("setting@controller=kd:1", "unknown setting controller.kd"),
    ],
)
def test_wrong_effects_are_refused_with_what_there_is(wrong, says):
    with pytest.raises(RigtwinError, match=says):
        apply_effects(SHORT, [wrong])


STEP = 2.5e-4
NEVER_LATE = Computer()


def through(
    of: Motor | Cylinder | ForceActuator, commands: np.ndarray, computer: Computer = NEVER_LATE
) -> np.ndarray:
    conditioning = actuator(of, computer, STEP)
    state = hold(conditioning, float(commands[0]))
    return np.array([condition(conditioning, state, float(command)) for command in commands])


def test_actuator_conditioning_in_closed_form():
    time = np.arange(2000) * STEP
    sine = 1.0 + 0.5 * np.sin(2 * np.pi * 4.0 * time) * (time > 0)
    late = through(Motor(delay=0.0101), sine)
    assert (
        np.max(np.abs(late[100:] - (1.0 + 0.5 * np.sin(2 * np.pi * 4.0 * (time[100:] - 0.0101)))))
        < 1e-4
    )
    assert np.array_equal(through(Cylinder(delay=0.0101), sine), late)
    assert np.array_equal(through(Motor(), sine, Computer(delay=0.0101)), late)
    step = np.where(time < 0.05, 0.0, 1.0)
    lagged = through(Motor(lag=0.02), step)
    fall = np.exp(-(time - 0.05) / 0.02) * (1.0 - np.exp(-STEP / 0.02))
    exact = np.where(time < 0.05, 0.0, 1.0 - 0.02 / STEP * fall)
    assert np.max(np.abs(lagged - exact)) < 1e-9
    assert np.max(through(Motor(gain=1.1), sine) - 1.1 * sine) == 0.0
    assert np.max(through(Motor(saturation=1.2), sine)) == 1.2
    assert np.max(np.abs(np.diff(through(Motor(rate_limit=3.0), sine)))) == pytest.approx(
        3.0 * STEP
    )
    assert np.max(np.abs(through(Motor(deadband=0.2), sine) - (sine - 0.2))) < 1e-12
    play = through(Cylinder(deadband=0.2), sine)
    assert np.max(np.abs(play - sine)) == pytest.approx(0.2)
    assert np.ptp(play) == pytest.approx(1.0 - 0.4)
    swing = sine - 1.0
    uneven = through(ForceActuator(gain=1.2, gain_asymmetry=0.4), swing)
    assert np.max(np.abs(uneven - 1.2 * np.where(swing > 0.0, 1.2, 0.8) * swing)) < 1e-12
    lame = through(ForceActuator(deadband=0.1, deadband_asymmetry=0.15), swing)
    upper, lower = np.maximum(swing - 0.175, 0.0), np.minimum(swing + 0.025, 0.0)
    assert np.max(np.abs(lame - upper - lower)) < 1e-12
    one_sided = through(ForceActuator(deadband_asymmetry=-0.4), swing)
    assert np.max(np.abs(one_sided - np.maximum(swing, 0.0) - np.minimum(swing + 0.2, 0.0))) < 1e-12


def test_sensor_in_closed_form():
    plant = RigPlant(
        load_cell=LoadCell(0.0, 0.0, 0.0, gain=1.1, offset=3.0, delay=0.0045),
        ground_lvdt=Lvdt(0, 0, 0, lag=0.02),
    )
    sensors = build_sensing(plant, 1e-3)
    time = np.arange(1000) * 1e-3
    wave = np.sin(2 * np.pi * 2.0 * time)
    step = np.where(time < 0.1, 0.0, 1.0)
    rows = [
        sample_sensors(sensors, Measurements(s, 0.0, 0.0, w), np.zeros(4))
        for s, w in zip(step.tolist(), wave.tolist(), strict=True)
    ]
    force = np.array([row.load_cell for row in rows])
    assert (
        np.max(np.abs(force[10:] - (3.0 + 1.1 * np.sin(2 * np.pi * 2.0 * (time[10:] - 0.0045)))))
        < 1e-4
    )
    ground = np.array([row.ground_lvdt for row in rows])
    assert (
        np.max(
            np.abs(ground - np.where(time < 0.0995, 0.0, 1 - np.exp(-(time + 5e-4 - 0.1) / 0.02)))
        )
        < (1e-3 / 0.02) ** 2 / 8.0
    )


def test_friction_in_closed_form():
    dry = friction(Rail(coulomb=50.0, stribeck=20.0, stribeck_velocity=0.01))
    gap = gap_at(0.0)
    assert breakaway(dry, gap, 0.0, 0.0, 0.0) == (70.0, 70.0)
    assert breakaway(dry, gap, 0.0, 0.01, 0.0)[0] == pytest.approx(50 + 20 * math.exp(-1))
    assert breakaway(dry, gap, 0.0, 1.0, 0.0)[1] == pytest.approx(50.0)
    uneven = friction(Rail(coulomb=50.0, asymmetry=12.0))
    assert breakaway(uneven, gap, 0.0, 0.1, 0.0) == (56.0, 44.0)


def test_backlash_is_felt_only_where_the_gap_is_taken_up():
    loose = friction(Rail(coulomb=50.0, backlash=0.004))
    gap = gap_at(0.0)
    path = np.concatenate([np.linspace(0, 0.01, 101), np.linspace(0.01, 0, 101)])
    felt = np.array([breakaway(loose, gap, float(x), 0.1, 0.0) for x in path])
    assert np.all(felt[21:101] == (50.0, 0.0)), "pushes its element on, and may come back freely"
    assert not np.any(felt[:20])
    after = path[101:][~felt[101:].any(axis=1)]
    assert np.ptp(after) == pytest.approx(0.004, abs=2e-4), "free over the gap after the reversal"
    assert np.all(felt[-1] == (0.0, 50.0))


def steady_force(plant: RigPlant, velocity: float) -> float:
    """Force of rail and tyre on the carriage when driven at a steady speed out of the tyre's reach,
    N."""
    model = build(plant, STEP)
    data = mujoco.MjData(model)
    view = handles(model, data)
    now = contacts(plant, 0.0, 0.0, 0.0)
    view.qpos[view.ground] = -1.0
    for number in range(50):
        drive(view, view.carriage, number * velocity * STEP, (number + 1) * velocity * STEP)
        view.applied[:] = 0.0
        touch(view, now)
        mujoco.mj_forward(model, data)
    return float((data.qfrc_constraint + data.qfrc_passive + data.qfrc_applied)[view.carriage])


@pytest.mark.parametrize("velocity", [-0.2, 0.05, 0.2])
def test_rail_force_at_a_steady_speed(velocity):
    rail = Rail(coulomb=50.0, viscous=300.0, asymmetry=12.0)
    expected = -(50.0 * math.copysign(1.0, velocity) + 300.0 * velocity + 6.0)
    quiet = RigPlant(carriage=Carriage(1e4), rail=rail, motor=Motor(coulomb=0.0))
    assert steady_force(quiet, velocity) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("damping", "hardening"), [(0.0, 40.0), (800.0, 0.0), (300.0, 25.0)])
def test_tyre_law(damping, hardening):
    plant = RigPlant(
        rail=Rail(coulomb=0.0), motor=Motor(coulomb=0.0), tyre=Tyre(50_000.0, damping, hardening)
    )
    model = build(plant, STEP)
    data = mujoco.MjData(model)
    view = handles(model, data)
    for deflection, rate in (
        (0.004, 0.0),
        (0.01, 0.05),
        (0.01, -0.05),
        (0.0005, -0.3),
        (-0.001, 0.1),
    ):
        view.qpos[view.carriage], view.qvel[view.carriage] = -deflection, -rate
        touch(view, contacts(plant, -deflection, deflection, 0.0))
        mujoco.mj_forward(model, data)
        law = (
            50_000 * deflection * (1 + hardening * deflection) + damping * rate
            if deflection > 0
            else 0.0
        )
        assert data.qfrc_constraint[view.carriage] == pytest.approx(
            max(law, 0.0), rel=1e-3, abs=1e-3
        )


def test_every_effect_of_every_machine_goes_to_another_process_and_back():
    for name in shipped():
        for effect in find(name).effects():
            back = pickle.loads(pickle.dumps(effect))
            assert back == effect
            assert back.kind is effect.kind


def test_kinds_are_told_by_name_and_components():
    assert all(pickle.loads(pickle.dumps(kind)) is kind for kind in KINDS)


def test_a_change_too_small_for_rounding_is_still_searched():
    guess = around_nominal(lambda scales: scales.force / scales.stroke, (-0.3, 0.02, 0.9), 0.005)
    nothing = SimpleNamespace(force=1e-12, stroke=1e-3)
    meaning = {"stiffness": SimpleNamespace(low=0.0, high=1e12)}
    kind = SimpleNamespace(parameters=("stiffness",))
    effect = SimpleNamespace(quantities=lambda: meaning, kind=kind)
    context: Any = SimpleNamespace(effect=effect, nominal=8e6, scales=nothing)
    starts = guess(context)
    assert len(starts.values) == 3
    assert all(abs(value - 8e6) > 1.0 for (value,) in starts.values)
