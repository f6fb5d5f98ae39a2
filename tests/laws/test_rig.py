"""The suspension rig's motor and carriage as the diagnosis replays them, one component alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import Carriage, Motor, Rail, RigPlant, Tyre
from rigtwin.description.configuration import Configuration
from rigtwin.rig.component import replay_carriage, replay_motor
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = PERIOD * np.arange(600)
TRAVEL = 0.03 * np.sin(2.0 * np.pi * 2.0 * TIME)
SPEED = 0.03 * 4.0 * np.pi * np.cos(2.0 * np.pi * 2.0 * TIME)
FREE = Rail(coulomb=0.0)


def cell_force(motor: Motor, voltage: np.ndarray, travel: np.ndarray = TRAVEL) -> np.ndarray:
    """Return the load cell's force in N, shape (ticks,), of a motor that is moved through."""
    plant = RigPlant(motor=motor)
    configuration = Configuration(plant=plant)
    return replay_motor(configuration, travel, voltage, motor.constant * float(voltage[0]))


@law_of("viscous", Motor)
@law_of("coulomb", Motor)
@law_of("asymmetry", Motor)
@law_of("stribeck", Motor)
@law_of("load_friction", Motor)
@law_of("cogging", Motor)
@pytest.mark.parametrize(
    "motor",
    [
        Motor(),
        Motor(viscous=60.0),
        Motor(coulomb=25.0, asymmetry=6.0),
        Motor(stribeck=12.0, stribeck_velocity=0.1, stribeck_exponent=1.0),
        Motor(load_coefficient=0.05),
        Motor(cogging=10.0),
        Motor(coulomb=0.0, cogging=7.0, cogging_pitch=0.02, cogging_phase=0.6),
    ],
)
def test_the_load_cell_feels_the_motor_less_its_friction(motor):
    """F = K V + F_w sin(2π x/p + φ) − b v − R sgn v."""
    force = 186.0 * 1.5
    found = cell_force(motor, np.full(len(TIME), 1.5))
    ratio = np.abs(SPEED) / motor.stribeck_velocity
    size = motor.coulomb + motor.load_coefficient * force
    size = size + motor.stribeck * np.exp(-(ratio**motor.stribeck_exponent))
    dry = np.where(SPEED > 0.0, size + motor.asymmetry / 2.0, -(size - motor.asymmetry / 2.0))
    wave = np.sin(2.0 * math.pi * TRAVEL / motor.cogging_pitch + motor.cogging_phase)
    expected = force + motor.cogging * wave - motor.viscous * SPEED - dry
    away = np.abs(SPEED) > 0.01
    away[0] = False
    np.testing.assert_allclose(found[away], expected[away], atol=0.2)


@pytest.mark.parametrize(("constant", "lag"), [(186.0, 1.26e-3), (150.0, 8e-3)])
def test_the_motors_force_follows_its_voltage_with_its_time_constant(constant, lag):
    """F = K V (1 − exp(−t/T))."""
    motor = Motor(constant=constant, time_constant=lag, coulomb=0.0)
    if constant == 186.0:
        motor = Motor(coulomb=0.0)
    voltage = np.where(TIME < 0.1, 0.0, 2.0)
    found = cell_force(motor, voltage)
    expected = 2.0 * constant * (1.0 - np.exp(-np.maximum(TIME - 0.1, 0.0) / lag))
    np.testing.assert_allclose(found, expected, atol=0.5)


@pytest.mark.parametrize(
    ("motor", "most"),
    [
        (Motor(), 1860.0),
        (Motor(voltage_limit=4.0), 4.0 * 186.0),
        (Motor(force_limit=500.0), 500.0),
    ],
)
def test_the_motors_force_stays_within_its_limits(motor, most):
    voltage = np.where(TIME < 0.1, 0.0, 30.0)
    found = cell_force(motor._replace(coulomb=0.0), voltage)
    assert found[-1] == pytest.approx(most, rel=1e-3)


def wheel_under(plant: RigPlant, force: np.ndarray) -> np.ndarray:
    """Return the wheel's position in m, shape (ticks,), under an upward force in N."""
    configuration = Configuration(plant=plant)
    return replay_carriage(configuration, np.zeros(len(force)), -force, 0.0)


