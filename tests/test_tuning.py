"""Tuning: measures against closed forms, searches with known answers, studies from end to end."""

from __future__ import annotations

import csv
import math
import sqlite3
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from controllers import Settings
from experiments import find as experiment
from experiments.tuning import STUDIES, find_study
from machines import DEFAULT_MACHINE
from rigtwin.cli import main
from rigtwin.description.catalogue import find
from rigtwin.description.changes import override, with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.posterior import Alternative, Posterior, format_toml, load_posterior
from rigtwin.errors import RigtwinError
from rigtwin.recording import load
from rigtwin.simulation.experiment import Experiment
from rigtwin.studies.sweep import Store
from rigtwin.studies.sweep.workers import SerialExecutor
from rigtwin.studies.tuning.bench import Bench, Score, quantile
from rigtwin.studies.tuning.candidates import Candidate, TuningSearch, bound_of
from rigtwin.studies.tuning.evaluation import compare, median_interval
from rigtwin.studies.tuning.measures import MEASURES, Trial
from rigtwin.studies.tuning.parameter import TuningParameter, values_at
from rigtwin.studies.tuning.run import LIMITS, TRIP, Run, rig_trial, run
from rigtwin.studies.tuning.scenario import (
    APART,
    NOMINAL,
    Scenario,
    UncertainRig,
    calibrated_rig,
    draw_scenarios,
)
from rigtwin.studies.tuning.search import find_best, find_front
from rigtwin.studies.tuning.study import Constraint, Study
from rigtwin.studies.tuning.study_file import parse_study
from tests.helpers.browser import BROWSER, looked_at
from tests.helpers.tracking import tracking_of

SMALL = """
title = "a small study"
experiment = "active"
from = 1.0
roads = 2
held_out = 6
evaluations = 16
minimise = "ride"
report = ["heave", "road_holding"]

[set]
"timing.duration" = 2.5

[search]
"timing.timestep" = 5e-4

[parameters]
"controller.skyhook_damping" = [50.0, 1500.0]

[constraints]
limits = 0.9
"""
TABLES = {
    "experiment": "active",
    "minimise": "ride",
    "parameters": {"controller.skyhook_damping": [50.0, 1500.0]},
}
UNIT = {"between": [0, 1]}


def read(tables: dict[str, object]) -> Study:
    return parse_study("s", tables, find(DEFAULT_MACHINE))


def draw_frictions(study: Study, rig: UncertainRig, count: int) -> np.ndarray:
    """The motor's dry friction in scenarios, N."""
    return np.array([each.plant.motor.coulomb for each in draw_scenarios(study, rig, count, 0)])


def sine_test(amplitude: float, frequency: float, column: int) -> Trial:
    """Ten seconds in which one true signal alone swings (m, N or V about a mean)."""
    time = np.arange(10_000) * 1e-3
    commands, sensed = np.zeros((10_000, 4)), np.zeros((10_000, 4))
    # The tyre stays pressed: the wheel rests 4 mm below the ground plate.
    sensed[:, 2] = 0.004
    table = sensed if column < 4 else commands
    table[:, column % 4] += amplitude * np.sin(2 * np.pi * frequency * time)
    return rig_trial(Configuration(), commands, sensed)


def rig_run(
    test: Experiment,
    configuration: Configuration,
    seed: int,
    first: float,
    names: tuple[str, ...],
) -> Run:
    measures = tuple(MEASURES[name] for name in names)
    return Run(str(find(DEFAULT_MACHINE).path), test, configuration, seed, first, measures)


def figure(name: str, test: Trial) -> float:
    return MEASURES[name].compute(test)


def test_measures_of_sines():
    test = sine_test(0.002, 2.0, 1)
    ride, root = figure("ride", test), math.sqrt(2)
    assert ride == pytest.approx(0.002 * (4 * np.pi) ** 2 / root, rel=1e-3)
    assert figure("heave", test) < ride
    # The plate moves under a wheel whose travel does not change: so does the wheel.
    assert figure("road_holding", test) == pytest.approx(50_000 * 0.002 / root, rel=1e-3)
    travel, effort = sine_test(0.003, 1.0, 2), sine_test(1.5, 1.0, 7)
    assert figure("travel", travel) == pytest.approx(0.003 / root, rel=1e-6)
    assert figure("effort", effort) == pytest.approx(1.5 / root, rel=1e-6)
    fast, slow = (figure("heave", sine_test(0.001, f, 1)) for f in (12.0, 1.0))
    assert slow == pytest.approx(0.001 * (2 * np.pi) ** 2 / root, rel=0.03)
    # A second order there and back: 1/(1 + (12/3)⁴) of it is left.
    assert fast == pytest.approx(0.001 * (24 * np.pi) ** 2 / root / (1 + 4**4), rel=0.05)


