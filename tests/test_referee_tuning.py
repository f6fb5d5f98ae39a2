"""Tuning on a diagnosis, evaluated on the referee's plant: that plant under the rig's controller,
and the check itself."""

from __future__ import annotations

import numpy as np
import pytest

from experiments import find
from machines import DEFAULT_MACHINE
from referee.reference_drive import drive
from referee.reference_rig import run
from referee.reference_truth import Truth
from referee.test_signals import draw_demands
from referee.tuning import TuningCase, check, draw_rig, text
from rigtwin.cli import main
from rigtwin.description.catalogue import find as find_machine
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.simulation.runner import simulate
from rigtwin.simulation.trip import Trip
from rigtwin.studies.sweep import Store
from rigtwin.studies.sweep.workers import SerialExecutor
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.evaluation import compare
from rigtwin.studies.tuning.run import LIMITS, TRIP, rig_trial
from rigtwin.studies.tuning.study_file import parse_study


@pytest.mark.slow
@pytest.mark.parametrize("test", ["imposed", "drop", "road1.6"])
def test_the_rigs_controller_commands_what_the_referees_does(test):
    """Both laws have one description; on one plant with the same noise they command the same."""
    truth = Truth(missed=0.02)
    law, demands = draw_demands(test, np.random.default_rng(3))
    demands = demands[:4000]
    commands, sensors = run(truth, law, demands, np.random.default_rng([9, 5]))
    mode = "imposed" if law.imposed else "mil"
    ran = drive(truth, override(Configuration(), {"controller": {"mode": mode}}), demands, 9)
    assert np.allclose(ran.commands, commands, rtol=0.0, atol=[1e-9, 1e-6, 1e-3, 1e-5])
    assert np.allclose(ran.measurements, sensors, rtol=0.0, atol=[1e-9, 1e-5, 1e-5, 0.2])


@pytest.mark.slow
def test_without_a_defect_the_force_error_equals_the_twins_to_5_percent():
    """Two plants, two codes: the force error of chapter 4's test."""
    experiment = find("friction-road")
    configuration = override(experiment.configuration, {"timing": {"duration": 8.0}})
    demands = experiment.demands(configuration, 2)

    def error(ran) -> float:
        tracking = rig_trial(configuration, ran.commands, ran.truth).tracking
        return tracking.force_e1 + tracking.force_e2

    assert error(drive(Truth(), configuration, demands, 2)) == pytest.approx(
        error(simulate(configuration, demands, 2)), rel=0.05
    )


@pytest.mark.slow
def test_a_limit_ends_a_test_on_the_referees_plant():
    configuration = override(Configuration(), {"safety": {"force": 150.0}})
    ran = drive(Truth(), configuration, np.zeros((100, 3)), 0)
    assert ran.trip == Trip.FORCE
    assert len(ran.commands) == 1


def test_the_seed_determines_the_rigs_and_their_friction():
    kinds = [draw_rig(1, number)[1].kind for number in range(8)]
    assert set(kinds) == {"coulomb", "viscous", "stribeck", "asymmetry"}
    assert draw_rig(1, 3)[0] == draw_rig(1, 3)[0]
    assert draw_rig(1, 3)[0] != draw_rig(2, 3)[0]
    assert all(draw_rig(5, number)[1].component == "motor" for number in range(8))


STUDY = {
    "experiment": "friction-road",
    "minimise": "force_error",
    "parameters": {"controller.friction_step": [2.0, 90.0]},
    "set": {"controller.compensator": "two-step", "timing.duration": 3.0},
    "search": {"timing.duration": 2.0, "timing.timestep": 1e-3},
    "baseline": {"controller.compensator": "none"},
    "roads": 1,
    "held_out": 6,
    "evaluations": 8,
}


@pytest.mark.slow
def test_the_check_tunes_on_what_was_diagnosed_and_judges_on_the_rig(tmp_path, monkeypatch):
    """What a diagnosis would say is taken as given: the rig has more friction than nominal."""
    import referee.tuning as module

    answer = ("more friction", "[motor]\ncoulomb = 28.0\n")
    monkeypatch.setattr(module, "diagnose_rig", lambda _: answer)
    said: list[TuningCase] = []
    with Store(tmp_path / "s.sqlite") as store:
        study = parse_study("s", STUDY, find_machine(DEFAULT_MACHINE))
        report = check(Bench(study, store, SerialExecutor()), 1, 4, show=said.append)
        made = len(store)
        again = check(Bench(study, store, SerialExecutor()), 1, 4)
        assert len(store) == made
    assert report == said == again
    (case,) = report
    assert case.sentence == "more friction"
    assert case.against_nominal.runs == 6
    both = (case.against_nominal, case.against_before)
    assert len({each.change_of("force_error").after for each in both}) == 1
    assert "1 of 1" in text(study, report) or "0 of 1" in text(study, report)


def test_what_is_better_is_counted_by_its_interval():
    study = parse_study("s", STUDY, find_machine(DEFAULT_MACHINE))

    def case(number: int, after: list[float], trips: float = 0.0) -> TuningCase:
        def rows(values: list[float]) -> list[dict[str, float]]:
            return [{"force_error": value, TRIP: trips, LIMITS: 0.5} for value in values]

        before, tuned = rows([10.0] * len(after)), rows(after)
        against = compare(study.goals.measures, "rig", ("before", before), ("tuned", tuned))
        return TuningCase(number, "coulomb@motor", "found", against, against)

    better, worse = [9.0 + 0.1 * n for n in range(8)], [11.0 + 0.1 * n for n in range(8)]
    mixed = [9.0, 11.0] * 4
    cases = [case(0, better), case(1, worse), case(2, mixed), case(3, mixed, trips=2.0)]
    printed = text(study, cases)
    assert "better for the diagnosis on 1 of 4, worse on 1, no difference" in printed
    assert "no difference to be told on 1, tripped on 1" in printed
    assert "tripped" in printed


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--tune", "nothing"], "unknown study"),
        (["--tune", "compensator", "--cases", "0"], "cases: expected 1 or more"),
        (["--workers", "0"], "expected 1 to 1024"),
    ],
)
def test_mistakes_are_one_line(arguments, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["blindcheck", *arguments]) == 1
    assert says in capsys.readouterr().err
