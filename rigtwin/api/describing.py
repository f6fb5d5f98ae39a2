"""Descriptions made from a model and a log, and logs as recordings of the described machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rigtwin.api.recordings import Origin, Recording, with_machine
from rigtwin.describing.described import Described, describe_log
from rigtwin.description.bare import MODELS
from rigtwin.description.menagerie import find_robot, is_robot
from rigtwin.errors import RigtwinError
from rigtwin.importing.log_source import LogSource
from rigtwin.recording import reader

Log = str | Path | Sequence[str | Path] | Any
"""Log of another program: a file, or several whose columns are joined; or a pandas DataFrame, an
Arrow table, a numpy array with named fields, or a dictionary of name → array. A text "a.csv+b.csv"
names two files."""
SEPARATOR = "+"
"""Separator of a log's files in one text."""


def describe(
    model: str | Path,
    log: Log,
    *,
    columns: Mapping[str, str] | None = None,
    test: str = "",
    out: str | Path | None = None,
) -> Described:
    """Describe a machine from its model and a log.

    The columns of the log are matched with the joints of the model by name, and their units and
    signs are checked by inverse dynamics.

    Parameters
    ----------
    model
        File of the mechanics, MJCF or URDF.
    log
        CSV, JSON, MATLAB or parquet file, or several whose columns are joined row by row; or a
        pandas DataFrame or a dictionary of name → array.
    columns
        Statements about the log that override its reading. "elbow.position" → a column with or
        without sign and unit ("-q2 [deg]"), a formula of columns, or "none"; ``"*.position"`` → a
        unit ("[deg]"); "time" → a column with its unit, or the period in s.
    test
        Kind of the test: "inverse dynamics", "position commands", "servos" or "force commands".
        Defaults to the kind that the columns imply.
    out
        Folder in which the description and the map are written, TOML. Defaults to none.

    Returns
    -------
    Described
        `machine`, the described machine; `assumptions`, statements that the log does not make;
        `record(log)`, a log as a recording; `records(log)`, each test of a log. `str()` returns the
        table of the columns and their meaning.

    Raises
    ------
    RigtwinError
        If the log can be read in two ways; the message is the question to answer by `columns` or
        `test`. Also if the model or a column cannot be read.

    Examples
    --------
    >>> described = rigtwin.describe("arm.xml", "log.csv")  # doctest: +SKIP
    >>> columns = {"elbow.position": "q2 [deg]"}
    >>> described = rigtwin.describe("arm.xml", "log.csv", columns=columns)  # doctest: +SKIP
    """
    if is_robot(model):
        model = find_robot(str(model))
    if Path(model).suffix.lower() not in MODELS:
        raise RigtwinError(f"model {model}: expected a name that ends in {', '.join(MODELS)}")
    described = describe_log(Path(model), log_source(log), columns or {}, test)
    if out is not None:
        described.write(out)
    return described


def is_model(machine: object) -> bool:
    """Return whether a machine is stated by its model, without a description.

    Parameters
    ----------
    machine
        Value of an argument `machine`.
    """
    if is_robot(machine):
        return True
    return isinstance(machine, str | Path) and Path(machine).suffix.lower() in MODELS


def needs_description(machine: object, logs: Sequence[Log | reader.RecordedTest]) -> bool:
    """Return whether logs have to be read by a model, since they are no recordings.

    Parameters
    ----------
    machine
        Value of an argument `machine`.
    logs
        Logs or recordings.
    """
    return is_model(machine) and not (logs and all(_is_recording(log) for log in logs))


def _is_recording(log: Log | reader.RecordedTest) -> bool:
    """Return whether a log was recorded by rigtwin."""
    if isinstance(log, reader.RecordedTest):
        return True
    # Only an MCAP file can be a recording; ROS 2 bags have that ending as well.
    if not isinstance(log, str | Path) or Path(log).suffix.lower() != ".mcap":
        return False
    try:
        return bool(reader.load(Path(log)).machine)
    except RigtwinError:
        return False


def log_source(log: Log | reader.RecordedTest) -> LogSource:
    """Return where a log comes from.

    Parameters
    ----------
    log
        A file, several files, or several in one text: "a.csv+b.csv"; or a table in memory.

    Raises
    ------
    RigtwinError
        For a recording, which needs no description, and for a list of anything but files.
    """
    if isinstance(log, reader.RecordedTest):
        raise RigtwinError(
            f"{log.path}: it is a recording already; expected a log beside a model, or a "
            "description of its machine"
        )
    if isinstance(log, list | tuple):
        for file in log:
            if not isinstance(file, str | Path):
                raise RigtwinError(f"a log of several files: {type(file).__name__} is no path")
        return LogSource(tuple(Path(file) for file in log))
    if not isinstance(log, str | Path):
        return LogSource.of_table(log)
    path = Path(log)
    # A file whose own name holds the separator comes first.
    if SEPARATOR in str(log) and not path.exists():
        parts = tuple(Path(file) for file in str(log).split(SEPARATOR))
        if all(part.is_file() for part in parts):
            return LogSource(parts)
    return LogSource((path,))


def record_logs(described: Described, logs: Sequence[Log | reader.RecordedTest]) -> list[Recording]:
    """Return all tests of logs as recordings of a described machine.

    Parameters
    ----------
    described
        Machine with the map of its log.
    logs
        Logs with the same columns.
    """
    return [test for log in logs for test in _record_log(described, log_source(log))]


def _record_log(described: Described, log: LogSource) -> list[Recording]:
    """Return all tests of one log as recordings."""
    return [
        replace(with_machine(test, described.machine), origin=Origin(described, log, number))
        for number, test in enumerate(described.records(log))
    ]


def record_again(described: Described, origins: Sequence[Origin]) -> list[Recording]:
    """Return the same tests of logs as recordings of a machine that is described otherwise.

    Parameters
    ----------
    described
        Machine with the map of its log.
    origins
        Logs of the tests.

    Raises
    ------
    RigtwinError
        If a log lacks a column.
    """
    tests = {log: _record_log(described, log) for log in {origin.log: None for origin in origins}}
    return [tests[origin.log][origin.test] for origin in origins]
