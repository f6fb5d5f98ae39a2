"""A joint's equation of motion: closed forms, and MuJoCo's own integration of the same MJCF."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from rigtwin.components import Guide, PositionActuator, with_parameters
from rigtwin.components.dry_friction import dry_limits, friction, slide
from rigtwin.components.guide_step import guide_step_of
from rigtwin.description.catalogue import find
from rigtwin.description.machine import Machine
from rigtwin.models.following import follow_command
from rigtwin.models.joint import JointModel
from rigtwin.models.joint_inverse import inverse_dynamics
from rigtwin.models.joint_motion import Inertia
from rigtwin.models.measured_motion import may_be_at_rest
from rigtwin.recording import RecordedTest
from rigtwin.signals.motion import smooth
from tests.helpers.described import described, recording_of

PERIOD = 1e-3


def moved(guide: Guide, position: np.ndarray, mass: float = 0.0, spring: float = 1e9) -> np.ndarray:
    velocity = np.gradient(position, PERIOD)
    motion = np.ascontiguousarray(np.stack([position, velocity, np.gradient(velocity, PERIOD)]))
    out = np.empty(len(position))
    inertia = Inertia(mass, -1.0, 2.0, np.zeros(2), turns=False)
    inverse_dynamics(guide_step_of(guide, spring, 0.0, PERIOD), inertia, motion, out)
    return out


TIME = np.arange(3000) * PERIOD
SINE = 0.02 * np.sin(2 * np.pi * TIME)
SPEED = np.gradient(SINE, PERIOD)


@pytest.mark.parametrize(
    ("values", "force"),
    [
        ({"viscous": 300.0}, 300.0 * SPEED),
        ({"stiffness": 2000.0, "offset": 5.0}, 2000.0 * SINE + 5.0),
        ({"drag": 800.0}, 800.0 * SPEED * np.abs(SPEED)),
        ({"viscous": 300.0, "viscous_asymmetry": 100.0}, 300.0 * SPEED + 50.0 * np.abs(SPEED)),
        (
            {"cogging": 3.0, "cogging_pitch": 0.01, "cogging_phase": 0.4},
            3.0 * np.sin(200.0 * np.pi * SINE + 0.4),
        ),
    ],
)
def test_each_force_is_its_closed_form(values, force):
    np.testing.assert_allclose(moved(Guide(**values), SINE), force, atol=1e-9)


def test_mass_adds_its_acceleration():
    expected = 4.0 * np.gradient(np.gradient(SINE, PERIOD), PERIOD)
    np.testing.assert_allclose(moved(Guide(), SINE, mass=4.0), expected, atol=1e-9)


def test_rigid_friction_opposes_motion():
    away = np.abs(SPEED) > 0.01
    away[0] = False
    assert np.array_equal(moved(Guide(coulomb=20.0), SINE)[away], 20.0 * np.sign(SPEED[away]))


def test_friction_differs_by_direction_and_near_standstill():
    uneven = friction(Guide(coulomb=20.0, asymmetry=6.0))
    assert dry_limits(uneven, 0.1, 0.0) == (23.0, 17.0)
    greater_at_rest = friction(Guide(coulomb=20.0, stribeck=8.0, stribeck_velocity=0.01))
    assert dry_limits(greater_at_rest, 0.0, 0.0)[0] == 28.0
    assert dry_limits(greater_at_rest, 1.0, 0.0)[0] == pytest.approx(20.0)


def test_friction_acts_through_its_spring_and_backlash():
    """After a reversal: the spring lets go over 2·F/k with the play between, then the slider slides
    again."""
    fall = np.concatenate([np.linspace(0.0, 0.02, 1000), np.linspace(0.02, 0.0, 1000)])
    force = moved(Guide(coulomb=20.0, backlash=0.003), fall, spring=1e4)
    back = 0.02 - fall[1000:]
    assert force[999] == pytest.approx(20.0)
    expected = np.where(
        back < 0.002,
        20.0 - 1e4 * back,
        np.where(back < 0.005, 0.0, np.maximum(-1e4 * (back - 0.005), -20.0)),
    )
    np.testing.assert_allclose(force[1000:], expected, atol=1e-6)


def test_a_friction_element_slips_only_down_to_its_limit():
    force, by = slide(0.005, 0.001, 1e4, 20.0, 30.0)
    assert (force, by) == (20.0, pytest.approx(0.002))
    assert slide(-0.0035, 0.001, 1e4, 20.0, 30.0) == (-25.0, 0.0)


def test_viscous_friction_through_a_spring_lags():
    lagged = moved(Guide(viscous=300.0, relaxation=0.05), SINE)[1000:]
    w = 2 * np.pi
    expected = (
        300.0 * 0.02 * w / np.hypot(1.0, 0.05 * w) * np.cos(w * TIME[1000:] - np.arctan(0.05 * w))
    )
    np.testing.assert_allclose(lagged, expected, atol=0.02 * np.max(expected))


def test_a_mount_makes_viscous_friction_lag():
    """Behind a spring of compliance c viscous friction b lags by b·c."""
    yielding = moved(Guide(viscous=300.0, mount_compliance=1e-4), SINE)[1000:]
    w = 2 * np.pi
    expected = (
        300.0 * 0.02 * w / np.hypot(1.0, 0.03 * w) * np.cos(w * TIME[1000:] - np.arctan(0.03 * w))
    )
    np.testing.assert_allclose(yielding, expected, atol=0.02 * np.max(expected))


def test_a_mount_stretches_before_dry_friction_slips():
    """Dry friction behind a mount is a spring until it slips, whatever else is behind it."""
    there = np.concatenate([np.linspace(0.0, 0.02, 1000), np.linspace(0.02, 0.0, 1000)])
    guide = Guide(coulomb=20.0, stiffness=500.0, mount_compliance=1e-4)
    force = moved(guide, there, spring=1e9)
    # Slipping, the guide is at x − c·F, and F = 20 + 500·(x − c·F).
    slipping = (20.0 + 500.0 * 0.02) / 1.05
    assert force[999] == pytest.approx(slipping, rel=1e-4)
    back = 0.02 - there[1000:]
    low = (500.0 * there[1000:] - 20.0) / 1.05
    np.testing.assert_allclose(force[1000:], np.maximum(slipping - 1e4 * back, low), atol=0.02)


def test_a_mass_on_a_stuck_guide_oscillates_on_its_mount(tmp_path):
    """ω² = 1/(c·m), without numerical damping."""
    machine = described(tmp_path, "slide")
    pushed = {"/command": {"force": np.full(3000, 5.0)}, "/sensor": {"position": np.zeros(3000)}}
    recording = RecordedTest(Path("bench"), machine.name, "", PERIOD, TIME, pushed, {})
    model = JointModel(
        machine, machine.replays[0], recording.inputs, machine.configuration_of(recording), 4
    )
    values = {"coulomb": 1e4, "viscous": 0.0, "stiffness": 0.0, "mount_compliance": 1e-3}
    plant = with_parameters(machine.plant, "guide", values)
    mass = plant.mass.mass + machine.replays[0].joint.armature
    expected = 5e-3 * (1.0 - np.cos(TIME / np.sqrt(1e-3 * mass)))
    found = model.move(plant)[0]
    np.testing.assert_allclose(found, expected, atol=0.02 * np.ptp(expected))


# What follows a command.


def test_an_ideal_actuator_follows_half_a_tick_late():
    command = np.cumsum(np.ones(100)) * 1e-3
    np.testing.assert_allclose(
        follow_command(PositionActuator(), command, 0.0, PERIOD, 4)[5:],
        command[5:] - 0.5e-3,
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("values", "transfer"),
    [
        ({"lag": 0.02}, lambda s: 1 / (1 + 0.02 * s)),
        ({"lag": 0.02, "second_lag": 0.01}, lambda s: 1 / ((1 + 0.02 * s) * (1 + 0.01 * s))),
        ({"delay": 0.015}, lambda s: np.exp(-0.015 * s)),
        ({"gain": 0.9}, lambda s: 0.9 + 0 * s),
        (
            {"natural_frequency": 5.0, "damping_ratio": 0.3},
            lambda s: (10 * np.pi) ** 2 / (s**2 + 6 * np.pi * s + (10 * np.pi) ** 2),
        ),
    ],
)
def test_an_actuator_has_its_frequency_response(values, transfer):
    time = np.arange(20_000) * PERIOD
    for frequency in (0.5, 3.0, 8.0):
        w = 2 * np.pi * frequency
        position = follow_command(PositionActuator(**values), np.sin(w * time), 0.0, PERIOD, 4)
        last = slice(10_000, 20_000)
        found = 2.0j * np.mean(position[last] * np.exp(-1j * w * time[last]))
        # A held command is half a tick late.
        assert abs(found - transfer(1j * w) * np.exp(-0.5j * w * PERIOD)) < 1e-3


def test_backlash_of_a_position_actuator_has_its_width():
    command = 0.01 * np.sin(2 * np.pi * TIME)
    position = follow_command(PositionActuator(deadband=0.002), command, 0.0, PERIOD, 1)
    assert np.max(position[1000:]) == pytest.approx(0.008, abs=1e-5)


def test_a_rate_limit_holds():
    position = follow_command(
        PositionActuator(rate_limit=0.05), 0.02 * np.sign(np.sin(TIME)), 0.0, PERIOD, 4
    )
    assert np.max(np.abs(np.diff(position))) <= 0.05 * PERIOD * 1.0001


# Against MuJoCo.


def simulated(machine: Machine, command: np.ndarray, fine: int = 20) -> np.ndarray:
    """MuJoCo's own run of the machine's MJCF, position at every tick."""
    model = mujoco.MjModel.from_xml_path(str(machine.model))
    model.opt.timestep = PERIOD / fine
    data, out = mujoco.MjData(model), np.empty(len(command))
    for tick, value in enumerate(command):
        out[tick] = data.qpos[0]
        data.ctrl[0] = value
        mujoco.mj_step(model, data, fine)
    return out


@pytest.mark.parametrize("sort", ["slide", "pendulum"])
def test_a_pushed_joint_moves_as_mujoco_moves_it(tmp_path: Path, sort: str):
    machine = described(tmp_path, sort)
    command = 3.0 * np.sin(2 * np.pi * 0.7 * TIME) + 1.5 * np.sin(2 * np.pi * 2.1 * TIME)
    position = simulated(machine, command)
    model = machine.physics.model(
        machine, recording_of(machine, command, position).inputs, machine.configuration, 20
    )
    assert np.ptp(position) > 0.01
    np.testing.assert_allclose(
        model.predict(machine.plant)[0], position, atol=0.004 * np.ptp(position)
    )


def test_a_block_slows_down_by_its_friction_and_stays(tmp_path: Path):
    machine = described(tmp_path, "slide")
    plant = machine.plant._replace(guide=Guide(coulomb=4.0))
    recording = recording_of(machine, np.where(TIME < 0.5, 10.0, 0.0), np.zeros(len(TIME)))
    model = machine.physics.model(
        machine, recording.inputs, machine.configuration._replace(plant=plant), 4
    )
    position = model.predict(plant)[0]
    # 2 kg: 3 m/s² for half a second, then −2 m/s² until it rests.
    assert position[-1] == pytest.approx(0.375 + 1.5**2 / 4.0, rel=0.003)
    assert position[-1] == pytest.approx(position[-500], abs=1e-9)


def test_a_loop_is_closed_by_the_controllers_formula():
    machine = find("emps")
    reference = 0.05 * (1 - np.cos(2 * np.pi * 0.5 * TIME))
    columns = {
        "/command": {
            "reference": reference,
            "force": np.zeros(len(TIME)),
            "pulse_voltage": np.zeros(len(TIME)),
        },
        "/sensor": {"position": reference},
    }
    recording = RecordedTest(Path("emps"), "emps", "", PERIOD, TIME, columns, {})
    model = machine.physics.model(machine, recording.inputs, machine.configuration, 8)
    force = model.predict(machine.plant)[0]
    speed = np.gradient(reference, PERIOD)
    needed = 95.1 * np.gradient(speed, PERIOD) + 203.5 * speed
    np.testing.assert_allclose(force[500:-5], needed[500:-5], atol=0.02 * np.max(np.abs(needed)))


def test_a_measured_motion_is_smoothed_to_below_its_noise():
    random = np.random.default_rng(1)
    time = np.arange(8000) * PERIOD
    true = 0.02 * np.sin(2 * np.pi * time) + 0.005 * np.sin(2 * np.pi * 2.3 * time)
    found, error, *_ = smooth(true + 1e-5 * random.standard_normal(8000), PERIOD)
    left = (found - true)[300:-300]
    assert np.std(left) < 3e-6
    assert error < 3e-6


def test_a_joint_stands_where_its_velocity_is_within_its_error() -> None:
    """A stop of 0.2 s within a swing of 10 mm, seen with a noise of 10 µm."""
    time = np.arange(4000) * PERIOD
    swing = 0.01 * np.sin(2.0 * np.pi * 1.0 * time)
    stop = (np.abs(time - 1.25) < 0.1) | (np.abs(time - 2.25) < 0.1)
    true = np.interp(time, time[~stop], swing[~stop])
    noisy = true + 1e-5 * np.random.default_rng(3).standard_normal(len(true))
    found, _, rate_error, resolution = smooth(noisy, PERIOD)
    rate = np.gradient(found, PERIOD)
    moving = np.abs(np.gradient(true, PERIOD)) > 0.02
    # The error of the velocity is that of the filter's passband.
    assert np.std((rate - np.gradient(true, PERIOD))[moving]) < 3.0 * rate_error
    stands = may_be_at_rest(rate, rate_error, resolution, PERIOD)
    # Around the stops is left out what the filter cannot tell from them, and nothing else.
    assert 0.005 < resolution < 0.05
    distance = np.minimum(np.abs(time - 1.25), np.abs(time - 2.25))
    assert np.mean(stands[distance < 0.1]) > 0.9
    assert not stands[moving & (distance > 0.1 + 3.0 * resolution)].any()


def test_a_joint_that_never_moves_is_judged_throughout() -> None:
    noise = 1e-5 * np.random.default_rng(3).standard_normal(4000)
    found, _, rate_error, resolution = smooth(0.2 + noise, PERIOD)
    rate = np.gradient(found, PERIOD)
    assert not may_be_at_rest(rate, rate_error, resolution, PERIOD).any()
