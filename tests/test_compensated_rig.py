"""The suspension rig with a compensator of its structure cylinder: linear loop, and the twin."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from controllers.compensated import Compensated
from controllers.linear_law import pass_through
from experiments import find
from experiments.vehicles import VEHICLES, configuration
from rigtwin.components import Cylinder
from rigtwin.components.cylinder import state_space
from rigtwin.studies.stability.compensated import (
    actuator_of,
    plate_compensator,
    with_cylinder_delay,
    with_filters,
)
from rigtwin.studies.stability.sampled_loop import decay

PERIOD, FAST, LATE = 1e-3, 2e-3, 8e-3


def test_a_lag_of_the_cylinder_is_in_series():
    plain, slow = actuator_of(Cylinder()), actuator_of(Cylinder(lag=0.01, gain=1.02))
    s = 2j * np.pi * 2.0

    def at(actuator) -> complex:
        size = len(actuator.a)
        return complex(actuator.c @ np.linalg.solve(s * np.eye(size) - actuator.a, actuator.b))

    assert at(slow) == pytest.approx(1.02 * at(plain) / (1.0 + 0.01 * s), rel=1e-9)
    assert len(state_space(Cylinder())[0]) == 4


def test_passing_the_command_through_changes_no_pole():
    nominal = configuration(VEHICLES["motorcycle"])
    assert decay(nominal, pass_through()) == pytest.approx(decay(nominal), rel=1e-12)


@pytest.mark.parametrize("name", VEHICLES)
def test_every_vehicle_of_table_6_1_is_stable_with_its_plate_compensated_and_fast_filters(name):
    vehicle = configuration(VEHICLES[name])
    assert decay(vehicle) < 0.0
    law = plate_compensator(vehicle.plant.structure_cylinder, PERIOD)
    assert decay(with_filters(vehicle, FAST), law) > 0.0


def test_a_late_cylinder_needs_a_compensator_that_knows_it():
    late = with_cylinder_delay(with_filters(configuration(VEHICLES["truck"]), FAST), LATE)
    assert decay(late, plate_compensator(Cylinder(), PERIOD)) < 0.0
    for told in (0.5 * LATE, LATE, 1.5 * LATE):
        assert decay(late, plate_compensator(Cylinder(delay=told), PERIOD)) > 0.0


def test_a_motorcycle_that_trips_without_compensation_comes_to_rest_with_it():
    rig, settings = rigtwin.machine("suspension-rig"), {"timing": {"duration": 2.5}}
    alone = rigtwin.run(rig, "motorcycle", seed=1, settings=settings)
    assert len(alone.time) < 2500
    nominal = find("motorcycle").configuration
    law = plate_compensator(nominal.plant.structure_cylinder, PERIOD)
    controller = Compensated(nominal.controller, PERIOD, law)
    tested = rigtwin.run(rig, "motorcycle", seed=1, settings=settings, controller=controller)
    assert len(tested.time) == 2500
    assert np.std(tested["/sensor.structure_lvdt"][-500:]) < 3e-4


@pytest.mark.slow
def test_what_tripped_is_diagnosed_and_runs_with_the_compensator_of_the_corrected_twin(capsys):
    example = Path(__file__).parents[1] / "examples" / "late_cylinder.py"
    runpy.run_path(str(example))["main"]([])
    nominal, tripped, why, tested = capsys.readouterr().out.splitlines()
    assert "completed" in nominal
    assert "trip" in tripped
    assert why.startswith("The structure cylinder has a delay of ")
    assert " and " not in why
    assert "completed, 10.0 s" in tested