def test_a_tyre_that_lifts_does_not_pull():
    test = sine_test(0.010, 1.0, 0)
    tyre = test.tyre
    assert tyre.min() == 0.0
    assert tyre.max() == pytest.approx(50_000 * 0.014, rel=1e-3)


def test_only_what_comes_after_the_start_counts():
    test = sine_test(0.002, 2.0, 1)
    test.sensed[:1000, 1] += np.linspace(0.5, 0.0, 1000)
    late = replace(test, first=2000)
    expected = 0.002 * (4 * np.pi) ** 2 / math.sqrt(2)
    assert figure("ride", late) == pytest.approx(expected, rel=1e-3)


KINDS_OF_TEST = ("drop", "semi-active", "friction-road", "imposed")


@pytest.mark.parametrize("name", KINDS_OF_TEST)
def test_every_measure_is_a_number_for_every_kind_of_test(name):
    short = {"timing": {"duration": 2.0, "timestep": 1e-3}}
    configuration = override(experiment(name).configuration, short)
    figures = run(rig_run(experiment(name), configuration, 0, 0.5, tuple(MEASURES)))
    assert set(figures) == {*MEASURES, LIMITS, TRIP}
    assert all(map(math.isfinite, figures.values()))
    assert 0.0 < figures[LIMITS] < 1.0


def test_a_run_that_trips_has_no_measures():
    tight = {"timing": {"duration": 1.0}, "safety": {"force": 150.0}}
    configuration = override(Configuration(), tight)
    figures = run(rig_run(experiment("drop"), configuration, 0, 0.0, ("ride",)))
    assert figures[TRIP] != 0.0
    assert math.isnan(figures["ride"])
    assert figures[LIMITS] > 1.0


def test_errors_are_those_of_the_thesis_tables():
    from rigtwin.simulation.runner import record

    configuration = override(Configuration(), {"timing": {"duration": 3.0}})
    figures = run(rig_run(experiment("drop"), configuration, 4, 0.0, tuple(MEASURES)))
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.mcap"
        record(path, "drop", configuration, experiment("drop").demands(configuration, 4), 4)
        expected = tracking_of(load(path), configuration)
    assert figures["tracking"] == pytest.approx(expected.force_e2, rel=1e-12)
    force = expected.force_e1 + expected.force_e2
    position = expected.position_e1 + expected.position_e2
    assert figures["force_error"] == pytest.approx(force, rel=1e-12)
    assert figures["position_error"] == pytest.approx(position, rel=1e-12)


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_parameter_goes_there_and_back(logarithmic):
    parameter = TuningParameter("controller.ki", 2.0, 300.0, logarithmic, "1/s")
    assert parameter.value(0.0) == 2.0
    assert parameter.value(1.0) == 300.0
    for share in np.linspace(0, 1, 11):
        value = parameter.value(share)
        assert 2.0 <= value <= 300.0
        assert parameter.share(value) == pytest.approx(share, abs=1e-3)
        assert float(f"{value:.3e}") == value
    assert parameter.share(1e6) == 1.0
    assert parameter.share(0.0) == 0.0
    middle = math.sqrt(600.0) if logarithmic else 151.0
    assert parameter.value(0.5) == pytest.approx(middle, rel=1e-3)


