"""The energy that a hybrid test's loop puts in, held to closed forms and to the balance of all
energies."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from controllers import Mode, Settings, Travel
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.recording import RecordedTest
from rigtwin.simulation.energy import measure_energy
from rigtwin.simulation.loop import RigController

PERIOD, AMPLITUDE, SPEED = 0.001, 0.01, 2.0 * math.pi * 2.0
SETTINGS = Settings(preload=0.0, filter_force=0.0, sprung_mass=100.0)


def posed(wanted: np.ndarray, plate: np.ndarray, travel: np.ndarray, force: np.ndarray):
    """A test with these signals, without noise."""
    commands = {"structure": wanted, "ground": 0.0 * wanted, "force": force, "voltage": force}
    sensed = {"structure_lvdt": plate, "suspension_lvdt": travel, "load_cell": force}
    times = np.arange(len(wanted)) * PERIOD
    return RecordedTest(
        path=Path("posed"),
        machine="suspension-rig",
        experiment="",
        period=PERIOD,
        time=times,
        columns={"/command": commands, "/sensor": sensed},
        controller={"mode": "mil"},
    )


@pytest.mark.parametrize("delay", [0.002, 0.01, -0.005])
def test_a_late_plate_on_a_spring_puts_in_pi_k_a_squared_sine_of_the_delay(delay):
    """Per cycle; Horiuchi et al. (1999) have the same as negative damping."""
    stiffness, cycles = 4000.0, 10
    time = np.arange(round(cycles * 0.5 / PERIOD) + 1) * PERIOD
    plate = AMPLITUDE * np.sin(SPEED * (time - delay))
    force = -stiffness * plate
    # A travel of a spring and no damper that carries just that force: the suspension is perfect.
    settings = SETTINGS._replace(suspension_stiffness=stiffness, suspension_damping=0.0)
    recording = posed(AMPLITUDE * np.sin(SPEED * time), plate, plate, force)
    found = measure_energy(recording, Configuration()._replace(controller=settings))
    assert found is not None
    expected = cycles * math.pi * stiffness * AMPLITUDE**2 * math.sin(SPEED * delay)
    assert found.structure == pytest.approx(expected, rel=2e-3)
    assert abs(found.suspension) < 0.01 * abs(expected)
    assert math.isnan(found.share)


@pytest.mark.parametrize("lost", [0.0, 0.3, 1.0])
def test_a_damper_that_is_weaker_than_its_model_puts_in_its_share(lost):
    damping, cycles = 200.0, 10
    time = np.arange(round(cycles * 0.5 / PERIOD) + 1) * PERIOD
    travel = AMPLITUDE * np.sin(SPEED * time)
    force = -(1.0 - lost) * damping * AMPLITUDE * SPEED * np.cos(SPEED * time)
    settings = SETTINGS._replace(suspension_stiffness=0.0, suspension_damping=damping)
    found = measure_energy(
        posed(travel, travel, travel, force), Configuration()._replace(controller=settings)
    )
    assert found is not None
    damped = cycles * math.pi * damping * AMPLITUDE**2 * SPEED
    assert found.damped == pytest.approx(damped, rel=0.01)
    assert found.share == pytest.approx(lost, abs=0.02)
    assert abs(found.structure) < 1e-9


@pytest.mark.parametrize(
    "effects", [{}, {"delay@structure_cylinder": 0.006}, {"viscous@motor": 30.0}]
)
def test_all_energies_of_a_drop_balance(effects):
    """Of body, wheel, tyre and spring before and after; what damper and tyre take up; and what the
    loop puts in, which nothing else can make up for."""
    settings = {
        "rail": {"coulomb": 0.0},
        "motor": {"coulomb": 0.0},
        "timing": {"duration": 4.0},
    }
    rig = rigtwin.machine("suspension-rig")
    test = rigtwin.run(rig, "drop", effects=effects, settings=settings)
    configuration = rig.configuration_of(test)
    plant, told = configuration.plant, configuration.controller
    found = rigtwin.energy_error(test)
    assert found is not None
    ground, plate, travel = (test[f"/truth.{n}"] for n in ("ground", "structure", "suspension"))
    body, wheel = test["/command.structure"], plate - travel
    tyre = plant.tyre.stiffness * np.maximum(ground - wheel, 0.0)
    speed = np.gradient(wheel, test.period)
    stored = (
        0.5 * told.sprung_mass * np.gradient(body, test.period) ** 2
        + told.sprung_mass * told.gravity * body
        + 0.5 * plant.carriage.mass * speed**2
        + 0.5 * tyre**2 / plant.tyre.stiffness
        + 0.5 * told.suspension_stiffness * travel**2
        - told.preload * travel
    )
    in_tyre = plant.tyre.damping * np.sum(np.where(tyre > 0.0, speed**2, 0.0)) * test.period
    gained = stored[-2] - stored[1]
    passed = abs(found.total) + found.damped
    assert found.total == pytest.approx(gained + found.damped + in_tyre, abs=0.02 * passed)
    assert abs(found.total) > 0.05 * passed


def test_a_delay_of_the_plate_puts_energy_in():
    rig = rigtwin.machine("suspension-rig")
    settings = {"timing": {"duration": 4.0}}
    shares = [
        rigtwin.energy_error(
            rigtwin.run(rig, "drop", settings=settings, effects={"delay@structure_cylinder": late})
        ).share  # type: ignore[union-attr]
        for late in (0.0005, 0.003, 0.006)
    ]
    assert shares == sorted(shares)
    assert shares[-1] - shares[0] > 0.05


@pytest.mark.parametrize("change", [{"mode": Mode.IMPOSED}, {"travel": Travel.GROUND}])
def test_where_no_model_closes_the_loop_there_is_none(change):
    configuration = Configuration()
    told = configuration.controller._replace(**change)
    signal = np.zeros(100)
    recording = posed(signal, signal, signal, signal)
    assert measure_energy(recording, configuration._replace(controller=told)) is None


def test_where_nobody_said_what_the_controller_did_there_is_none():
    signal = np.zeros(100)
    recording = posed(signal, signal, signal, signal)
    assert measure_energy(recording, Configuration()) is not None
    assert measure_energy(replace(recording, controller={}), Configuration()) is None


@pytest.mark.parametrize("experiment", ["drop", "road10"])
def test_what_sensors_say_of_it_is_what_there_was(experiment):
    """Their noise, and the mains' line in force and motion alike, do not count as work."""
    rig = rigtwin.machine("suspension-rig")
    test = rigtwin.run(rig, experiment, settings={"timing": {"duration": 15.0}})
    blind = replace(test, columns={k: v for k, v in test.columns.items() if k != "/truth"})
    true, sensed = rigtwin.energy_error(test), rigtwin.energy_error(blind)
    assert true is not None
    assert sensed is not None
    for name in ("structure", "suspension", "damped"):
        told, there = getattr(sensed, name), getattr(true, name)
        assert told == pytest.approx(there, abs=0.03 * true.damped), name