@law_of("mass", Carriage)
@law_of("viscous", Rail)
@law_of("coulomb", Rail)
@pytest.mark.parametrize(
    ("carriage", "rail"),
    [
        (Carriage(), FREE),
        (Carriage(), Rail()),
        (Carriage(20.0), Rail(coulomb=30.0, viscous=120.0)),
    ],
)
def test_a_lifted_carriage_accelerates_against_the_rails_friction(carriage, rail):
    """m v' = F − F_c − b v, so x = u (t − τ (1 − exp(−t/τ))), τ = m/b and u = (F − F_c)/b."""
    plant = RigPlant(carriage=carriage, rail=rail)
    found = wheel_under(plant, np.full(len(TIME), 120.0))
    net, mass = 120.0 - rail.coulomb, carriage.mass
    expected = 0.5 * net / mass * TIME**2
    if rail.viscous > 0.0:
        fade = mass / rail.viscous
        expected = net / rail.viscous * (TIME - fade * (1.0 - np.exp(-TIME / fade)))
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected[-1])


def test_the_nominal_carriage_has_34_kilograms():
    found = wheel_under(RigPlant(rail=FREE), np.full(len(TIME), 34.0))
    assert found[-1] == pytest.approx(0.5 * TIME[-1] ** 2, rel=2e-3)


@law_of("coulomb", Rail)
@law_of("asymmetry", Rail)
@law_of("stribeck", Rail)
def test_the_rail_holds_the_carriage_up_to_its_breakaway_force():
    """Breakaway is F_c + F_s ± ½ a."""
    rail = Rail(40.0, stribeck=10.0, asymmetry=8.0)
    for force, moves in ((53.0, False), (55.0, True)):
        found = wheel_under(RigPlant(rail=rail), np.full(len(TIME), force))
        assert bool(abs(found[-1]) > 1e-4) is moves


@law_of("stiffness", Tyre)
@law_of("mass", Carriage)
@pytest.mark.parametrize(("mass", "stiffness"), [(34.0, 50_000.0), (20.0, 80_000.0)])
def test_a_pressed_carriage_swings_on_its_tyre(mass, stiffness):
    """x = −F/k (1 − cos(√(k/m) t))."""
    plant = RigPlant(rail=FREE, tyre=Tyre(stiffness), carriage=Carriage(mass))
    found = wheel_under(plant, np.full(len(TIME), -100.0))
    swing = 1.0 - np.cos(math.sqrt(stiffness / mass) * TIME)
    np.testing.assert_allclose(found, -100.0 / stiffness * swing, atol=0.02 * 100.0 / stiffness)


@law_of("damping", Tyre)
@law_of("hardening", Tyre)
def test_a_damped_tyre_comes_to_rest_where_it_bears_the_force():
    """F = k δ (1 + c δ (δ/10 mm)^(p−1))."""
    tyre = Tyre(damping=1500.0, hardening=60.0, hardening_power=2.0)
    found = wheel_under(RigPlant(rail=FREE, tyre=tyre), np.full(len(TIME), -800.0))
    rest = -found[-1]
    assert 50_000.0 * rest * (1.0 + 60.0 * rest * (rest / 0.01)) == pytest.approx(800.0, rel=1e-3)
    undamped = wheel_under(RigPlant(rail=FREE), np.full(len(TIME), -100.0))
    damped = wheel_under(RigPlant(rail=FREE, tyre=Tyre(damping=200.0)), np.full(len(TIME), -100.0))
    # An oscillator loses the factor exp(−d T/(2 m)) in each period T.
    period = round(2.0 * math.pi * math.sqrt(34.0 / 50_000.0) / PERIOD)
    decay = np.ptp(damped[2 * period : 3 * period]) / np.ptp(damped[:period])
    assert decay == pytest.approx(math.exp(-200.0 * 2 * period * PERIOD / 68.0), rel=0.05)
    assert np.ptp(undamped[2 * period : 3 * period]) == pytest.approx(
        np.ptp(undamped[:period]), rel=0.01
    )
