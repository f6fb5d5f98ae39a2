"""A plate that yields to its load."""

import numpy as np
import pytest

from experiments import EXPERIMENTS
from rigtwin.components import RigPlant
from rigtwin.components.yielding import Rod, rod_load, solve_yielding
from rigtwin.models.quarter_car import QuarterCarModel

RAIL, TIMESTEP = (0.3, 0.2), 1e-3


@pytest.mark.parametrize("rhs", [-3.0, -0.5, -0.01, 0.0, 0.01, 0.5, 3.0])
@pytest.mark.parametrize("free", [-0.7, 0.0, 0.7])
@pytest.mark.parametrize("share", [1e-9, 1e-4, 1e-2])
@pytest.mark.parametrize("viscous", [0.0, 200.0])
def test_velocity_and_load_are_solved_exactly(rhs, free, share, viscous):
    inertia, force, forward, backward = 1.5, 30.0, 100.0, 40.0
    rod = Rod(free, share, force, viscous, forward, backward)
    v, load = solve_yielding(rod, rhs, inertia, TIMESTEP, RAIL)
    # What is left is the rail's, within its bounds and at one of them while it slides.
    left = rhs - inertia * v - TIMESTEP * load
    assert -RAIL[1] - 1e-9 <= left <= RAIL[0] + 1e-9
    if abs(v) > 1e-12:
        assert left == pytest.approx(RAIL[0] if v > 0.0 else -RAIL[1])
    sliding = free + share * load - v
    dry = force - viscous * sliding - load
    assert -backward - 1e-6 <= dry <= forward + 1e-6
    if abs(sliding) > 1e-9:
        assert dry == pytest.approx(forward if sliding > 0.0 else -backward)


def test_a_stiff_plate_moves_as_it_is_driven():
    rod = Rod(0.7, 1e-12, 30.0, 5.0, 10.0, 10.0)
    _, load = solve_yielding(rod, 0.02, 1.5, TIMESTEP, RAIL)
    assert load == pytest.approx(rod_load(rod, 0.0), rel=1e-3)


def integrate_with_a_plate_of_its_own(
    plant: RigPlant, voltage: np.ndarray, preload: float, period: float
) -> np.ndarray:
    """The same rig held still by its commands, its structure plate a small mass on a spring and a
    damper: dry friction smoothed, explicit steps of 2 us. Load cell force at every tick, N."""
    step, mass, plate = 2e-6, plant.carriage.mass, 0.02
    stiffness = 1.0 / plant.structure_cylinder.compliance
    damper = 2.0 * 0.3 * np.sqrt(stiffness * plate)
    x, v, force = 0.0, 0.0, preload
    y, w = plant.structure_cylinder.compliance * preload, 0.0
    rest = preload / plant.tyre.stiffness
    cells = []
    for volts in voltage:
        cells.append(stiffness * y + damper * w)
        for _ in range(round(period / step)):
            rod = force - plant.motor.coulomb * np.tanh((w - v) / 1e-5)
            rail = plant.rail.coulomb * np.tanh(v / 1e-5)
            tyre = plant.tyre.stiffness * (rest - x)
            v += step / mass * (tyre - rod - rail)
            w += step / plate * (rod - stiffness * y - damper * w)
            x += step * v
            y += step * w
            share = 1.0 - np.exp(-step / plant.motor.time_constant)
            force += share * (plant.motor.constant * volts - force)
    return np.array(cells)


@pytest.mark.slow
def test_a_yielding_plate_agrees_with_one_that_has_a_mass():
    plant = RigPlant()
    plant = plant._replace(
        structure_cylinder=plant.structure_cylinder._replace(compliance=5e-6),
        rail=plant.rail._replace(coulomb=5.0),
    )
    configuration = EXPERIMENTS["imposed"].configuration._replace(plant=plant)
    preload, period = configuration.controller.preload, configuration.timing.period
    ticks = np.arange(200)
    voltage = preload / plant.motor.constant + 0.8 * np.sin(2 * np.pi * 9.0 * ticks * period)
    still = np.zeros(len(ticks))
    start = -preload / plant.tyre.stiffness
    reduced = QuarterCarModel(still, still + start, voltage, configuration, 10)
    expected = integrate_with_a_plate_of_its_own(plant, voltage, preload, period)
    apart = reduced.predict_true(plant)[3] - expected
    assert np.std(expected) > 50.0
    assert np.sqrt(np.mean(apart**2)) < 0.03 * np.std(expected)