@pytest.mark.slow
def test_a_diagnosis_of_a_hybrid_test_says_it(tmp_path):
    rig = rigtwin.machine("suspension-rig")
    test = rigtwin.run(
        rig, "drop", settings={"timing": {"duration": 6.0}}, path=tmp_path / "d.mcap"
    )
    answer = rigtwin.diagnose(test)
    expected = rigtwin.energy_error(test)
    assert expected is not None
    assert answer.document()["energy"]["d.mcap"]["structure"] == pytest.approx(expected.structure)
    assert f"energy error of d.mcap: {expected}" in str(answer)
    assert "Energy error of the hybrid test d.mcap" in answer._repr_html_()


@pytest.mark.slow
def test_of_a_compensated_test_with_its_settings():
    """The plate's commands are not where it should be then; the models' own motion is."""
    rig = rigtwin.machine("suspension-rig")
    times = dict.fromkeys(("filter_position", "filter_velocity", "filter_force"), 2e-3)
    settings = {"controller": times, "timing": {"duration": 6.0}}
    experiment = rigtwin.experiments(rig)["drop"]
    configuration = with_changes(experiment.configuration, settings)
    plain = rigtwin.run(rig, "drop", settings=settings)
    told = {**times, "plate_compensator": "kalman-inverse"}
    test = rigtwin.run(rig, "drop", settings={**settings, "controller": told})
    own = with_changes(configuration, {"controller": told})
    other = rigtwin.run(rig, "drop", settings=settings, controller=RigController(own))
    assert rigtwin.energy_error(other) is None
    before, after = rigtwin.energy_error(plain), rigtwin.energy_error(test)
    assert rigtwin.energy_error(other, settings=settings) == after
    assert before is not None
    assert after is not None
    assert abs(after.structure) < 0.2 * before.structure


def test_other_machines_have_none():
    assert rigtwin.energy_error(rigtwin.run("emps", "positioning")) is None
