"""Runs the withheld-effect check: the referee in one process, diagnoses in others, the key opened last."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rigtwin.errors import RigtwinError


@dataclass(frozen=True)
class Result:
    """A check. key: what the referee did, an entry a case; answers: what the diagnosis said, a JSON document a case; crude:
    what the black-box baseline named, of the cases it was tried on; commitment: SHA-256 of salt and key, given before any
    answer."""

    seed: int
    commitment: str
    key: list[dict[str, Any]]
    answers: list[dict[str, Any]]
    crude: dict[int, str]


def check(folder: Path, cases: int, seed: int, baselines: bool, progress: Callable[[int], object] = lambda _: None) -> Result:
    """The whole check. folder: recordings and answers; answers that are there for the same recordings are kept, so that an
    interrupted check goes on. progress is called once a recording and once an answer.

    Raises RigtwinError if the referee fails, or its key is not the one that it committed itself to.
    """
    recordings = folder / f"seed-{seed}"
    answers = recordings / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "rigtwin.blindcheck.referee", str(recordings), str(cases), str(seed)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as referee:
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
            given = _diagnosed(recordings, answers, cases, progress)
            crude = _crude(recordings, cases) if baselines else {}
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


def _workers() -> int:
    return max(1, os.cpu_count() or 1)


def _diagnosed(recordings: Path, answers: Path, cases: int, progress: Callable[[int], object]) -> list[dict[str, Any]]:
    found: dict[int, dict[str, Any]] = {}
    with ProcessPoolExecutor(_workers(), get_context("spawn")) as pool:
        jobs = {pool.submit(answer, recordings, answers, number): number for number in range(cases)}
        for job in as_completed(jobs):
            found[jobs[job]] = job.result()
            progress(1)
    return [found[number] for number in range(cases)]


def answer(recordings: Path, answers: Path, number: int) -> dict[str, Any]:
    """One case's answer, worked out or read again if its recording is the same. Runs in a process that knows files alone."""
    from rigtwin.channels import SUSPENSION_RIG
    from rigtwin.configuration import Configuration
    from rigtwin.diagnosis import diagnose as module
    from rigtwin.machine.library import find
    from rigtwin.recording import load

    path, held_out = recordings / f"{number:03d}.mcap", recordings / f"{number:03d}-held-out.mcap"
    digest = hashlib.sha256(path.read_bytes() + _version()).hexdigest()
    place = answers / f"{number:03d}.json"
    if place.exists():
        kept = json.loads(place.read_text())
        if kept.get("digest") == digest:
            return kept
    outcome = module.diagnose(find(SUSPENSION_RIG), [load(path)], Configuration(), [load(held_out)])
    document = {**outcome.diagnosis.document(), "digest": digest}
    place.write_text(json.dumps(document))
    return document


def _version() -> bytes:
    """Of the diagnosis: another one gives other answers."""
    digest = hashlib.sha256()
    for source in sorted((Path(__file__).parent.parent).rglob("*.py")):
        if "blindcheck" not in source.parts:
            digest.update(source.read_bytes())
    return digest.digest()


def _crude(recordings: Path, cases: int) -> dict[int, str]:
    from rigtwin.blindcheck.crude import TRIED, black_box

    with ProcessPoolExecutor(_workers(), get_context("spawn")) as pool:
        numbers = range(min(cases, TRIED))
        names = pool.map(black_box, [recordings / f"{number:03d}.mcap" for number in numbers])
        return dict(zip(numbers, names, strict=True))