def test_every_study_that_comes_along_can_be_read(tmp_path):
    assert {"skyhook", "friction", "two-step", "compensator"} <= set(STUDIES)
    for name in STUDIES:
        study = find_study(name)
        assert study.parameters
        assert study.title != name
        for parameter in study.parameters:
            value = getattr(study.baseline_settings, parameter.name)
            assert parameter.low <= value <= parameter.high, parameter.key
        bench = Bench(study, Store(tmp_path / f"{name}.sqlite"), SerialExecutor())
        short = override(study.search_configuration, {"timing": {"duration": 1.0}})
        scenario = Scenario(0, short.plant)
        assert run(replace(bench.plan(short, study.baseline_settings, scenario), first=0.0))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"nothing": 1}, "unknown 'nothing'"),
        ({"experiment": "moon"}, "unknown experiment"),
        ({"minimise": "beauty"}, "unknown 'beauty'; expected ride"),
        ({"minimise": ["ride", "heave", "travel"]}, "one objective, or two"),
        ({"minimise": 3}, "expected names of"),
        ({"parameters": {}}, "expected settings with bounds"),
        ({"parameters": {"rail.coulomb": [1, 2]}}, "only the controller is tuned"),
        ({"parameters": {"controller.nothing": [1, 2]}}, "a setting that is a number"),
        ({"parameters": {"controller.skyhook": [1, 2]}}, "a setting that is a number"),
        ({"parameters": {"controller.kp": [2, 1]}}, "low below high"),
        ({"parameters": {"controller.kp": [0, 1e9]}}, "expected a number from 0 to 20"),
        ({"parameters": {"controller.kp": [0, math.nan]}}, "expected a number from 0 to 20"),
        ({"parameters": {"controller.kp": 3}}, "expected its bounds"),
        ({"parameters": {"controller.kp": {**UNIT, "scale": "logarithmic"}}}, "above 0 if logar"),
        ({"parameters": {"controller.kp": {**UNIT, "scale": "odd"}}}, "expected between"),
        ({"constraints": {"beauty": 1}}, "unknown 'beauty'"),
        ({"constraints": {"travel": "low"}}, 'expected a number, "baseline"'),
        ({"constraints": {"travel": "-1 baseline"}}, 'expected a number, "baseline"'),
        ({"constraints": {"limits": 2}}, "expected a number from 0.01 to 1"),
        ({"vary": {"controller.kp": 0.3}}, "component.parameter of the machine"),
        ({"vary": {"motor.coulomb": 3}}, "expected a number from 0 to 1"),
        ({"judge": {"odd": {"controller.kp": 0.3}}}, "changes of the machine alone"),
        ({"set": {"controller.kp": "x"}}, "controller.kp = x"),
        ({"set": 3}, "expected a table of settings"),
        ({"search": {"controller.kp": 0.2}}, "expected timing, safety or road"),
        ({"search": {"timing.timestep": 3e-4}}, "whole multiple"),
        ({"baseline": {"rail.coulomb": 0.2}}, "settings of the controller alone"),
        ({"from": 44.5}, "at least a second before the test's end"),
        ({"roads": 0}, "expected a whole number from 1"),
        ({"held_out": 5}, "expected a whole number from 6"),
        ({"roads": True}, "expected a whole number"),
        ({"quantile": 1.5}, "expected a number from 0 to 1"),
        ({"title": "two\nlines"}, "expected text of one line"),
        ({"judge": {"a\nb": {"motor.coulomb": 1}}}, "expected text of one line"),
        ({"set": {"duration": 2.0}}, "set: duration = 2.0: expected group.name"),
        ({"judge": {"odd": 3}}, "judge: odd = 3: expected a table"),
        ({"vary": {"rail.viscous": 0.5}}, "it is 0 in this machine"),
        ({"minimise": ["ride", "ride"]}, "one objective, or two different ones"),
    ],
)
def test_mistakes_in_a_study_are_one_line(changes, says):
    with pytest.raises(RigtwinError, match=says):
        read({**TABLES, **changes})


@pytest.mark.parametrize("key", ["experiment", "minimise", "parameters"])
def test_what_is_missing_in_a_study_is_said(key):
    with pytest.raises(RigtwinError, match=f"{key} is missing"):
        read({name: value for name, value in TABLES.items() if name != key})


