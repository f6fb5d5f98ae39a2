"""The suspension rig with a compensator of its structure cylinder: linear loop, and the twin."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from controllers import (
    Demand,
    Measurements,
    PlateCompensator,
    controller,
    initial_state,
    update,
)
from controllers.closed_loop import ClosedLoop, transfer, with_lag
from controllers.kalman_inverse import ActuatorDynamics, sampled_actuator
from controllers.linear_law import pass_through
from controllers.plate import cylinder_model, plate
from experiments import find
from experiments.vehicles import VEHICLES, configuration
from rigtwin.components import Computer, Cylinder
from rigtwin.components.cylinder import closed_loop
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import RigControl
from rigtwin.diagnosis.controller import ControllerReplay
from rigtwin.errors import RigtwinError
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.loop import run
from rigtwin.simulation.twin import Twin
from rigtwin.studies.stability.compensated import (
    with_cylinder_delay,
    with_exact_plate,
    with_filters,
)
from rigtwin.studies.stability.sampled_loop import decay
from tests.helpers.linear_law import response

PERIOD, FAST, LATE = 1e-3, 2e-3, 8e-3


def test_a_lag_of_the_cylinder_is_in_series():
    plain, slow = (closed_loop(each) for each in (Cylinder(), Cylinder(lag=0.01, gain=1.02)))
    s = 2j * np.pi * 2.0

    def by_states(loop: ClosedLoop) -> complex:
        a, b, c = with_lag(loop)
        return complex(c @ np.linalg.solve(s * np.eye(len(a)) - a, b))

    def by_polynomials(loop: ClosedLoop) -> complex:
        above, below = transfer(loop)
        return complex(np.polyval(above, s) / np.polyval(below, s))

    for at in (by_states, by_polynomials):
        assert at(slow) == pytest.approx(1.02 * at(plain) / (1.0 + 0.01 * s), rel=1e-9)
        assert at(plain) == pytest.approx(by_states(plain), rel=1e-9)


def test_passing_the_command_through_changes_no_pole():
    nominal = configuration(VEHICLES["motorcycle"])
    assert decay(nominal, pass_through()) == pytest.approx(decay(nominal), rel=1e-12)


def compensated(test: Configuration, told_delay: float = 0.0) -> Configuration:
    """By the Kalman inverse of the nominal cylinder with that delay."""
    kind = PlateCompensator.KALMAN_INVERSE
    settings = test.controller._replace(plate_compensator=kind, plate_delay=told_delay)
    return test._replace(controller=settings)


@pytest.mark.parametrize("name", VEHICLES)
def test_every_vehicle_of_table_6_1_is_stable_with_its_plate_compensated_and_fast_filters(name):
    vehicle = configuration(VEHICLES[name])
    assert decay(vehicle) < 0.0
    assert decay(compensated(with_filters(vehicle, FAST))) > 0.0


def test_a_late_cylinder_needs_a_compensator_that_knows_it():
    late = with_cylinder_delay(with_filters(configuration(VEHICLES["truck"]), FAST), LATE)
    assert decay(compensated(late)) < 0.0
    for share in (0.5, 1.0, 1.5):
        assert decay(compensated(late, share * LATE)) > 0.0


def test_what_a_controller_is_told_is_the_cylinder_as_it_is():
    plant = configuration(VEHICLES["truck"]).plant
    cylinder = plant.structure_cylinder._replace(gain=1.1, lag=0.002, delay=0.003, a3=170.0)
    plant = plant._replace(structure_cylinder=cylinder, computer=Computer(delay=0.002))
    found = cylinder_model(with_exact_plate(Configuration(plant=plant)).controller)
    assert found == closed_loop(cylinder)._replace(delay=0.005)


@pytest.mark.parametrize("kind", [each for each in PlateCompensator if each.value])
def test_every_compensator_takes_the_delay_out_of_slow_motions(kind: PlateCompensator):
    """At 0.05 Hz, of a cylinder in steady state: the law's phase and the cylinder's cancel."""
    loop = ClosedLoop(delay=0.004)
    settings = compensated(Configuration(), loop.delay).controller._replace(plate_compensator=kind)
    law = plate(settings, PERIOD).law
    a, b, c = sampled_actuator(ActuatorDynamics(*with_lag(loop), loop.delay), PERIOD)
    z = np.exp(2j * np.pi * 0.05 * PERIOD)
    cylinder = complex(c @ np.linalg.solve(z * np.eye(len(a)) - a, b))
    ahead, back = response(law, 0.05, PERIOD)
    plain = abs(np.angle(cylinder))
    assert plain > 0.004
    assert abs(np.angle(cylinder * ahead / (1.0 - cylinder * back))) < 0.1 * plain


@pytest.mark.parametrize("kind", PlateCompensator)
def test_compiled_and_in_python_it_commands_the_same(kind: PlateCompensator):
    test = find("drop").configuration
    settings = test.controller._replace(plate_compensator=kind, plate_delay=0.0025)
    test = test._replace(controller=settings, timing=test.timing._replace(duration=0.6))
    demands = find("drop").demands(test, 1)
    slow, fast = (
        np.concatenate([block.commands for block in blocks])
        for blocks in (
            run(Twin(test, 0.0, 1), test, demands),
            run_compiled(Twin(test, 0.0, 1), test, demands),
        )
    )
    assert len(fast) == 600
    assert np.array_equal(slow, fast)


def test_a_look_that_is_thrown_away_changes_nothing():
    settings = compensated(Configuration()).controller
    controlling = controller(settings, PERIOD)
    state = initial_state(controlling)
    sensed, demand = Measurements(0.0, -0.004, 0.0, 200.0), Demand(0.0, 0.0, 0.0)
    once = update(controlling, state, sensed, demand)
    again = update(controlling, state, sensed, demand)
    assert once[1] == again[1]
    assert np.array_equal(once[0].plate, again[0].plate)


def test_an_imposed_test_has_no_model_whose_plate_could_be_late():
    test = find("imposed").configuration
    demands = find("imposed").demands(test, 1)[:400]
    plain, repeated = (
        next(run_compiled(Twin(each, 0.0, 1), each, demands, block=400)).commands
        for each in (test, compensated(test))
    )
    assert np.array_equal(plain, repeated)


def test_a_cylinder_without_an_inverse_is_named():
    with pytest.raises(RigtwinError, match="plate_compensator = kalman-inverse: there is none"):
        rigtwin.run(
            "suspension-rig",
            "drop-compensated",
            settings={"controller": {"plate_lag": 3.6e-8, "plate_delay": 0.05}},
        )


def test_a_motorcycle_that_trips_without_compensation_comes_to_rest_with_it():
    rig, settings = rigtwin.machine("suspension-rig"), {"timing": {"duration": 2.5}}
    alone = rigtwin.run(rig, "motorcycle", seed=1, settings=settings)
    assert len(alone.time) < 2500
    told_of = {"controller": {"plate_compensator": "kalman-inverse"}, **settings}
    tested = rigtwin.run(rig, "motorcycle", seed=1, settings=told_of)
    assert len(tested.time) == 2500
    assert np.std(tested["/sensor.structure_lvdt"][-500:]) < 3e-4


@pytest.mark.slow
def test_what_was_told_wrong_of_the_delay_is_found_in_the_commands(tmp_path):
    """The recording says 0, the controller had 4 ms."""
    path = tmp_path / "told.mcap"
    settings = {"timing": {"duration": 3.0}, "controller": {"plate_delay": 0.004}}
    ran = rigtwin.run("suspension-rig", "drop-compensated", seed=2, settings=settings, path=path)
    replay = ControllerReplay(
        RigControl(),
        ran,
        with_changes(
            Configuration(), {"controller": {**ran.controller, "plate_delay": 0.0}}
        ).controller,
    )
    deviation = replay.deviation()
    assert deviation is not None
    assert (deviation.kind, deviation.name) == ("setting", "plate_delay")
    assert deviation.used == pytest.approx(0.004, rel=1e-3)


@pytest.mark.slow
def test_a_corrected_twin_tells_the_controller(tmp_path):
    late = rigtwin.run(
        "suspension-rig",
        "imposed",
        seed=4,
        settings={"timing": {"duration": 8.0}},
        effects={"delay@structure_cylinder": LATE},
        path=tmp_path / "late.mcap",
    )
    twin = tmp_path / "twin.toml"
    rigtwin.diagnose(late).save_twin(twin)
    configuration = with_changes(Configuration(), twin)
    assert configuration.plant.structure_cylinder.delay == pytest.approx(LATE, rel=0.05)
    assert configuration.controller.plate_delay == configuration.plant.structure_cylinder.delay
    # What the controller is told is of tests to come: the recording's own stays.
    assert rigtwin.compare(late, settings=twin)
    assert rigtwin.diagnose(late, settings=twin).verdict == "no gap"
    answer = rigtwin.diagnose_each([late.path], tmp_path / "each", settings=twin, workers=1)[0]
    assert answer.document is not None
    assert answer.document["verdict"] == "no gap"


@pytest.mark.parametrize("name", ["forward-prediction", "lag"])
@pytest.mark.parametrize("b1", [-1e7, 1e8])
def test_a_delay_that_no_number_takes_away_is_named(name, b1):
    settings = {"controller": {"plate_compensator": name, "plate_b1": b1}}
    with pytest.raises(RigtwinError, match="describe a cylinder that is late by .* s; .* takes"):
        rigtwin.run("suspension-rig", "drop", settings=settings)


def test_a_test_that_is_refused_leaves_the_recording_that_was_there(tmp_path):
    path = tmp_path / "kept.mcap"
    settings = {"timing": {"duration": 0.5}}
    rigtwin.run("suspension-rig", "drop", settings=settings, path=path)
    before = path.read_bytes()
    for kind in ("kalman-inverse", "forward-prediction"):
        unstable = {"plate_compensator": kind, "plate_a3": 0.0, "plate_b1": 1e8}
        wrong = {**settings, "controller": unstable}
        with pytest.raises(RigtwinError, match="plate_"):
            rigtwin.run("suspension-rig", "drop", settings=wrong, path=path)
        with pytest.raises(RigtwinError, match="plate_"):
            rigtwin.run_on_twin("drop", settings=wrong, path=path)
        with pytest.raises(RigtwinError, match="plate_"):
            rigtwin.faults(per_kind=1, per_process_kind=0, settings={"controller": unstable})
    assert path.read_bytes() == before


def test_a_cylinder_that_is_not_stable_is_named():
    with pytest.raises(RigtwinError, match="plate_a0 to plate_a3 describe a cylinder that is not"):
        rigtwin.run(
            "suspension-rig", "drop-compensated", settings={"controller": {"plate_a1": 0.0}}
        )


@pytest.mark.slow
def test_what_tripped_is_diagnosed_and_runs_with_the_compensator_of_the_corrected_twin(capsys):
    example = Path(__file__).parents[1] / "examples" / "late_cylinder.py"
    runpy.run_path(str(example))["main"]([])
    nominal, tripped, why, tested = capsys.readouterr().out.splitlines()
    assert "completed" in nominal
    assert "trip" in tripped
    assert why.startswith("The structure cylinder has a delay of ")
    assert " and " not in why
    assert "completed, 15.0 s" in tested
