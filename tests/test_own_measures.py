"""Studies of a described machine, by measures of their own."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.description.catalogue import find
from rigtwin.recording import RecordedTest, load
from rigtwin.studies.tuning.measures import Trial
from rigtwin.studies.tuning.own_measures import STATISTICS, list_channels, parse_measure
from rigtwin.studies.tuning.study_file import parse_study

STUDY = """
machine = "emps"
experiment = "positioning"
from = 0.5
roads = 2
held_out = 6
evaluations = 12
minimise = "following"
report = ["largest"]
[measures.following]
formula = "reference - position"
unit = "m"
[measures.largest]
formula = "reference - position"
of = "peak"
unit = "m"
[set]
"timing.duration" = 2.0
"timing.timestep" = 1e-3
"guide.coulomb" = 20.0
[parameters]
"controller.kp" = [50.0, 400.0]
[vary]
tolerances = 1.0
"guide.coulomb" = 0.3
"""
TIME = np.arange(1000) * 1e-3
COLUMNS = {
    "/command": {"reference": np.sin(9.0 * TIME), "force": TIME**2, "pulse_voltage": 0.0 * TIME},
    "/sensor": {"position": np.sin(9.0 * TIME) - 0.1},
}


def figure(formula: str, **more: object) -> float:
    emps = find("emps")
    measure = parse_measure("m", {"formula": formula, **more}, list_channels(emps))
    return pickle.loads(pickle.dumps(measure)).compute(Trial(emps.configuration, COLUMNS, 500))


@pytest.mark.parametrize(
    ("formula", "of", "value"),
    [
        ("reference - encoder", "rms", 0.1),
        ("position - reference", "mean", -0.1),
        ("reference - position", "deviation", 0.0),
        ("force", "peak", TIME[-1] ** 2),
        ("derivative(force)", "mean", np.mean(2.0 * TIME[500:] - 1e-3)),
        ("0.5 * time + 0 * drive", "peak", 0.5 * TIME[-1]),
    ],
)
def test_a_measure_is_its_formula_over_what_counts(formula: str, of: str, value: float) -> None:
    assert figure(formula, of=of) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"formula": "speed"}, "measures.m.formula: unknown 'speed'; expected time, reference"),
        ({"formula": "1 + 2"}, "expected at least one channel"),
        ({"formula": "position +"}, "measures.m.formula: "),
        ({"of": "rms"}, "measures.m.formula = None: expected text"),
        ({"formula": "position", "of": "worst"}, "expected rms, deviation, mean, peak"),
        ({"formula": "position", "odd": 1}, "measures.m: unknown 'odd'"),
        ({"formula": "position", "more": 1}, "expected true or false"),
        ({"formula": "position", "unit": 3}, "measures.m.unit = 3: expected text"),
        (3, "expected a table"),
    ],
)
def test_a_measure_that_cannot_be_is_refused(table: object, said: str) -> None:
    with pytest.raises(rigtwin.RigtwinError) as refused:
        parse_measure("m", table, list_channels(find("emps")))
    assert said in str(refused.value)


def test_every_statistic_of_nothing_is_none() -> None:
    still = {"/sensor": {"position": np.zeros(10)}}
    channels = list_channels(find("emps"))
    for name in STATISTICS:
        measure = parse_measure("m", {"formula": "position", "of": name}, channels)
        assert measure.compute(Trial(find("emps").configuration, still)) == 0.0


def test_a_machine_without_settings_has_nothing_to_tune() -> None:
    tables = {"experiment": "pushes", "minimise": "x", "parameters": {}}
    with pytest.raises(rigtwin.RigtwinError, match="cart-pole has nothing to tune"):
        parse_study("s", tables, find("cart-pole"))


def test_a_rig_s_measures_are_not_another_machine_s() -> None:
    tables = {
        "experiment": "positioning",
        "minimise": "ride",
        "parameters": {"controller.kp": [1, 2]},
    }
    with pytest.raises(rigtwin.RigtwinError, match=r"unknown 'ride'; expected none; \[measures"):
        parse_study("s", tables, find("emps"))


SETTINGS = {"timing": {"duration": 2.0, "timestep": 1e-3}, "guide": {"coulomb": 20.0}}


def error(recording: RecordedTest) -> np.ndarray:
    off = recording.column("/command", "reference") - recording.column("/sensor", "position")
    return off[500:]


@pytest.mark.slow
def test_a_drive_is_tuned_and_its_settings_run(tmp_path: Path, capsys) -> None:
    study, folder = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(STUDY)
    assert main(["tune", str(study), "--out", str(folder), "--workers", "2"]) == 0
    output = capsys.readouterr().out
    line = next(line for line in output.splitlines() if line.startswith("rigtwin run positioning"))
    assert "--machine emps --config" in line
    before = rigtwin.run("emps", "positioning", settings=SETTINGS)
    tuned = rigtwin.run("emps", "positioning", settings=[SETTINGS, folder / "tuned.toml"])
    for recording in (load(folder / "best.mcap"), tuned):
        assert np.std(error(recording)) < 0.8 * np.std(error(before))


@pytest.mark.slow
def test_a_limit_bounds_what_a_study_tries(tmp_path: Path) -> None:
    folder = tmp_path
    for name in ("emps.toml", "emps.xml"):
        where = "machines" if name.endswith("toml") else "models/xml"
        text = (Path(rigtwin.__file__).parents[1] / where / name).read_text()
        (folder / name).write_text(text + ("\n[limits]\ndrive = 400.0\n" if "toml" in name else ""))
    study = folder / "study.toml"
    study.write_text(STUDY.replace('"emps"', '"emps.toml"'))
    result = rigtwin.tune(str(study), out=folder / "out", workers=1)
    assert 0.0 < result.main.limits < 0.9
    tight = STUDY.replace('"emps"', '"emps.toml"') + "[constraints]\nlimits = 0.05\n"
    study.write_text(tight)
    with pytest.raises(rigtwin.RigtwinError, match="limit"):
        rigtwin.tune(str(study), out=folder / "other", workers=1)
