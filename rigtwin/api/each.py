"""Independent diagnoses of many recordings, as jobs on all cores or on a cluster."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.api.answers import diagnose
from rigtwin.api.machines import machine_of, machines, resolve_machine
from rigtwin.api.recordings import resolve_recording
from rigtwin.api.twin import Settings, tables_of, twin_of
from rigtwin.console import finite
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, printable
from rigtwin.studies.sweep import Store, open_workers, run_jobs
from rigtwin.system import return_memory

STORE, TABLE = "answers.sqlite", "answers.json"
"""Files in the folder of the answers: the finished jobs, and all answers together."""
_PLACEHOLDER = "the-recording-that-is-diagnosed"
"""Text in a stored answer in place of the recording's path. Answers are keyed by file content;
copies of a recording may have different file names."""


@dataclass(frozen=True)
class Answered:
    """Answer about one recording of many.

    Attributes
    ----------
    path : Path
        File of the recording.
    document : mapping or None
        Answer as `Diagnosis.document` returns it; None if there is none.
    error : str
        Reason why there is no answer, one line. Empty if there is an answer.
    """

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
    """One diagnosis as a job.

    Attributes
    ----------
    data : bytes
        Content of the recording file. A worker on another computer has no access to the file.
    machine : str
        Name of a shipped machine, or the path of a description.
    settings, without
        Changes and removed effects of the twin, see `diagnose`.
    """

    data: bytes
    machine: str
    settings: tuple[Mapping[str, Any], ...]
    without: tuple[str, ...]


def _answer(job: _Job) -> dict[str, Any]:
    """Diagnose one recording. Runs in a worker process."""
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        path = Path(folder) / _PLACEHOLDER
        path.write_bytes(job.data)
        try:
            document = diagnose(
                path, machine=job.machine, settings=job.settings, without=job.without
            ).document()
        except RigtwinError as error:
            # The temporary path must not be stored: it means nothing to the next reader.
            return {"error": str(error).replace(str(path), _PLACEHOLDER)}
        finally:
            # Without this, the process grows by several MB per recording.
            return_memory()
    text = json.dumps(finite(document), allow_nan=False)
    # Strip the quotes from the JSON-encoded path: JSON doubles the backslashes of Windows.
    return {"answer": text.replace(json.dumps(str(path))[1:-1], _PLACEHOLDER)}


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
    """Diagnose many recordings independently.

    Finished answers are stored in the folder, so that a second call continues where the first was
    stopped. A recording that cannot be diagnosed states the reason; the others are not affected.

    Parameters
    ----------
    recordings
        Paths of the recordings.
    folder
        Folder of the answers. Its `answers.json` maps each recording's path to its answer.
    machine
        Machine of all recordings, or its name, or the path of its description. Defaults to the
        one named in the recording. If the description is not a shipped one, every worker of a
        cluster must find it at the same path.
    settings, without
        Changes of the twin and effects removed from it, see `diagnose`.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished recordings and with their total.

    Returns
    -------
    tuple of Answered
        Answers in the order of the recordings.

    Raises
    ------
    RigtwinError
        If there is no recording, one is named twice, settings or machine are invalid, or the
        folder cannot be used.
    """
    paths, out = _paths(recordings), Path(_checked("folder", folder, str | Path, "a path"))
    if not str(folder):
        raise RigtwinError("folder '': expected a folder for the answers")
    _checked("workers", workers, int | None, "a whole number")
    _checked("cluster", cluster, str | None, "an address, such as tcp://host:8786")
    if isinstance(without, str) or not all(isinstance(name, str) for name in _list(without)):
        raise RigtwinError(f"without {without!r:.60}: expected a list of effects' names")
    batch = _Batch(paths, machine, settings, without)
    with Store(out / STORE) as store, open_workers(workers, cluster) as pool:
        run_jobs(store, pool, _answer, batch.jobs(), partial(batch.count, progress))
        answers = tuple(batch.answer(path, store) for path in paths)
    _write_table(out / TABLE, answers)
    return answers


def _write_table(path: Path, answers: Sequence[Answered]) -> None:
    """Write a table that maps each recording's path to its answer."""
    table = {
        str(answer.path): {"error": answer.error} if answer.document is None else answer.document
        for answer in answers
    }
    atomic_write(path, json.dumps(table, indent=1, allow_nan=False) + "\n")