def test_scenarios_are_the_same_for_everybody():
    study = read({**TABLES, "vary": {"tolerances": 1.0, "motor.coulomb": 0.3}})
    few, more = draw_scenarios(study, NOMINAL, 3, 0), draw_scenarios(study, NOMINAL, 6, 0)
    assert few == more[:3]
    assert [each.seed for each in draw_scenarios(study, NOMINAL, 2, APART)] == [APART, APART + 1]
    frictions = draw_frictions(study, NOMINAL, 200)
    assert frictions.min() > 14.0 * 0.7 * 0.97
    assert frictions.max() < 14.0 * 1.3 * 1.03
    assert np.std(frictions) == pytest.approx(14.0 * 0.6 / math.sqrt(12), rel=0.15)
    masses = np.array([each.plant.carriage.mass for each in draw_scenarios(study, NOMINAL, 200, 0)])
    assert np.all(np.abs(masses / 34.0 - 1.0) <= 0.005)
    assert min(each.plant.motor.delay for each in more) >= 0.0
    plain = read(TABLES)
    plants = {each.plant for each in draw_scenarios(plain, NOMINAL, 5, 0)}
    assert plants == {plain.configuration.plant}


POSTERIOR = Posterior(
    {"motor": {"coulomb": 24.0}},
    {"motor.coulomb": (22.0, 26.0)},
    0.9,
    (Alternative("viscous@motor", 0.05, {"motor": {"viscous": 40.0}}),),
)


def write_twin(path: Path) -> Path:
    path.write_text("\n".join(["[motor]", "coulomb = 24.0", "", *format_toml(POSTERIOR)]) + "\n")
    return path


def test_a_posterior_is_read_as_it_was_written(tmp_path):
    assert load_posterior(write_twin(tmp_path / "c.toml")) == POSTERIOR
    # run and compare take the same file.
    assert with_changes(Configuration(), tmp_path / "c.toml").plant.motor.coulomb == 24.0
    (tmp_path / "plain.toml").write_text("[rail]\ncoulomb = 60\n")
    plain = load_posterior(tmp_path / "plain.toml")
    assert plain.intervals == {}
    assert plain.at_best(Configuration()).plant.rail.coulomb == 60.0


def test_a_rig_is_drawn_as_uncertain_as_it_is():
    study = read(TABLES)
    frictions = draw_frictions(study, calibrated_rig(POSTERIOR), 400)
    assert np.mean(frictions) == pytest.approx(24.0, abs=0.2)
    assert np.std(frictions) == pytest.approx(4.0 / 3.92, rel=0.12)
    wide = replace(POSTERIOR, intervals={"motor.coulomb": (-200.0, 200.0)})
    assert draw_frictions(study, calibrated_rig(wide), 50).min() == 0.0


def test_an_interval_may_be_wider_on_one_side():
    study = read(TABLES)
    lopsided = replace(POSTERIOR, intervals={"motor.coulomb": (23.0, 30.0)})
    frictions = draw_frictions(study, calibrated_rig(lopsided), 600)
    assert np.median(frictions) == pytest.approx(24.0, abs=0.25)
    assert np.mean(frictions < 23.0) == pytest.approx(0.025, abs=0.015)
    assert np.mean(frictions > 30.0) == pytest.approx(0.025, abs=0.015)


def test_what_was_diagnosed_is_not_varied_again():
    study = read({**TABLES, "vary": {"tolerances": 1.0, "motor.coulomb": 0.3}})
    certain = replace(POSTERIOR, intervals={"motor.coulomb": (23.99, 24.01)})
    rigs = draw_scenarios(study, calibrated_rig(certain), 20, 0)
    assert max(abs(each.plant.motor.coulomb - 24.0) for each in rigs) < 0.05
    assert len({each.plant.rail.coulomb for each in rigs}) == 20


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("posterior = 3", "expected a table"),
        ("[posterior]\nodd = 1", "unknown posterior.odd"),
        ("[posterior]\nprobability = 2", "expected 0 to 1"),
        ('[posterior.intervals]\n"moon.mass" = [1, 2]', "unknown parameter 'moon.mass'"),
        ('[posterior.intervals]\n"motor.coulomb" = [2, 1]', r"expected \[low, high\]"),
        ('[posterior.intervals]\n"motor.coulomb" = [1, nan]', r"expected \[low, high\]"),
        ("[posterior]\notherwise = 3", "expected tables"),
        ("[[posterior.otherwise]]\nprobability = 0.1", "expected effect"),
        ("[moon]\nmass = 1", "unknown group 'moon'"),
        ("[posterior]\nintervals = 3", "expected a table of component.parameter"),
        ('[posterior]\nintervals = "abc"', "expected a table of component.parameter"),
        ('[posterior.intervals]\n"motor.count" = [1, 2]', "unknown parameter 'motor.count'"),
        ('[posterior.intervals]\n"motor.coulomb" = [-inf, inf]', r"\] about its value, 14"),
        ('[posterior.intervals]\n"motor.coulomb" = [100, 200]', r"\] about its value, 14"),
        ('[posterior.intervals]\n"motor.coulomb" = [1, 2, 3]', r"expected \[low, high\]"),
        ("[timing]\nduration = 3", "a machine is described by"),
        (
            '[[posterior.otherwise]]\neffect = "kp"\nchanges.controller.kp = 3',
            "a machine is described",
        ),
        ('[[posterior.otherwise]]\neffect = "a\\nb"', "a name of one line"),
    ],
)
def test_mistakes_in_a_calibrated_twin_are_one_line(text, says, tmp_path):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(RigtwinError, match=says):
        load_posterior(tmp_path / "c.toml")


