"""Machines described from a model and a log, and logs as recordings of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rigtwin.api.recordings import Recording, with_machine
from rigtwin.describing.described import MODELS, Described, describe_log
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader

Log = str | Path | Sequence[str | Path]
"""A log, or several files of one that are put side by side; "a.csv+b.csv" is the same."""
BESIDE = "+"


def describe(
    model: str | Path,
    log: Log,
    *,
    columns: Mapping[str, str] | None = None,
    test: str = "",
    out: str | Path | None = None,
) -> Described:
    """Describe a machine from its model and a log of it.

    Parameters
    ----------
    model
        MJCF or URDF.
    log
        CSV, JSON, MATLAB or parquet file, or several that are put side by side, row by row.
    columns
        What the log does not state: "elbow.position" → a column with or without sign and unit
        ("-q2 [deg]"), a formula of columns, or "none"; "*.position" → a unit ("[deg]"); "time" →
        a column with its unit, or the period in s.
    test
        Kind of the test: "inverse dynamics", "position commands", "servos" or "force commands".
        Concluded from the log by default.
    out
        Folder that the description and the map are written to.

    Returns
    -------
    Described
        The machine, and the table of what was taken for what. `str()` of it is that table;
        `record()` makes a recording of a log.

    Raises
    ------
    RigtwinError
        With a question, if two readings of the log are possible.
    """
    if Path(model).suffix.lower() not in MODELS:
        raise RigtwinError(f"model {model}: expected a name that ends in {', '.join(MODELS)}")
    described = describe_log(Path(model), log_files(log), columns or {}, test)
    if out is not None:
        described.write(out)
    return described


def is_model(machine: object) -> bool:
    """Whether a machine is named by its model, without a description.

    Parameters
    ----------
    machine
        Anything that names a machine.
    """
    return isinstance(machine, str | Path) and Path(machine).suffix.lower() in MODELS


def log_files(log: Log | reader.Recording) -> tuple[Path, ...]:
    """Return the files of a log.

    Parameters
    ----------
    log
        A log, or several files of one.
    """
    if isinstance(log, reader.Recording):
        raise RigtwinError(
            f"{log.path}: it is a recording already; expected a log beside a model, or a "
            "description of its machine"
        )
    if not isinstance(log, str | Path):
        return tuple(Path(each) for each in log)
    path = Path(log)
    if BESIDE in str(log) and not path.exists():
        parts = tuple(Path(each) for each in str(log).split(BESIDE))
        if all(part.is_file() for part in parts):
            return parts
    return (path,)


def record_log(described: Described, log: Log | reader.Recording) -> Recording:
    """Return a log as a recording of a described machine.

    Parameters
    ----------
    described
        The machine.
    log
        A log with the same columns.
    """
    return with_machine(described.record(log_files(log)), described.machine)
