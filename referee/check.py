"""The withheld-effect check: a referee process, diagnoses in others, and a key opened last."""

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
"""Contents of a case's recordings: the diagnosed one, the held-out one, then further ones.

Contents travel instead of paths, so workers need no shared disk.
"""


@dataclass(frozen=True)
class Result:
    """Result of a check.

    Attributes
    ----------
    seed : int
        Seed of the referee.
    commitment : str
        SHA-256 of salt and key, published before any answer.
    key : list of dict
        The referee's key, one entry per case.
    answers : list of dict
        The diagnoses' answers, one JSON document per case.
    crude : dict
        Number of a case → effect named by the black-box baseline.
    settled : dict
        Number of a case → answer after the next test that its diagnosis had proposed.
    """

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
    """Run the whole check.

    Parameters
    ----------
    folder : Path
        Folder of recordings and answers. Answers to equal recordings are reused, so an
        interrupted check resumes.
    cases, seed : int
        Number of cases, and seed of the referee.
    baselines : bool
        Whether the black-box baseline runs as well.
    workers : Workers
        Processes that diagnose.
    progress : callable
        Function called with 1 after every recording and every answer.

    Returns
    -------
    Result
        Key and answers.

    Raises
    ------
    RigtwinError
        If the referee fails, or its key does not match its commitment.
    """
    recordings = folder / f"seed-{seed}"
    # The seed is part of the path: two checks never mix their recordings.
    recordings.mkdir(parents=True, exist_ok=True)
    with _start_referee(recordings, cases, seed) as referee:
        assert referee.stdin is not None
        assert referee.stdout is not None
        try:
            commitment = _await_commitment(referee.stdout, progress)
            (recordings / "commitment.txt").write_text(commitment + "\n")
            # From here on the key is fixed: the referee only records further tests, and opens it at
            # the end.
            answers = _diagnose_all(recordings, cases, workers, progress)
            settled = _run_next_tests(recordings, answers, referee.stdin, referee.stdout, workers)
            crude = _crude(recordings, cases, workers) if baselines else {}
        except BaseException:
            referee.kill()
            raise
        referee.stdin.write("open\n")
        referee.stdin.flush()
        # The salt keeps the key from being guessed from its hash: a key has few possible values.
        salt = referee.stdout.readline().partition(" ")[2].strip()
        opened = referee.stdout.readline().strip()
    # The key was fixed before the first answer only if its hash matches.
    if hashlib.sha256((salt + opened).encode()).hexdigest() != commitment:
        raise RigtwinError("the referee's key does not match its commitment")
    (recordings / "key.json").write_text(opened + "\n")
    return Result(seed, commitment, json.loads(opened), answers, crude, settled)


def _start_referee(recordings: Path, cases: int, seed: int) -> subprocess.Popen[str]:
    """Start the referee, which records its cases in a folder."""
    command = [sys.executable, "-m", "referee.referee", str(recordings), str(cases), str(seed)]
    # Block SIGINT while the referee starts: Ctrl-C would end it in its imports.
    with block_sigint():
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _await_commitment(lines: IO[str], progress: Callable[[int], object]) -> str:
    """Return the referee's commitment to its key, which follows its last recording."""
    for line in lines:
        word, _, value = line.partition(" ")
        if word == "case":
            progress(1)
        elif word == "commitment" and value.strip():
            return value.strip()
    raise RigtwinError("the referee ended before it published a commitment to its key")


def _diagnose_all(
    recordings: Path, cases: int, workers: Workers, progress: Callable[[int], object]
) -> list[dict[str, Any]]:
    """Return the answers to all cases, in their order."""

    def jobs() -> Iterator[tuple[str, Files]]:
        for number in range(cases):
            files = [path.read_bytes() for path in _paths(recordings, number)]
            yield keys[number], files

    # Answers are stored by the contents that they are based on, so an equal recording is not
    # diagnosed twice.
    keys = [_key(recordings, number) for number in range(cases)]
    with Store(recordings / "answers.sqlite") as store:
        run_jobs(store, workers, answer, jobs(), progress)
        return [store[key] for key in keys]


def _run_next_tests(
    recordings: Path,
    first_answers: Sequence[dict[str, Any]],
    requests: IO[str],
    answers: IO[str],
    workers: Workers,
) -> dict[int, dict[str, Any]]:
    """Return the answers with the next test, for the cases whose diagnosis proposed one."""
    keys: dict[int, str] = {}
    for number, first_answer in enumerate(first_answers):
        if first_answer["next_test"] is not None:
            requests.write(f"next {number} {first_answer['next_test']['experiment']}\n")
            requests.flush()
            if not answers.readline().startswith("recorded"):
                raise RigtwinError("the referee ended before it recorded the requested test")
            keys[number] = _key(recordings, number, FURTHER)

    def jobs() -> Iterator[tuple[str, Files]]:
        for number, key in keys.items():
            yield key, [path.read_bytes() for path in _paths(recordings, number, FURTHER)]

    with Store(recordings / "answers.sqlite") as store:
        run_jobs(store, workers, answer, jobs(), lambda _: None)
        return {number: store[key] for number, key in keys.items()}


RECORDED = ("", "-held-out")
"""Suffixes of the names of a case's recordings."""
FURTHER = (*RECORDED, "-next")
"""Suffixes that include the proposed test."""


def _paths(recordings: Path, number: int, endings: Sequence[str] = RECORDED) -> list[Path]:
    """Return the paths of a case's recordings."""
    return [recordings / f"{number:03d}{ending}.mcap" for ending in endings]


def _key(recordings: Path, number: int, endings: Sequence[str] = RECORDED) -> str:
    """Return the key of a stored answer: a hash of the recordings it is based on."""
    return hashlib.sha256(
        b"".join(path.read_bytes() for path in _paths(recordings, number, endings))
    ).hexdigest()


def answer(files: Files) -> dict[str, Any]:
    """Return the answer to one case: its recording, the held-out one, and further ones if any.

    The function runs in a worker, which has neither the key nor the other cases.
    """
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
        diagnosis = diagnose(machine, [first, *further], held_out=[held_out], tests=tests)
        return diagnosis.document()


def name_effect(content: bytes) -> str:
    """Return the effect that the black-box baseline names in a recording."""
    from referee.crude import black_box

    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "recording.mcap"
        path.write_bytes(content)
        return black_box(path)


def _crude(recordings: Path, cases: int, workers: Workers) -> dict[int, str]:
    """Return the baseline's names for the first cases, by number."""
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