@dataclass(frozen=True)
class Known(Bench):
    """A bench that knows: ride is least at 700 Ns/m and kp 1.3; road holding at 300 Ns/m."""

    def score(self, candidates, scenarios) -> list[Score]:
        tried = []
        for candidate in candidates:
            ride = (
                1.0 + ((candidate.skyhook_damping - 700.0) / 500.0) ** 2 + (candidate.kp - 1.3) ** 2
            )
            holding = (
                2.0 + ((candidate.skyhook_damping - 300.0) / 500.0) ** 2 + (candidate.kp - 1.3) ** 2
            )
            trips = 0.0 if candidate.kp < 1.8 else 0.5
            figures = {"ride": ride, "road_holding": holding}
            tried.append(Score(dict.fromkeys(figures, math.nan) if trips else figures, 0.5, trips))
            self.progress(1)
        return tried


def make_search(tmp_path: Path, tables: dict[str, object], progress=lambda _: None) -> TuningSearch:
    parameters = {"controller.skyhook_damping": [50.0, 1500.0], "controller.kp": [0.1, 2.0]}
    study = read({**TABLES, "parameters": parameters, "evaluations": 400, **tables})
    return TuningSearch(
        Known(study, Store(tmp_path / "s.sqlite"), SerialExecutor(), progress), [], 1
    )


def test_the_best_is_found(tmp_path):
    best = find_best(make_search(tmp_path, {}))
    assert best.values == pytest.approx((700.0, 1.3), rel=0.05)
    assert best.score.figures["ride"] == pytest.approx(1.0, abs=0.01)


def test_the_best_within_a_constraint_is_found(tmp_path):
    """On the circle about (300, 1.3) of radius 0.4 in shares of 500: 500 Ns/m."""
    best = find_best(make_search(tmp_path, {"constraints": {"road_holding": 2.16}}))
    assert best.allowed
    assert best.values == pytest.approx((500.0, 1.3), rel=0.05)
    assert best.score.figures["ride"] == pytest.approx(1.16, abs=0.01)


def test_what_trips_is_never_chosen(tmp_path):
    parameters = {"controller.skyhook_damping": [600, 800], "controller.kp": [1.5, 2.0]}
    search = make_search(tmp_path, {"parameters": parameters})
    best = find_best(search)
    assert best.values[1] < 1.8
    assert any(each.score.trips for each in search.candidates.values())


def test_a_bound_may_be_the_baselines(tmp_path):
    search = make_search(tmp_path, {"constraints": {"road_holding": "0.9 baseline"}})
    figure = search.baseline.figures["road_holding"]
    assert search.bounds == [pytest.approx(0.9 * figure)]
    assert find_best(search).score.figures["road_holding"] <= 0.9 * figure


def test_there_is_no_share_of_a_baseline_below_zero():
    score = Score({"stability_margin": -0.23}, 0.5, 0.0)
    margin = MEASURES["stability_margin"]
    with pytest.raises(RigtwinError, match="of which there is no share"):
        bound_of(Constraint(margin, math.nan, 0.9), score)
    assert bound_of(Constraint(margin, math.nan, 1.0), score) == -0.23


def test_what_cannot_be_met_together_is_said(tmp_path):
    with pytest.raises(RigtwinError, match=r"the nearest fails at (ride|road_holding)"):
        find_best(make_search(tmp_path, {"constraints": {"road_holding": 2.05, "ride": 1.05}}))


