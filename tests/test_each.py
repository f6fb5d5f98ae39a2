"""Many recordings, each diagnosed by itself."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

import rigtwin
from rigtwin.api import each
from rigtwin.cli import main
from rigtwin.errors import RigtwinError

SHORT = {"timing": {"duration": 3.0}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording without a gap, one with, and a file that is none."""
    made = tmp_path_factory.mktemp("each")
    rigtwin.run("emps", "positioning", seed=1, settings=SHORT, path=made / "plain.mcap")
    rigtwin.run(
        "emps",
        "positioning",
        seed=2,
        settings=SHORT,
        effects={"coulomb@guide": 25.0},
        path=made / "rubs.mcap",
    )
    (made / "none.mcap").write_text("none")
    return made


def files(folder: Path) -> list[Path]:
    return [folder / f"{name}.mcap" for name in ("plain", "none", "rubs")]


@pytest.mark.slow
def test_each_answer_is_that_of_a_diagnosis_alone(folder: Path, tmp_path: Path) -> None:
    shown: list[tuple[int, int]] = []
    answers = rigtwin.diagnose_each(
        files(folder), tmp_path, workers=1, progress=lambda done, all_: shown.append((done, all_))
    )
    plain, none, rubs = answers
    assert none.document is None
    assert "is not an MCAP file" in none.error
    assert shown[-1] == (3, 3)
    for answer in (plain, rubs):
        alone = rigtwin.diagnose(answer.path).document()
        alone["recordings"] = [str(answer.path)]
        expected = json.loads(json.dumps(each.finite(alone)))
        assert answer.document is not None
        # How long it took is its own.
        assert answer.document.keys() == expected.keys()
        assert {**answer.document, "seconds": 0.0} == {**expected, "seconds": 0.0}
    table = json.loads((tmp_path / each.TABLE).read_text())
    assert table[str(rubs.path)] == rubs.document
    assert table[str(none.path)] == {"error": none.error}


def test_what_is_done_is_not_done_again(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[Path] = []

    def found(path: Path, **_: Any) -> Any:
        called.append(path)
        if len(called) == 2:
            raise KeyboardInterrupt
        return rigtwin.diagnose(path)

    monkeypatch.setattr(each, "diagnose", found)
    good = [files(folder)[0], files(folder)[2]]
    with pytest.raises(KeyboardInterrupt):
        rigtwin.diagnose_each(good, tmp_path, workers=1)
    first = rigtwin.diagnose_each(good, tmp_path, workers=1)
    assert len(called) == 3
    assert rigtwin.diagnose_each(good, tmp_path, workers=1) == first
    assert len(called) == 3
    # Other settings are another question.
    rigtwin.diagnose_each(good[:1], tmp_path, workers=1, settings={"guide": {"coulomb": 3.0}})
    assert len(called) == 4


def test_the_command_says_a_line_each(folder: Path, tmp_path: Path, capsys: Any) -> None:
    given = [str(path) for path in files(folder)]
    assert main(["diagnose", *given, "--each", str(tmp_path), "--workers", "1"]) == 1
    plain, none, rubs, told = capsys.readouterr().out.splitlines()
    assert "no gap" in plain
    assert "is not an MCAP file" in none
    assert "Coulomb friction" in rubs
    assert told == f"3 recordings; answers in {tmp_path / each.TABLE}"
    assert main(["diagnose", given[0], "--each", str(tmp_path), "--html", "r.html"]) == 1
    assert "leave out" in capsys.readouterr().err
    assert main(["diagnose", given[0], "--workers", "2"]) == 1


def test_bad_lists_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(RigtwinError, match="named twice"):
        rigtwin.diagnose_each([files(folder)[0]] * 2, tmp_path)
    with pytest.raises(RigtwinError, match="no recording"):
        rigtwin.diagnose_each([], tmp_path)
    with pytest.raises(RigtwinError, match="unknown group 'nosuch'"):
        rigtwin.diagnose_each(files(folder)[:1], tmp_path, workers=1, settings={"nosuch": {"x": 1}})
    assert not (tmp_path / each.TABLE).exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(RigtwinError, match="cannot make"):
        rigtwin.diagnose_each(files(folder)[:1], tmp_path / "file" / "below")


@pytest.mark.parametrize(
    ("name", "given"),
    [
        *(("recordings", given) for given in (None, 5, [1], [None], "one.mcap", Path("one.mcap"))),
        *(("folder", given) for given in (None, 3, "")),
        *(("workers", given) for given in ("2", 1.5, True)),
        *(("cluster", given) for given in (5, b"tcp://a:1", "tcp://..:5")),
        *(("settings", given) for given in (None, 5, [5], {"guide": {"coulomb": print}})),
        *(("without", given) for given in (None, [1], "coulomb@guide")),
    ],
)
def test_what_is_of_the_wrong_type_is_one_line(
    name: str, given: Any, folder: Path, tmp_path: Path
) -> None:
    asked: dict[str, Any] = {"recordings": files(folder)[:1], "folder": tmp_path, name: given}
    with pytest.raises(RigtwinError, match=name) as error:
        rigtwin.diagnose_each(**asked)
    assert len(str(error.value).splitlines()) == 1


def test_copies_of_a_recording_have_their_own_names(folder: Path, tmp_path: Path) -> None:
    copy, short = tmp_path / 'a "copy".mcap', tmp_path / "s.mcap"
    copy.write_bytes(files(folder)[0].read_bytes())
    rigtwin.run("emps", "positioning", settings={"timing": {"duration": 0.02}}, path=short)
    answers = rigtwin.diagnose_each([files(folder)[0], copy, short], tmp_path, workers=1)
    for answer in answers:
        assert answer.document is not None
        assert answer.document["recordings"] == [str(answer.path)]
    told = str(answers[2])
    assert "unusable" in told
    assert "rigtwin-" not in told
    assert "the-recording" not in told


@pytest.mark.parametrize(
    "kept", ['{"answer": 5}', "[]", "null", '{"answer": "{}"}', '{"answer": "x"}']
)
def test_answers_of_another_shape_are_one_line(kept: str, folder: Path, tmp_path: Path) -> None:
    one = files(folder)[:1]
    rigtwin.diagnose_each(one, tmp_path, workers=1)
    base = sqlite3.connect(tmp_path / each.STORE)
    base.execute("UPDATE results SET result = ?", (kept,))
    base.commit()
    base.close()
    with pytest.raises(RigtwinError, match="or damaged; remove it"):
        rigtwin.diagnose_each(one, tmp_path, workers=1)
