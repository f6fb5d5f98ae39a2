"""A machine that is described from its model and a log, and the recordings that this makes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigtwin.describing.clock import find_clock
from rigtwin.describing.episodes import episode_column, longest_test
from rigtwin.describing.match import ASSUMED
from rigtwin.describing.reading import Reading, read_log
from rigtwin.describing.writer import table_rows, write_description, write_map
from rigtwin.description.bare import model_name, name_machine
from rigtwin.description.document import examine_text
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, forbid_overwriting
from rigtwin.importing.channels import Imported
from rigtwin.importing.columns import Columns
from rigtwin.importing.convert import read_columns, read_tests
from rigtwin.importing.log_source import LogSource
from rigtwin.importing.map_file import parse
from rigtwin.importing.mapping import Map
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

MAP = "map.toml"
"""Name of the map's file beside a description."""


@dataclass(frozen=True)
class Described:
    """Machine described from its model and a log.

    Parameters
    ----------
    machine
        The machine; its components follow from the model and the kind of the test.
    reading
        Conclusions from the log.
    log
        Source of the log, files or a table in memory.
    description
        The description, TOML.
    mapping
        The map of the log, TOML.
    rows
        Table of what was taken for what, its head first.
    stated
        Statements of the log's owner that the description follows.
    test
        Kind of the test as the owner states it; empty where it was concluded.
    """

    machine: Machine
    reading: Reading
    log: LogSource
    description: str = field(repr=False)
    mapping: str = field(repr=False)
    rows: tuple[Sequence[str], ...] = field(repr=False)
    stated: Mapping[str, str] = field(default_factory=dict, repr=False)
    test: str = ""

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Everything that neither the log nor its owner states, one a sentence."""
        clock, lines = self.reading.clock, []
        if clock.assumed:
            lines.append(f"time from {clock.column}: {clock.why}")
        if clock.resample is not None:
            lines.append(f"rows are uneven in time; resampled to {clock.resample:g} s")
        lines.append(f"test of {self.reading.kind.test}: {self.reading.kind.why}")
        for signal in self.reading.signals:
            # A match by name is no assumption.
            reasons = (signal.why,) if signal.why in ASSUMED else ()
            if remarks := (*reasons, *signal.assumed):
                lines.append(f"{signal.key} from {signal.source}: {'; '.join(remarks)}")
        return (*lines, *self.reading.notes)

    def record(self, log: LogSource | Sequence[Path] = ()) -> RecordedTest:
        """Return a log of one test as a recording of the machine.

        Parameters
        ----------
        log
            Another log with the same columns, or its files, which are joined. Defaults to the log
            that the machine was described from.

        Raises
        ------
        RigtwinError
            If the log lacks a column, holds no numbers where they are needed, or holds several
            tests.
        """
        first, *others = self.records(log)
        if others:
            label = self._source(log).label
            raise RigtwinError(f"{label}: it holds {1 + len(others)} tests; expected one")
        return first

    def _source(self, log: LogSource | Sequence[Path]) -> LogSource:
        if isinstance(log, LogSource):
            return log
        return LogSource(tuple(log)) if log else self.log

    def records(self, log: LogSource | Sequence[Path] = ()) -> tuple[RecordedTest, ...]:
        """Return the tests of a log as recordings of the machine.

        Parameters
        ----------
        log
            As for `record`.

        Raises
        ------
        RigtwinError
            If the log lacks a column, or holds no numbers where they are needed.
        """
        source = self._source(log)
        wanted, notes = parse(self.mapping, "map"), self.assumptions
        if source != self.log:
            wanted, notes = self._adapt(wanted, source)
        return tuple(
            self._recording(source, number, imported, notes)
            for number, imported in read_tests(source.content, wanted).items()
        )

    def _recording(
        self, source: LogSource, number: int | None, imported: Imported, notes: tuple[str, ...]
    ) -> RecordedTest:
        """A test of a log; number: that of its episode, None for a log of one test."""
        columns: dict[str, dict[str, Array]] = {}
        for (topic, name), values in imported.channels.items():
            columns.setdefault(topic, {})[name] = values
        suffix = "" if number is None else f" episode {number}"
        return RecordedTest(
            path=Path(f"{source.path}{suffix}"),
            machine=self.machine.name,
            experiment=source.title + suffix,
            period=imported.period,
            # Recordings begin at 0 s, and an uneven log was resampled to this grid.
            time=np.arange(len(imported.time)) * imported.period,
            columns=columns,
            controller={},
            notes=notes,
        )

    def _adapt(self, wanted: Map, log: LogSource) -> tuple[Map, tuple[str, ...]]:
        """The map for another log, and a note if its rows are uneven in time.

        That log may be even or uneven in time, and hold one test or several.
        """
        columns, clock = read_columns(log.content), self.reading.clock
        wanted = replace(wanted, episode=episode_column(columns) or None)
        if not clock.column:
            return wanted, ()
        second = find_clock(longest_test(columns), f"{clock.column} [{clock.unit}]")
        note = f"rows are uneven in time; resampled to {second.resample or 0.0:g} s"
        return replace(wanted, resample=second.resample), (note,) if second.resample else ()

    def write(self, folder: str | Path) -> tuple[Path, Path]:
        """Write the description and the map, files to be edited.

        Parameters
        ----------
        folder
            Folder of the files NAME.toml and map.toml; made if it does not exist.

        Returns
        -------
        Path, Path
            The description and the map.

        Raises
        ------
        RigtwinError
            If a file cannot be written, or exists.
        """
        place = Path(folder)
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RigtwinError(f"cannot write {place}: {error.strerror}") from None
        paths = place / f"{self.machine.name}.toml", place / MAP
        for path in paths:
            if path.exists():
                raise RigtwinError(f"{path} exists; choose another folder, or remove it first")
            forbid_overwriting(path, self.machine.model, *self.log.files)
        model = os.path.relpath(self.machine.model, place)
        # The description was written for a model beside it. In another folder, its path is
        # relative.
        first = f"model = {_quote(self.machine.model.name)}"
        text = self.description.replace(first, f"model = {_quote(Path(model).as_posix())}", 1)
        atomic_write(paths[0], text)
        atomic_write(paths[1], self.mapping)
        return paths

    def __str__(self) -> str:
        """The table of what was taken for what, and the assumptions about the test."""
        kind = self.reading.kind
        widths = [max(len(row[at]) for row in self.rows) for at in range(len(self.rows[0]))]
        lines = [f"{self.machine.name}, {kind.test}: {kind.why}"]
        lines += [
            "  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()
            for row in self.rows
        ]
        notes = (
            []
            if self.reading.clock.resample is None
            else [f"rows are uneven in time; resampled to {self.reading.clock.resample:g} s"]
        )
        lines += [f"  note: {note}" for note in (*notes, *self.reading.notes)]
        lines += [f"  not taken into account: {line}" for line in self.machine.overlooked]
        return "\n".join(lines)


def _quote(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def describe_log(
    model: Path, log: LogSource, stated: Mapping[str, str], test: str = ""
) -> Described:
    """Describe a machine from its model and a log.

    Parameters
    ----------
    model
        MJCF or URDF.
    log
        Source of the log, files or a table in memory.
    stated
        Statements of the log's owner: "elbow.position" → "q2 [deg]", "time" → "t [ms]".
    test
        Kind of the test; empty to conclude it.

    Raises
    ------
    Question
        If two readings are possible, or something is missing.
    RigtwinError
        If the model or the log cannot be read.
    """
    mechanism = Mechanism(model)
    columns = read_columns(log.content)
    episode = episode_column(columns)
    said = log.label
    try:
        # One test, as its time rises and its motion is continuous.
        sample = longest_test(columns)
        reading = read_log(mechanism, sample, stated, test)
    except RigtwinError as error:
        # A Question stays one: callers tell it from other errors by its type.
        raise type(error)(f"{said}: {error}") from None
    if episode:
        reading = _with_tests(reading, columns, episode)
    name = name_machine(model_name(mechanism), model.stem)
    description = write_description(mechanism, reading, name, model.name, said)
    mapping = write_map(mechanism, sample, reading, name, said, episode)
    machine, mistakes = examine_text(description, model)
    if machine is None:
        raise RigtwinError(f"{model}: {mistakes[0]}")
    return Described(
        machine=machine,
        reading=reading,
        log=log,
        description=description,
        mapping=mapping,
        rows=tuple(table_rows(mechanism, reading)),
        stated=dict(stated),
        test=test,
    )


def _with_tests(reading: Reading, columns: Columns, episode: str) -> Reading:
    """The conclusions from the longest test of a log, with a note of all tests."""
    count = len(np.unique(columns.values[episode]))
    note = (
        f"{count} tests, numbered by column {episode}; the longest one decided on units and signs"
    )
    unused = {name: why for name, why in reading.unused.items() if name != episode}
    return replace(reading, unused=unused, notes=(*reading.notes, note))