def test_parameters_that_do_nothing_are_said(tmp_path):
    @dataclass(frozen=True)
    class Deaf(Known):
        def score(self, candidates, scenarios) -> list[Score]:
            return [Score({"ride": 1.0}, 0.5, 0.0) for _ in candidates]

    study = read({**TABLES, "evaluations": 10})
    with pytest.raises(RigtwinError, match="skyhook_damping make no difference in active"):
        find_best(TuningSearch(Deaf(study, Store(tmp_path / "s.sqlite"), SerialExecutor()), [], 1))


def test_what_is_not_a_number_is_not_allowed(tmp_path):
    @dataclass(frozen=True)
    class Lost(Known):
        def score(self, candidates, scenarios) -> list[Score]:
            return [Score({"ride": math.nan}, 0.5, 0.0) for _ in candidates]

    study = read({**TABLES, "evaluations": 10})
    with pytest.raises(RigtwinError, match="the nearest fails at trips"):
        find_best(TuningSearch(Lost(study, Store(tmp_path / "s.sqlite"), SerialExecutor()), [], 1))


@pytest.mark.parametrize("evaluations", [5, 20, 100])
def test_a_search_tries_about_as_many_as_it_may(evaluations, tmp_path):
    search = make_search(tmp_path, {"evaluations": evaluations})
    find_best(search)
    assert len(search.candidates) <= 1.5 * evaluations
    tables = {"evaluations": 60, "minimise": ["ride", "road_holding"], "points": 4}
    both = make_search(tmp_path / "both", tables)
    find_front(both)
    assert len(both.candidates) <= 90


def test_nothing_allowed_is_said(tmp_path):
    said = "none of .* candidates meets every constraint; the nearest fails at road_holding"
    with pytest.raises(RigtwinError, match=said):
        find_best(make_search(tmp_path, {"constraints": {"road_holding": 1.5}}))


def test_a_front_is_the_line_between_both_best(tmp_path):
    tables = {"minimise": ["ride", "road_holding"], "points": 6, "evaluations": 600}
    search = make_search(tmp_path, tables)
    front = find_front(search)
    assert len(front) > 6
    for point, next_one in pairwise(front):
        assert point.score.figures["ride"] <= next_one.score.figures["ride"]
        assert point.score.figures["road_holding"] > next_one.score.figures["road_holding"]
    # Between 300 and 700 Ns/m at kp 1.3, √(ride − 1) + √(holding − 2) = 0.8 on the true front.
    for point in front:
        ride, holding = point.score.figures["ride"], point.score.figures["road_holding"]
        short = math.sqrt(ride - 1.0) + math.sqrt(holding - 2.0)
        assert 0.8 - 1e-9 <= short < 1.0
    damping = [point.values[0] for point in front]
    assert max(damping) > 650.0
    assert min(damping) < 350.0


def test_a_search_goes_the_same_way_again(tmp_path):
    first, again = (list(_all(make_search(tmp_path / name, {}))) for name in ("a", "b"))
    assert first == again


def _all(search: TuningSearch) -> dict[tuple[float, ...], Candidate]:
    find_best(search)
    return search.candidates


def test_a_quantile_is_on_the_worse_side():
    numbers = list(range(11))
    assert quantile(MEASURES["ride"], numbers, 0.8) == 8.0
    assert quantile(MEASURES["stability_margin"], numbers, 0.8) == pytest.approx(2.0)
    assert math.isnan(quantile(MEASURES["ride"], [1.0, math.nan], 0.5))


@pytest.mark.parametrize("count", [1, 2, 5])
def test_too_few_have_no_interval(count):
    assert all(map(math.isnan, median_interval(np.arange(float(count)))))


@pytest.mark.parametrize("count", [6, 16, 32])
def test_the_interval_of_a_median_holds_it_as_often_as_it_says(count):
    random = np.random.default_rng(count)
    inside = 0
    for _ in range(2000):
        low, high = median_interval(random.exponential(1.0, count))
        inside += low <= math.log(2.0) <= high
    assert inside / 2000 > 0.94


