"""Runs the withheld-effect check: the referee in one process, diagnoses in others, the key opened
last."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, Workers, iterate_results, run_jobs

Files = Sequence[bytes]
"""Contents of a case's recordings: the one that is diagnosed, and the one held out. A worker needs
no disk in common."""


@dataclass(frozen=True)
class Result:
    """A check. key: what the referee did, an entry a case; answers: what the diagnosis said, a JSON
    document a case; crude: what the black-box baseline named, of the cases it was tried on;
    commitment: SHA-256 of salt and key, given before any answer."""

    seed: int
    commitment: str
    key: list[dict[str, Any]]
    answers: list[dict[str, Any]]
    crude: dict[int, str]


def check(
    folder: Path,
    cases: int,
    seed: int,
    baselines: bool,
    workers: Workers,
    progress: Callable[[int], object] = lambda _: None,
) -> Result:
    """The whole check. folder: recordings and answers; answers that are there for the same
    recordings are kept, so that an interrupted check goes on. progress is called once a recording
    and once an answer.

    Raises RigtwinError if the referee fails, or its key is not the one that it committed itself to.
    """
    recordings = folder / f"seed-{seed}"
    recordings.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "referee.referee", str(recordings), str(cases), str(seed)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as referee:
        assert referee.stdin is not None
        assert referee.stdout is not None
        commitment = ""
        for line in referee.stdout:
            word, _, rest = line.partition(" ")
            if word == "case":
                progress(1)
            elif word == "commitment":
                commitment = rest.strip()
                break
        if not commitment:
            raise RigtwinError("the referee ended before it committed itself to a key")
        (recordings / "commitment.txt").write_text(commitment + "\n")
        try:
            given = _diagnose_all(recordings, cases, workers, progress)
            crude = _crude(recordings, cases, workers) if baselines else {}
        except BaseException:
            referee.kill()
            raise
        referee.stdin.write("open\n")
        referee.stdin.flush()
        salt = referee.stdout.readline().partition(" ")[2].strip()
        opened = referee.stdout.readline().strip()
    if hashlib.sha256((salt + opened).encode()).hexdigest() != commitment:
        raise RigtwinError("the referee's key is not the one that it committed itself to")
    (recordings / "key.json").write_text(opened + "\n")
    return Result(seed, commitment, json.loads(opened), given, crude)


def _diagnose_all(
    recordings: Path, cases: int, workers: Workers, progress: Callable[[int], object]
) -> list[dict[str, Any]]:
    def jobs() -> Iterator[tuple[str, Files]]:
        for number in range(cases):
            files = [path.read_bytes() for path in _paths(recordings, number)]
            yield keys[number], files

    keys = [_key(recordings, number) for number in range(cases)]
    with Store(recordings / "answers.sqlite") as store:
        run_jobs(store, workers, answer, jobs(), progress)
        return [store[key] for key in keys]


def _paths(recordings: Path, number: int) -> tuple[Path, Path]:
    return recordings / f"{number:03d}.mcap", recordings / f"{number:03d}-held-out.mcap"


def _key(recordings: Path, number: int) -> str:
    """Of a case: another recording is another question."""
    return hashlib.sha256(
        b"".join(path.read_bytes() for path in _paths(recordings, number))
    ).hexdigest()


def answer(files: Files) -> dict[str, Any]:
    """One case's answer, of its recording and the one held out. Runs where there are neither the
    key nor the other cases."""
    from machines import DEFAULT_MACHINE
    from rigtwin.description.catalogue import find
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.recording import load

    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        names = ("recording.mcap", "held-out.mcap")
        for name, content in zip(names, files, strict=True):
            (Path(folder) / name).write_bytes(content)
        recording, held_out = (load(Path(folder) / name) for name in names)
        found = diagnose(find(DEFAULT_MACHINE), [recording], held_out=[held_out])
        return found.document()


def name_effect(content: bytes) -> str:
    """What the black-box baseline names in a recording."""
    from referee.crude import black_box

    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "recording.mcap"
        path.write_bytes(content)
        return black_box(path)


def _crude(recordings: Path, cases: int, workers: Workers) -> dict[int, str]:
    from referee.crude import TRIED

    jobs = (
        (str(number), _paths(recordings, number)[0].read_bytes())
        for number in range(min(cases, TRIED))
    )
    return {
        int(number): name
        for number, name in sorted(
            iterate_results(workers, name_effect, jobs), key=lambda pair: int(pair[0])
        )
    }
