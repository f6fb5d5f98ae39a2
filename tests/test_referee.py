"""The withheld-effect check: a referee independent of the twin, a committed key, correct scores."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from referee.check import Result
from referee.defect import MATERIAL, SENSORS, effect_size
from referee.draw import draw_tolerated, draw_unnamed, named_defects
from referee.referee import draw_case, operator, sorts, write
from referee.reference_rig import Law, run, run_quiet
from referee.reference_truth import Truth
from referee.score import misses, rows, table
from referee.score_row import wilson
from referee.test_signals import TESTS, draw_demands
from rigtwin.components import RigPlant, candidates
from rigtwin.diagnosis.controller import ControllerReplay
from rigtwin.recording import load
from tests.helpers.twin import RIG, evidence_of

KNOWN = {effect.name for effect in candidates(RigPlant())} | {"setting@controller"}


def test_the_referee_imports_nothing_of_the_twin():
    code = "import sys, referee.referee; print('\\n'.join(sys.modules))"
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded = finished.stdout.split()
    twin = ("rigtwin", "controllers", "experiments", "mujoco", "models")
    assert "referee.referee" in loaded
    assert not [name for name in loaded if name.partition(".")[0] in twin]


@pytest.mark.slow
def test_the_referees_rig_equals_the_nominal_twin_within_noise(tmp_path):
    for test in ("imposed", "road1.6"):
        law, demands = draw_demands(test, np.random.default_rng(4))
        path = tmp_path / f"{test}.mcap"
        write(path, law, *run(Truth(), law, demands[:4000], np.random.default_rng(4)))
        recording = load(path)
        evidence = evidence_of(recording)
        residual = evidence.residual(evidence.plant)
        assert 0.85 < float(residual @ residual) / evidence.expected < 1.1


@pytest.mark.slow
def test_the_referees_controller_follows_the_recorded_settings(tmp_path):
    law, demands = draw_demands("road10", np.random.default_rng(4))
    path = tmp_path / "road.mcap"
    write(path, law, *run(Truth(), law, demands[:3000], np.random.default_rng(4)))
    recording = load(path)
    assert RIG.control is not None
    settings = RIG.configuration_of(recording).controller
    assert ControllerReplay(RIG.control, recording, settings).deviation() is None


@pytest.mark.slow
def test_set_valued_and_bristle_friction_agree():
    law, demands = draw_demands("imposed", np.random.default_rng(2))
    commands, _ = run(Truth(), law, demands[:5000], np.random.default_rng(2))
    hard, bristle = run_quiet(Truth(), law, commands), run_quiet(Truth(bristle=1e9), law, commands)
    difference = np.sqrt(np.mean((hard - bristle) ** 2, axis=0))
    assert np.all(difference[:3] < 2e-5)
    assert difference[3] < 2.0


@pytest.mark.slow
def test_every_named_defect_is_in_the_library_and_changes_the_rig():
    random = np.random.default_rng(3)
    law, demands = draw_demands("imposed", random)
    commands, _ = run(Truth(), law, demands[:4000], random)
    for group in named_defects(commands, random):
        for make in group:
            defect = make()
            assert f"{defect.kind.partition(':')[0]}@{defect.component}" in KNOWN
            assert defect.change(Truth(), law) != (Truth(), law)


def test_defects_outside_the_library_have_no_name_in_it():
    kinds = set()
    for seed in range(5):
        for make in draw_unnamed(np.random.default_rng(seed)):
            defect = make()
            assert f"{defect.kind}@{defect.component}" not in KNOWN
            kinds.add(defect.kind)
    assert len(kinds) >= 5


def test_drawn_tolerances_stay_within_the_declared_ones():
    for seed in range(20):
        rig = draw_tolerated(np.random.default_rng(seed))
        assert abs(rig.mass / 34.0 - 1.0) <= 0.005
        assert abs(rig.tyre / 50_000.0 - 1.0) <= 0.01
        assert abs(rig.rail.coulomb / 50.0 - 1.0) <= 0.03
        assert all(abs(getattr(rig, name).gain - 1.0) <= 0.002 for name in SENSORS)


def test_sorts_have_their_shares():
    order = sorts(100, np.random.default_rng(1))
    assert [order.count(name) for name in ("single", "null", "pair", "outside")] == [45, 30, 10, 15]


@pytest.mark.parametrize(
    ("sort", "count"),
    [
        pytest.param("null", 0, marks=pytest.mark.slow),
        pytest.param("single", 1, marks=pytest.mark.slow),
        pytest.param("outside", 1, marks=pytest.mark.slow),
    ],
)
def test_a_case_has_the_effects_of_its_sort(sort, count):
    entry, recordings, *_ = draw_case(sort, np.random.default_rng(8))
    assert len(entry["effects"]) == count
    assert len(recordings) == 2
    assert entry["test"] in TESTS


@pytest.mark.slow
def test_the_size_of_a_defect_is_its_change_in_units_of_noise():
    law, demands = draw_demands("imposed", np.random.default_rng(2))
    commands, _ = run(Truth(), law, demands[:4000], np.random.default_rng(2))
    groups = named_defects(commands, np.random.default_rng(2))
    defect = next(
        d
        for group in groups
        for make in group
        for d in [make()]
        if (d.kind, d.component) == ("offset", "load_cell")
    )
    assert effect_size(Truth(), law, defect, commands) == pytest.approx(
        abs(defect.value) / Truth().load_cell.white, rel=0.01
    )
    assert MATERIAL == 1.0


@pytest.mark.slow
def test_the_key_is_committed_to_before_it_is_opened(tmp_path):
    command = [sys.executable, "-m", "referee.referee", str(tmp_path), "1", "3"]
    requests = "next 0 imposed-fast\nopen\n"
    finished = subprocess.run(command, input=requests, capture_output=True, text=True, check=True)
    lines = finished.stdout.splitlines()
    assert lines[0] == "case 0"
    commitment, salt = lines[1].partition(" ")[2], lines[3].partition(" ")[2]
    assert lines[2] == "recorded 0"
    assert hashlib.sha256((salt + lines[4]).encode()).hexdigest() == commitment
    assert len(json.loads(lines[4])) == 1
    names = {"000.mcap", "000-held-out.mcap", "000-next.mcap"}
    assert {path.name for path in tmp_path.iterdir()} == names
    text = (tmp_path / "000.mcap").read_bytes()
    for word in (b"seed", b"truth", b"effect"):
        assert word not in text


def test_recorded_settings_are_those_of_the_format():
    from controllers import Settings

    written = set(operator(Law()))
    # The controller has further settings after those of the format.
    assert written == set(Settings._fields[: len(written)])


def test_wilson_intervals_equal_published_values():
    # Newcombe 1998, table I: 81 of 263, and the limits at 0 and all.
    low, high = wilson(81, 263)
    assert (low, high) == (pytest.approx(0.2553, abs=1e-4), pytest.approx(0.3662, abs=1e-4))
    assert wilson(0, 20)[0] == pytest.approx(0.0, abs=1e-12)
    assert wilson(20, 20)[1] == pytest.approx(1.0)
    assert wilson(0, 0) == (0.0, 1.0)


def entry(sort: str, *effects: tuple[str, str, float, float]) -> dict:
    inside = sort != "outside"
    return {
        "sort": sort,
        "test": "imposed",
        "effects": [
            {
                "kind": k,
                "component": c,
                "value": v,
                "nominal": n,
                "inside": inside,
                "size": 9.0,
                "material": True,
            }
            for k, c, v, n in effects
        ],
    }


def said(verdict: str, *effects: tuple[str, str, float], where: str = "") -> dict:
    return {
        "verdict": verdict,
        "effects": [
            {
                "kind": k,
                "component": c,
                "parameters": {k: {"value": v}},
                "confidence": 0.95,
                "class": [],
                "share": 1.0,
            }
            for k, c, v in effects
        ],
        "where": [{"component": where}] if where else [],
        "gap": {"before": 2.0, "shrinkage_predicted": 0.9, "shrinkage_held_out": {"value": 0.8}},
        "seconds": 3.0,
    }


def test_every_measure_counts_the_right_cases():
    key = [
        entry("single", ("coulomb", "rail", 60.0, 50.0)),
        entry("single", ("viscous", "rail", 100.0, 0.0)),
        entry("null"),
        entry("null"),
        entry("outside", ("heating", "motor", 0.2, 0.0)),
        entry("pair", ("gain", "motor", 1.1, 1.0), ("mass", "carriage", 40.0, 34.0)),
    ]
    answers = [
        said("explained", ("coulomb", "rail", 61.0), where="rail"),
        said("explained", ("damping", "tyre", 90.0), where="tyre"),
        said("no gap"),
        said("explained", ("lag", "motor", 0.001), where="motor"),
        said("unknown", where="motor"),
        said("explained", ("gain", "motor", 1.1), ("mass", "carriage", 41.0), where="motor"),
    ]
    unsettled = said("explained", ("viscous", "rail", 99.0))
    unsettled["effects"][0]["class"] = [{"kind": "viscous", "component": "motor"}]
    settled = {0: said("explained", ("coulomb", "rail", 60.0)), 1: unsettled}
    result = Result(1, "x", key, answers, {}, settled)
    values = {row.measure: row.value for row in rows(result)}
    assert values["top-1 right, material single effects"].startswith("1 of 2")
    assert values["false alarms on nulls"].startswith("1 of 2")
    assert values["effect not in the library: flagged"].startswith("1 of 1")
    assert values["proposed next test: the right name alone, and sure"].startswith("1 of 2")
    assert values["both of two effects"].startswith("1 of 1")
    assert values["a wrong name among them"].startswith("0 of 1")
    assert values["magnitude error, median / 90th percentile"].startswith("10.0 %")
    assert values["predicted - achieved shrinkage, median / 90th percentile"].startswith("0.100")
    assert values["right when confidence >= 0.9"].startswith("3 of 5")
    assert len(misses(result)) == 2
    assert "viscous@rail" in table(result)
    worse = replace(result, answers=[said("no gap")] * 6)
    assert {row.measure: row.value for row in rows(worse)}[
        "top-1 right, material single effects"
    ].startswith("0 of 2")