def test_a_comparison_is_paired_and_leaves_trips_out():
    measures = (MEASURES["ride"], MEASURES["stability_margin"])

    def rows(*runs: tuple[float, float, float]) -> list[dict[str, float]]:
        return [{"ride": r, "stability_margin": m, TRIP: t, LIMITS: 0.4} for r, m, t in runs]

    before = rows((1.0, 1.0, 0), (2.0, 1.0, 0), (4.0, 1.0, 0), (math.nan, 1.0, 1))
    after = rows((0.5, 1.5, 0), (1.0, 0.5, 0), (3.0, 2.0, 0), (1.0, 1.0, 0))
    comparison = compare(measures, "rig", ("before", before), ("tuned", after))
    assert comparison.runs == 3
    assert comparison.trips == (0.25, 0.0)
    ride, margin = comparison.change_of("ride"), comparison.change_of("stability_margin")
    assert ride.median == pytest.approx(-50.0)
    assert ride.better == 1.0
    assert margin.median == pytest.approx(0.5)
    assert margin.better == pytest.approx(2 / 3)
    assert not margin.relative


def test_a_change_of_nothing_is_in_its_unit():
    def rows(values: list[float]) -> list[dict[str, float]]:
        return [{"travel": value, TRIP: 0.0, LIMITS: 0.1} for value in values]

    before, after = rows([0.0] * 6), rows([0.1] * 6)
    change = compare((MEASURES["travel"],), "rig", ("before", before), ("tuned", after)).change_of(
        "travel"
    )
    assert not change.relative
    assert change.median == pytest.approx(0.1)


def small(folder: Path, text: str = SMALL) -> Path:
    path = folder / "small.toml"
    path.write_text(text)
    return path


COMPARED = ("tuned.toml", "candidates.csv", "held-out.csv", "index.html", "best.mcap")


def tune(folder: Path, *options: str, text: str = SMALL) -> int:
    """The exit code of tuning a small study in one process, into the folder's `out`."""
    out = ["--out", str(folder / "out"), "--workers", "1"]
    return main(["tune", str(small(folder, text)), *out, *options])