class _Batch:
    """Recordings as jobs, or the reason why one cannot become a job."""

    def __init__(
        self,
        paths: Sequence[Path],
        machine: Machine | str | Path | None,
        settings: Settings,
        without: Sequence[str],
    ) -> None:
        self._paths, self._without = paths, tuple(without)
        self._changes = tuple(tables_of(settings))
        self._stated = None if machine is None else resolve_machine(machine)
        try:
            options = json.dumps([self._changes, sorted(without)], sort_keys=True)
        except (TypeError, ValueError):
            raise RigtwinError(f"settings {settings!r:.60}: expected numbers and text") from None
        self._options = options.encode()
        self._validated: set[Path] = set()
        self._refused: dict[Path, str] = {}
        self._keys: dict[Path, str] = {}
        self._done = 0

    def jobs(self) -> Iterator[tuple[str, _Job]]:
        """Yield the key and the job of each recording that can be read.

        Recordings are read when a worker is free, so that few are in memory at once.
        """
        for path in self._paths:
            try:
                data = path.read_bytes()
                described = self._machine_of(path)
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                self._refused[path] = f"cannot read {printable(str(path))}: {reason}"
            except RigtwinError as error:
                self._refused[path] = str(error)
            else:
                if described.path not in self._validated:
                    # Validate the settings once per machine: an invalid one ends the whole call.
                    twin_of(described, self._changes, self._without)
                    self._validated.add(described.path)
                # The answer also depends on the description and its model, so their content enters
                # the key.
                files = map(Path.read_bytes, described.files)
                self._keys[path] = _digest(data, self._options, *files)
                yield self._keys[path], _Job(data, _name(described), self._changes, self._without)

    def _machine_of(self, path: Path) -> Machine:
        if self._stated is not None:
            return self._stated
        return machine_of(resolve_recording(path))

    def count(self, progress: Callable[[int, int], object], more: int) -> None:
        """Report finished jobs."""
        self._done += more
        # Refused recordings never become jobs, but are finished as well.
        progress(self._done + len(self._refused), len(self._paths))

    def answer(self, path: Path, store: Store) -> Answered:
        """Return the answer about a recording, once all jobs are done."""
        if path in self._refused:
            return Answered(path, None, self._refused[path])
        return _read(path, store[self._keys.get(path, "")], store.path)


def _read(path: Path, result: Any, store: Path) -> Answered:
    """Return a stored answer with the recording's path put in. Raises RigtwinError if damaged."""
    try:
        if "error" in result:
            return Answered(path, None, result["error"].replace(_PLACEHOLDER, printable(str(path))))
        # Escaped as inside a JSON text, because it is put into one.
        escaped = json.dumps(printable(str(path)))[1:-1]
        document = json.loads(result["answer"].replace(_PLACEHOLDER, escaped))
        _ = document["verdict"], document["sentence"]
    except (TypeError, ValueError, KeyError, AttributeError):
        raise RigtwinError(
            f"{store} is not a file of answers, or damaged; remove it and run again"
        ) from None
    return Answered(path, document)


def _checked(name: str, value: Any, kinds: Any, expected: str) -> Any:
    """Return an argument. Raises RigtwinError if it has another type than `kinds`."""
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise RigtwinError(f"{name} {value!r:.60}: expected {expected}")
    return value


def _list(values: Any) -> list[Any]:
    """Return a sequence as a list. Anything else becomes [None], which no check accepts."""
    return list(values) if isinstance(values, Sequence) else [None]


def _paths(recordings: Any) -> list[Path]:
    """Return the recordings' paths. Raises RigtwinError if there are none, or for duplicates."""
    names = _list(recordings)
    if isinstance(recordings, str) or not all(isinstance(name, str | Path) for name in names):
        raise RigtwinError(f"recordings {recordings!r:.60}: expected a list of paths")
    paths = [Path(name) for name in names]
    if not paths:
        raise RigtwinError("no recording to diagnose")
    resolved: set[Path] = set()
    for path in paths:
        # `resolve` refuses a null character, for which reading gives the clearer message.
        target = path.absolute() if "\0" in str(path) else path.resolve()
        if target in resolved:
            raise RigtwinError(f"{printable(str(path))} is named twice; each is diagnosed once")
        resolved.add(target)
    return paths


def _name(machine: Machine) -> str:
    """Return the name of a shipped machine, which other computers have too, or else the path."""
    shipped = machines().get(machine.name) == machine.path
    return machine.name if shipped else str(machine.path)


def _digest(*parts: bytes) -> str:
    """Return the key of a job: a hash of all that its answer depends on."""
    digest = hashlib.sha256()
    for part in parts:
        # The length keeps parts apart that would concatenate to the same bytes.
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:32]
