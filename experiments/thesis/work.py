"""Does the jobs of studies side by side, and keeps each result on disk, so that what was done is never done again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

import controllers
import experiments
import rigtwin
from experiments.thesis.study import Job, Result, Study
from rigtwin.errors import RigtwinError


def source_digest() -> str:
    """Of all that a result depends on: the sources and models of this version."""
    digest = hashlib.sha256()
    for package in (rigtwin, controllers, experiments):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.read_bytes())
    for path in sorted((Path(str(rigtwin.__file__)).parents[1] / "models").rglob("*.xml")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def kept(path: Path) -> Result | None:
    """A result from disk, or None if there is none that can be read."""
    try:
        with np.load(path) as stored:
            return {name: stored[name] if stored[name].ndim else float(stored[name]) for name in stored.files}
    except (OSError, ValueError, EOFError, BadZipFile):
        return None


def keep(path: Path, result: Result) -> None:
    """Writes a result as a whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    with temporary.open("wb") as file:
        np.savez(file, **{name: np.asarray(value) for name, value in result.items()})  # type: ignore[arg-type]
    temporary.replace(path)


def done(
    studies: Sequence[Study], seeds: int, folder: Path, workers: int, progress: Callable[[int, int], object] = lambda *_: None
) -> dict[str, dict[str, Result]]:
    """Results of every study's jobs, study → key → result. progress is called with (jobs done, jobs in all).

    Interrupted, it keeps what is finished. Raises RigtwinError if the folder cannot be written.
    """
    into = folder / source_digest()
    results: dict[str, dict[str, Result]] = {study.name: {} for study in studies}
    due: list[tuple[str, str, Path, Job]] = []
    for study in studies:
        for key, job in study.jobs(seeds).items():
            path = into / study.name / f"{key.replace('/', '-')}.npz"
            found = kept(path)
            if found is None:
                due.append((study.name, key, path, job))
            else:
                results[study.name][key] = found
    total = len(due) + sum(len(found) for found in results.values())
    progress(total - len(due), total)

    def work(path: Path, job: Job) -> Result:
        result = job()
        keep(path, result)
        return result

    try:
        into.mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(workers) as pool:
            running = {pool.submit(work, path, job): (study, key) for study, key, path, job in due}
            try:
                for number, future in enumerate(as_completed(running), start=1):
                    study, key = running[future]
                    results[study][key] = future.result()
                    progress(total - len(due) + number, total)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
    except OSError as error:
        raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None
    return results