@pytest.mark.slow
def test_a_study_from_end_to_end(tmp_path, capsys):
    path, out = small(tmp_path), tmp_path / "out"
    assert main(["tune", str(path), "--out", str(out), "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "a small study" in printed
    assert "6 held-out scenarios" in printed
    names = {*COMPARED, "search.png"}
    assert names <= {each.name for each in out.iterdir()}
    # What was chosen is the best of those allowed, and better than what was begun with.
    with (out / "candidates.csv").open() as file:
        tried = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    tuned = with_changes(experiment("active").configuration, out / "tuned.toml")
    chosen = tuned.controller.skyhook_damping
    least = min((row for row in tried if row["allowed"]), key=lambda row: row["ride"])
    assert chosen == least["controller.skyhook_damping"]
    assert chosen > 500.0
    recording = load(out / "best.mcap")
    assert recording.end == "completed"
    assert recording.controller["skyhook_damping"] == chosen
    page = (out / "index.html").read_text()
    assert not any(word in page for word in ("<script", 'src="', 'href="http', "@import"))
    short = ["--set", "timing.duration=0.2", "-o", str(tmp_path / "r.mcap")]
    assert main(["run", "active", "--config", str(out / "tuned.toml"), *short]) == 0

    if BROWSER is not None:
        for width in (1280, 390):
            assert looked_at(page, width, tmp_path)["wide"] <= width

    # From what is kept: no run more.
    before = runs(out)
    assert main(["tune", str(path), "--out", str(out), "--workers", "1"]) == 0
    assert runs(out) == before
    # Two workers give the same bytes.
    second = tmp_path / "second"
    assert main(["tune", str(path), "--out", str(second), "--workers", "2"]) == 0
    for name in COMPARED:
        assert (out / name).read_bytes() == (second / name).read_bytes(), name


def runs(folder: Path) -> int:
    with closing(sqlite3.connect(folder / "runs.sqlite")) as base:
        return base.execute("SELECT COUNT(*) FROM results").fetchone()[0]


@pytest.mark.slow
def test_a_study_of_a_calibrated_twin_says_what_it_is_worth(tmp_path, capsys):
    text = SMALL.replace('"ride"', '["ride", "road_holding"]')
    text = text.replace('report = ["heave", "road_holding"]', "points = 3")
    twin = write_twin(tmp_path / "c.toml")
    assert tune(tmp_path, "--twin", str(twin), "--evaluations", "8", text=text) in (0, 4)
    printed = capsys.readouterr().out
    assert "tuned against tuned on the nominal twin, calibrated twin" in printed
    assert "if the diagnosis were wrong and the rig nominal: rms body acceleration" in printed
    assert "twin with viscous@motor instead" in printed
    assert "point 1 against before" in printed
    assert {"front.png", "tuned-1.toml"} <= {each.name for each in (tmp_path / "out").iterdir()}


@pytest.mark.slow
def test_settings_that_should_not_be_used_are_said_and_end_with_another_code(tmp_path, capsys):
    """The bounds leave nothing but what is worse than before; a judged rig breaks its limit."""
    text = SMALL.replace("[50.0, 1500.0]", "[1.0, 20.0]")
    text = text.replace("limits = 0.9", "limits = 0.9\nroad_holding = 100.0")
    text += '\n[judge."$x_{$ no tyre to speak of"]\n"tyre.stiffness" = 500000.0\n'
    assert tune(tmp_path, "--evaluations", "8", text=text) == 4
    printed = capsys.readouterr().out
    assert "but no objective is certainly better than before" in printed
    assert "controller.skyhook_damping is 200 before, outside the bounds 1 to 20" in printed
    assert "# but no objective is certainly better" in (tmp_path / "out" / "tuned.toml").read_text()
    assert "But no objective is certainly better" in (tmp_path / "out" / "index.html").read_text()


@pytest.mark.slow
def test_a_test_without_a_road_is_said_to_be_always_the_same(tmp_path, capsys):
    text = SMALL.replace('"active"', '"drop"').replace("1500.0", "90.0")
    text = text.replace("skyhook_damping", "suspension_damping")
    tune(tmp_path, "--evaluations", "5", text=text)
    assert "drop is the same test whatever its seed" in capsys.readouterr().out


def test_settings_given_at_once_are_checked_with_the_study(tmp_path, capsys):
    assert tune(tmp_path, "--set", "timing.duration=1.5") == 1
    said = capsys.readouterr().err
    assert "from = 1 s: expected at least a second before the test's end at 1.5 s" in said


def test_a_study_that_is_interrupted_keeps_its_runs(tmp_path, monkeypatch):
    import rigtwin.studies.tuning.bench as module

    made = 0

    def impatient(asked: Run) -> dict[str, float]:
        nonlocal made
        made += 1
        if made > 5:
            raise KeyboardInterrupt
        return run(asked)

    monkeypatch.setattr(module, "run", impatient)
    assert tune(tmp_path) == 130
    assert runs(tmp_path / "out") == 5


def test_the_studies_are_listed(capsys):
    assert main(["tune"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in STUDIES)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing"], "unknown study 'nothing'; there are compensator"),
        (["absent.toml"], "cannot read absent.toml"),
        (["skyhook", "--roads", "0"], "roads = 0: expected a whole number from 1"),
        (["skyhook", "--seed", "-1"], "expected 0 or more"),
        (["skyhook", "--workers", "0"], "expected 1 to 1024"),
        (["skyhook", "--twin", "absent.toml"], "cannot read absent.toml"),
        (["skyhook", "--set", "moon.mass=1"], "unknown group 'moon'"),
    ],
)
def test_mistakes_on_the_command_line_are_one_line(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["tune", *arguments]) == 1
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1


def test_settings_are_compared_with_those_of_the_study():
    study = read({**TABLES, "baseline": {"controller.skyhook": "none"}})
    settings = study.configuration.controller
    assert study.baseline_settings == settings._replace(skyhook=Settings().skyhook)
    assert values_at(study.parameters, np.array([0.5])) == (775.0,)


@pytest.mark.parametrize(
    ("assignments", "numbers", "said"),
    [
        ((), {"evaluations": 0}, r"^evaluations = 0: expected"),
        (("controller.kp=x",), {}, r"^controller.kp = x: expected"),
        (("controller.nonsense=1",), {}, r"^unknown setting controller.nonsense"),
    ],
)
def test_what_was_said_beside_a_study_is_not_blamed_on_its_file(assignments, numbers, said):
    with pytest.raises(RigtwinError, match=said):
        find_study("skyhook", assignments, **numbers)
