"""Many recordings, each diagnosed by itself: as one list of jobs, on all cores or on a cluster."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.api.answers import diagnose
from rigtwin.api.machines import Settings, machine_of, machines, resolve_machine, tables_of, twin_of
from rigtwin.api.recordings import resolve_recording
from rigtwin.console import finite
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, printable
from rigtwin.studies.sweep import Store, open_workers, run_jobs
from rigtwin.system import return_memory

KEPT, TABLE = "answers.sqlite", "answers.json"
"""In the folder: what is done, and all answers together."""
_HERE = "the-recording-that-is-diagnosed"
"""Stands in a kept answer for its recording, of which there may be copies of other names."""


@dataclass(frozen=True)
class Answered:
    """path: of a recording; document: its answer, as `Diagnosis.document` has it, or None; error:
    why there is none, in a line."""

    path: Path
    document: Mapping[str, Any] | None
    error: str = ""

    def __str__(self) -> str:
        if self.document is None:
            return f"{printable(str(self.path))}: {self.error}"
        return (
            f"{printable(str(self.path))}: {self.document['verdict']}: {self.document['sentence']}"
        )


@dataclass(frozen=True)
class _Job:
    """data: of the recording's file, which a worker elsewhere does not have; machine: its
    description's path, or the name of one that comes along."""

    data: bytes
    machine: str
    settings: tuple[Mapping[str, Any], ...]
    without: tuple[str, ...]


def _answer(job: _Job) -> dict[str, Any]:
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        path = Path(folder) / _HERE
        path.write_bytes(job.data)
        try:
            found = diagnose(
                path, machine=job.machine, settings=job.settings, without=job.without
            ).document()
        except RigtwinError as error:
            return {"error": str(error).replace(str(path), _HERE)}
        finally:
            # Or it grows by some MB a recording.
            return_memory()
    told = json.dumps(finite(found), allow_nan=False)
    return {"answer": told.replace(json.dumps(str(path))[1:-1], _HERE)}


def diagnose_each(
    recordings: Sequence[str | Path],
    folder: str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    workers: int | None = None,
    cluster: str | None = None,
    progress: Callable[[int, int], object] = lambda _done, _all: None,
) -> tuple[Answered, ...]:
    """Diagnoses many recordings, each by itself.

    What is done is kept in the folder, so that a second call goes on where the first was stopped.
    A recording that cannot be diagnosed says why, and does not keep the others from it.

    Parameters
    ----------
    recordings
        Their paths.
    folder
        Of the answers: `answers.json` has all of them by path.
    machine
        That they are of; by default the one that each names. Workers of a cluster must have its
        description, if it is none that comes along, at the same path.
    settings, without
        As of `diagnose`.
    workers, cluster
        Processes on this computer, one a core by default; or the address of a dask cluster.
    progress
        Called with the recordings done and with how many there are.

    Returns
    -------
    tuple of Answered
        In the order of the recordings.

    Raises
    ------
    RigtwinError
        If there is no recording, one is named twice, settings or a machine make no sense, or the
        folder cannot be used.
    """
    paths, out = _paths(recordings), Path(_checked("folder", folder, str | Path, "a path"))
    if not str(folder):
        raise RigtwinError("folder '': expected a folder for the answers")
    _checked("workers", workers, int | None, "a whole number")
    _checked("cluster", cluster, str | None, "an address, such as tcp://host:8786")
    if isinstance(without, str) or not all(isinstance(each, str) for each in _list(without)):
        raise RigtwinError(f"without {without!r:.60}: expected a list of effects' names")
    given = tuple(tables_of(settings))
    on = None if machine is None else resolve_machine(machine)
    try:
        told = json.dumps([given, sorted(without)], sort_keys=True)
    except (TypeError, ValueError):
        raise RigtwinError(f"settings {settings!r:.60}: expected numbers and text") from None
    sensible: set[Path] = set()
    refused: dict[Path, str] = {}
    keys: dict[Path, str] = {}

    def jobs() -> Iterator[tuple[str, _Job]]:
        for path in paths:
            try:
                data = path.read_bytes()
                described = machine_of(resolve_recording(path)) if on is None else on
            except (OSError, ValueError) as error:
                said = getattr(error, "strerror", None) or error
                refused[path] = f"cannot read {printable(str(path))}: {said}"
            except RigtwinError as error:
                refused[path] = str(error)
            else:
                if described.path not in sensible:
                    # What makes no sense of it makes none of all its recordings.
                    twin_of(described, given, without)
                    sensible.add(described.path)
                keys[path] = _digest(data, told.encode(), *map(Path.read_bytes, described.files))
                yield (
                    keys[path],
                    _Job(data, _name(described), given, tuple(without)),
                )

    done = 0

    def count(more: int) -> None:
        nonlocal done
        done += more
        progress(done + len(refused), len(paths))

    with Store(out / KEPT) as store, open_workers(workers, cluster) as several:
        run_jobs(store, several, _answer, jobs(), count)
        answers = tuple(
            Answered(path, None, refused[path])
            if path in refused
            else _read(path, store[key], out / KEPT)
            for path, key in ((path, keys.get(path, "")) for path in paths)
        )
    table = {
        str(each.path): {"error": each.error} if each.document is None else each.document
        for each in answers
    }
    atomic_write(out / TABLE, json.dumps(table, indent=1, allow_nan=False) + "\n")
    return answers


def _read(path: Path, result: Any, kept: Path) -> Answered:
    try:
        if "error" in result:
            return Answered(path, None, result["error"].replace(_HERE, printable(str(path))))
        own = json.dumps(printable(str(path)))[1:-1]
        document = json.loads(result["answer"].replace(_HERE, own))
        _ = document["verdict"], document["sentence"]
    except (TypeError, ValueError, KeyError, AttributeError):
        raise RigtwinError(
            f"{kept} is not a file of answers, or damaged; remove it and run again"
        ) from None
    return Answered(path, document)


def _checked(name: str, given: Any, kinds: Any, expected: str) -> Any:
    if not isinstance(given, kinds) or isinstance(given, bool):
        raise RigtwinError(f"{name} {given!r:.60}: expected {expected}")
    return given


def _list(given: Any) -> list[Any]:
    return list(given) if isinstance(given, Sequence) else [None]


def _paths(recordings: Any) -> list[Path]:
    """Raises RigtwinError unless they are some, of which none is there twice."""
    each = _list(recordings)
    if isinstance(recordings, str) or not all(isinstance(one, str | Path) for one in each):
        raise RigtwinError(f"recordings {recordings!r:.60}: expected a list of paths")
    paths = [Path(one) for one in each]
    if not paths:
        raise RigtwinError("no recording to diagnose")
    seen: set[Path] = set()
    for path in paths:
        whole = path.absolute() if "\0" in str(path) else path.resolve()
        if whole in seen:
            raise RigtwinError(f"{printable(str(path))} is named twice; each is diagnosed once")
        seen.add(whole)
    return paths


def _name(of: Machine) -> str:
    """By which a worker elsewhere finds it too, if it comes along."""
    return of.name if machines().get(of.name) == of.path else str(of.path)


def _digest(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:32]
