"""What several recordings say together: one value for all, or what changed, and with what."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.diagnosis.homogeneity import check_homogeneity, correct, fit_trends, name_trends
from tests.helpers.described import NOISY, described


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> rigtwin.Machine:
    folder = tmp_path_factory.mktemp("slide")
    described(folder, "slide", NOISY)
    return rigtwin.machine(folder / "bench.toml")


def recorded(
    machine: rigtwin.Machine,
    frictions: Sequence[float],
    first: int = 0,
    folder: Path | None = None,
) -> list[rigtwin.Recording]:
    return [
        rigtwin.run(
            machine,
            "shake",
            seed=first + n,
            settings={"timing": {"duration": 2.0}},
            effects={"coulomb@guide": friction},
            path=None if folder is None else folder / f"{n}.mcap",
        )
        for n, friction in enumerate(frictions)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 10])
def test_nothing_changed_whatever_the_noise(machine: rigtwin.Machine, seed: int):
    found = rigtwin.what_changed(recorded(machine, (6.0, 6.0), seed))
    assert found.changed == ()
    assert found.sentence.startswith("No change")
    assert [(str(each.name), each.verdict) for each in found.parameters] == [
        ("coulomb@guide", "same")
    ]
    assert not found.zeros


@pytest.mark.slow
def test_a_zero_that_moved_is_no_change(machine: rigtwin.Machine):
    one, other = recorded(machine, (6.0, 6.0))
    columns = {topic: dict(names) for topic, names in other.columns.items()}
    columns["/sensor"]["position"] = columns["/sensor"]["position"] + 2e-3
    found = rigtwin.what_changed([one, replace(other, columns=columns)])
    assert found.changed == ()
    first, second = found.zeros["encoder"]
    assert second - first == pytest.approx(2e-3, rel=0.02)


@pytest.mark.slow
def test_friction_that_changed_is_named_with_its_values(
    machine: rigtwin.Machine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    made = recorded(machine, (6.0, 6.6), folder=tmp_path)
    out = tmp_path / "changes.json"
    files = [str(each.path) for each in made]
    description = str(machine.path)
    assert (
        main(["diagnose", *files, "--machine", description, "--changed", "--json", str(out)]) == 0
    )
    assert "coulomb@guide" in capsys.readouterr().out
    document = json.loads(out.read_text())
    changed = [each for each in document["parameters"] if each["verdict"] == "changed"]
    assert [(each["name"]["kind"], each["name"]["component"]) for each in changed] == [
        ("coulomb", "guide")
    ]
    values = [each["value"] for each in changed[0]["values"]]
    assert values == pytest.approx([6.0, 6.6], rel=0.01)
    # Two recordings differ in more than one way.
    assert not changed[0]["named"]


def test_one_recording_cannot_change(machine: rigtwin.Machine):
    made = recorded(machine, (6.0,))
    with pytest.raises(rigtwin.RigtwinError, match="at least two recordings"):
        rigtwin.what_changed(made)


def test_estimates_that_agree_and_that_do_not():
    random = np.random.default_rng(1)
    widths = np.full(4, 0.1)
    chances = [
        check_homogeneity(5.0 + 0.1 * random.standard_normal(4), widths, 1e6).probability
        for _ in range(400)
    ]
    # A test's probabilities are spread evenly where nothing changed.
    assert np.mean(np.array(chances) < 0.1) == pytest.approx(0.1, abs=0.05)
    assert check_homogeneity(np.array([5.0, 5.0, 5.0, 6.0]), widths, 9.0).probability < 1e-3


def test_several_tests_need_smaller_probabilities():
    assert correct([0.01, 0.5, 0.02]) == pytest.approx([0.03, 0.5, 0.04])


def test_a_trend_is_named_only_if_no_other_does_as_well():
    values, widths = np.array([1.0, 2.1, 2.9, 4.0]), np.full(4, 0.1)
    order, mixed = np.arange(4.0), np.array([3.0, 1.0, 4.0, 2.0])
    trends = fit_trends(values, widths, {"order": order, "load": mixed}, 9.0)
    rivals, named = name_trends(trends, 4, 0.8, 3.0)
    assert named
    assert [each.name for each in rivals] == ["order"]
    trends = fit_trends(values, widths, {"order": order, "amplitude": 2.0 * order + 1.0}, 9.0)
    rivals, named = name_trends(trends, 4, 0.8, 3.0)
    assert not named
    assert {each.name for each in rivals} == {"order", "amplitude"}
