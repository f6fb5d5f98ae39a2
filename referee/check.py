"""Runs the withheld-effect check: the referee in one process, diagnoses in others, the key opened
last."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from rigtwin.errors import RigtwinError
from rigtwin.interruptions import block_sigint
from rigtwin.studies.sweep import Store, Workers, iterate_results, run_jobs

Files = Sequence[bytes]
"""Contents of a case's recordings: the one that is diagnosed, the one held out, and further ones to
be diagnosed with the first. A worker needs no disk in common."""


@dataclass(frozen=True)
class Result:
    """A check. key: what the referee did, an entry a case; answers: what the diagnosis said, a JSON
    document a case; crude: what the black-box baseline named, of the cases it was tried on;
    settled: what it said of the cases for which it had proposed a next test, with that test;
    commitment: SHA-256 of salt and key, given before any answer."""

    seed: int
    commitment: str
    key: list[dict[str, Any]]
    answers: list[dict[str, Any]]
    crude: dict[int, str]
    settled: dict[int, dict[str, Any]] = field(default_factory=dict)


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
    with block_sigint():
        started = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
    with started as referee:
        assert referee.stdin is not None
        assert referee.stdout is not None
        commitment = ""
        try:
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
            given = _diagnose_all(recordings, cases, workers, progress)
            settled = _run_next_tests(recordings, given, referee.stdin, referee.stdout, workers)
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
    return Result(seed, commitment, json.loads(opened), given, crude, settled)


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


def _run_next_tests(
    recordings: Path,
    given: Sequence[dict[str, Any]],
    ask: IO[str],
    answers: IO[str],
    workers: Workers,
) -> dict[int, dict[str, Any]]:
    """What the diagnosis says with the test that it proposed, of the cases where it did."""
    keys: dict[int, str] = {}
    for number, said in enumerate(given):
        if said["next_test"] is not None:
            ask.write(f"next {number} {said['next_test']['experiment']}\n")
            ask.flush()
            if not answers.readline().startswith("recorded"):
                raise RigtwinError("the referee ended before it recorded the test it was asked for")
            keys[number] = _key(recordings, number, FURTHER)

    def jobs() -> Iterator[tuple[str, Files]]:
        for number, key in keys.items():
            yield key, [path.read_bytes() for path in _paths(recordings, number, FURTHER)]

    with Store(recordings / "answers.sqlite") as store:
        run_jobs(store, workers, answer, jobs(), lambda _: None)
        return {number: store[key] for number, key in keys.items()}


RECORDED = ("", "-held-out")
"""Endings of the names of a case's recordings,"""
FURTHER = (*RECORDED, "-next")
"""and with the test that was proposed."""


def _paths(recordings: Path, number: int, endings: Sequence[str] = RECORDED) -> list[Path]:
    return [recordings / f"{number:03d}{ending}.mcap" for ending in endings]


def _key(recordings: Path, number: int, endings: Sequence[str] = RECORDED) -> str:
    """Of a case: another recording is another question."""
    return hashlib.sha256(
        b"".join(path.read_bytes() for path in _paths(recordings, number, endings))
    ).hexdigest()


def answer(files: Files) -> dict[str, Any]:
    """One case's answer, of its recording, the one held out, and a further one if there is one.
    Runs where there are neither the key nor the other cases."""
    from machines import DEFAULT_MACHINE
    from rigtwin.description.catalogue import find
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.recording import load
    from rigtwin.simulation.experiment import find_experiment

    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        recordings = []
        for number, content in enumerate(files):
            path = Path(folder) / f"{number}.mcap"
            path.write_bytes(content)
            recordings.append(load(path))
        first, held_out, *further = recordings
        machine = find(DEFAULT_MACHINE)
        tests = [find_experiment(machine, name) for name in machine.next_tests]
        found = diagnose(machine, [first, *further], held_out=[held_out], tests=tests)
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
