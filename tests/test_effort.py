"""A search that ends after a given effort, and says so."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.diagnosis.effort import Effort
from rigtwin.diagnosis.evidence import Evidence
from tests.helpers.described import NOISY, described

CUT = "the search ended after about"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("slide")
    described(folder, "slide", NOISY)
    path = folder / "shake.mcap"
    effects = {"coulomb@guide": 6.0, "delay@drive": 0.02}
    rigtwin.run(folder / "bench.toml", "shake", seed=1, effects=effects, path=path)
    return path


def diagnosed(recording: Path, effort: float) -> rigtwin.Diagnosis:
    return rigtwin.diagnose(recording, machine=recording.parent / "bench.toml", effort=effort)


def test_what_threads_add_up_does_not_depend_on_their_order():
    effort = Effort(100.0)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(effort.add, [0.1] * 1000))
    assert effort.share == 1.0


def test_a_prediction_costs_its_integration_steps(recording: Path):
    machine = rigtwin.machine(recording.parent / "bench.toml")
    record = rigtwin.load(recording)
    evidence = Evidence(machine, [record], [machine.configuration_of(record)])
    model = evidence.models[0]
    assert model.effort > 0.0
    assert model.double_steps().effort == pytest.approx(2.0 * model.effort)
    evidence.effort = Effort(1.0)
    evidence.predict(evidence.plant)
    evidence.halve_steps().predict(evidence.plant)
    assert evidence.effort.share == pytest.approx(1.5 * model.effort)


@pytest.mark.slow
def test_a_search_that_ends_early_says_so_and_gives_the_same_answer_again(recording: Path):
    first, second = (diagnosed(recording, 0.02) for _ in range(2))
    assert any(note.startswith(CUT) for note in first.answer.notes)
    assert [effect.name for effect in first.effects] == [effect.name for effect in second.effects]
    whole = diagnosed(recording, 120.0)
    assert not any(note.startswith(CUT) for note in whole.answer.notes)
    assert {str(effect.name) for effect in whole.effects} == {"coulomb@guide", "delay@drive"}


def test_an_effort_of_nothing_is_refused(recording: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(rigtwin.RigtwinError, match="effort must be positive"):
        diagnosed(recording, 0.0)
    arguments = ["diagnose", str(recording), "--machine", str(recording.parent / "bench.toml")]
    assert main([*arguments, "--effort", "-1"]) == 1
    assert "effort must be positive" in capsys.readouterr().err
