"""Fits of named effects: values, intervals, doubts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.scoring import Scorer

HIDDEN = {"coulomb@elbow": 0.6, "viscous@elbow": 0.45}


@pytest.fixture(scope="module")
def recordings() -> tuple[rigtwin.Recording, rigtwin.Recording]:
    arm = rigtwin.machine("planar-arm")
    test = next(iter(rigtwin.experiments(arm)))
    first, second = (rigtwin.run(arm, test, seed=seed, effects=HIDDEN) for seed in (1, 2))
    return first, second


@pytest.fixture(scope="module")
def fitted(recordings) -> rigtwin.EffectFit:
    return rigtwin.fit(recordings[0], list(HIDDEN), held_out=recordings[1])


def test_the_intervals_hold_the_true_values(fitted):
    for name, true in HIDDEN.items():
        parameter = fitted[name]
        assert parameter.low <= true <= parameter.high
        assert parameter.high - parameter.low < 0.1 * true
        assert not parameter.low <= parameter.nominal <= parameter.high


def test_held_out_errors_shrink_as_those_of_the_fit(fitted):
    assert fitted.held_out_after[0] < 0.1 * fitted.held_out_before[0]
    assert fitted.error_after[0] < 0.1 * fitted.error_before[0]
    assert fitted.warnings == ()


def test_effects_with_linear_forces_need_one_start(recordings, fitted):
    counts: list[int] = []
    again = rigtwin.fit(recordings[0], list(HIDDEN), progress=counts.append)
    assert again.parameters == fitted.parameters
    # One coarse fit that leaves noise, and the final one.
    assert sum(counts) <= 3


def test_the_start_of_other_effects_is_searched_for(recordings):
    counts: list[int] = []
    fitted = rigtwin.fit(recordings[0], [*HIDDEN, "gain@torque_2"], progress=counts.append)
    assert sum(counts) > 3
    assert fitted["coulomb@elbow"].value == pytest.approx(HIDDEN["coulomb@elbow"], rel=0.05)


def test_the_corrected_machine_has_the_values(fitted):
    assert fitted.machine.plant.elbow.coulomb == fitted["coulomb@elbow"].value


def test_the_interval_of_one_value_shrinks_with_more_data(recordings, fitted):
    both = rigtwin.fit(list(recordings), list(HIDDEN))
    widths = [f["coulomb@elbow"].high - f["coulomb@elbow"].low for f in (fitted, both)]
    assert widths[1] == pytest.approx(widths[0] / np.sqrt(2.0), rel=0.2)


def test_an_effect_that_is_absent_is_said_to_be_doubtful(recordings):
    absent = rigtwin.fit(recordings[0], [*HIDDEN, "coulomb@shoulder"])
    assert any(line.startswith("coulomb@shoulder: the data allow") for line in absent.warnings)


def test_what_the_data_do_not_show_is_not_said_to_be_certain(recordings):
    # Where a payload of no mass is attached changes nothing.
    some = rigtwin.fit(recordings[0], [*HIDDEN, "payload@forearm"])
    np.testing.assert_allclose(np.diag(some.correlation), 1.0, atol=1e-9)
    wide = [p for p in some.parameters if "payload_" in p.name]
    assert wide
    assert all(p.high - p.low > 0.01 for p in wide)


def test_a_copy_is_no_held_out_recording(recordings):
    copy = replace(recordings[0], path=Path("copy.mcap"))
    with pytest.raises(rigtwin.RigtwinError, match="same data"):
        rigtwin.fit(recordings[0], ["coulomb@elbow"], held_out=copy)


def test_a_copy_counts_once(recordings):
    copy = replace(recordings[0], path=Path("copy.mcap"))
    once, twice = (rigtwin.fit(r, list(HIDDEN)) for r in (recordings[0], [recordings[0], copy]))
    assert twice.parameters == once.parameters
    assert "copy.mcap" in twice.warnings[0]


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        (["coulomb@elbw"], "did you mean 'coulomb@elbow'"),
        ([], "no effect to fit"),
        (["coulomb@elbow", "coulomb@elbow"], "changes a parameter that another effect"),
        (["backlash@elbow"], "lacks what it acts through"),
    ],
)
def test_effects_that_cannot_be_fitted_are_refused(recordings, effects, message):
    with pytest.raises(rigtwin.RigtwinError, match=message):
        rigtwin.fit(recordings[0], effects)


def test_the_command_prints_and_writes_the_values(recordings, tmp_path: Path, capsys):
    arm = rigtwin.machine("planar-arm")
    test = next(iter(rigtwin.experiments(arm)))
    path = tmp_path / "arm.mcap"
    rigtwin.run(arm, test, seed=1, effects=HIDDEN, path=path)
    out = tmp_path / "values.json"
    assert main(["fit", str(path), "-e", "coulomb@elbow", "--json", str(out)]) == 0
    assert "coulomb@elbow" in capsys.readouterr().out
    (parameter,) = json.loads(out.read_text())["parameters"]
    assert parameter["unit"] == "Nm"


def test_intervals_are_no_narrower_than_the_scatter_over_blocks_of_time():
    # A stiffness that is not fitted leaves a residual whose neighbouring samples are correlated.
    arm = rigtwin.machine("planar-arm")
    test = next(iter(rigtwin.experiments(arm)))
    recording = rigtwin.run(arm, test, seed=2, effects={**HIDDEN, "stiffness@elbow": 2.0})
    fitted = rigtwin.fit(recording, list(HIDDEN))
    fitter = Fitter(fitted.evidence)
    widths = Scorer(fitter).score(fitter.refine(fitted.effects, fitted.values)).widths
    deviations = np.sqrt(np.diag(fitted.covariance))
    # The values of both fits differ a little, and so do their responses.
    assert np.all(deviations >= 0.95 * np.concatenate(widths))
