"""Reader of recordings with JSON or protobuf messages, complete or damaged, of any author."""

from __future__ import annotations

import json
import math
import struct
from bisect import bisect_left
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mcap.exceptions import InvalidMagic
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from numpy.typing import NDArray

from machines import DEFAULT_MACHINE
from rigtwin.errors import RigtwinError
from rigtwin.files import printable
from rigtwin.numerics.arrays import Array
from rigtwin.recording.alignment import align, check_order, check_times
from rigtwin.recording.checksum import unseal
from rigtwin.recording.columns import decode_columns
from rigtwin.recording.description_path import description_of
from rigtwin.recording.recorded_test import RecordedTest, printable_values, sort_transitions
from rigtwin.recording.records import Lost, Messages, read_records
from rigtwin.recording.schema import (
    END_RECORD,
    LATENESS_RECORD,
    RECORD,
    TRANSITION_RECORD,
    TWIN_RECORD,
    WRITTEN_FORMAT,
    list_topics,
)

if TYPE_CHECKING:
    pass


def load(path: Path) -> RecordedTest:
    """Read a recording.

    Parameters
    ----------
    path : Path
        Path of an MCAP file, complete or damaged.

    Returns
    -------
    RecordedTest
        Everything that can be read.

    Raises
    ------
    RigtwinError
        If the file is no recording, is empty, or has a format this version does not read.
    """
    content = FileContent()
    try:
        with path.open("rb") as file:
            # An empty file gets a message of its own; the MCAP reader would call it damaged.
            if not file.read(1):
                raise RigtwinError(f"{path} is empty; expected an MCAP recording")
            file.seek(0)
            for record in read_records(file):
                content.add(record)
    # mcap unpacks whatever a read returns, so a file that ends early raises struct.error.
    except (InvalidMagic, struct.error):
        raise RigtwinError(f"{path} is not an MCAP file{_hint(path)}") from None
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    return content.build(path)


def _hint(path: Path) -> str:
    """Return what to do with a file that describes a machine, by the ending of its name."""
    if path.suffix.lower() not in (".xml", ".mjcf", ".urdf", ".toml"):
        return ""
    return "; the model or description of a machine is given as --machine (machine= in Python)"


class FileContent:
    """Content of a file, as far as it was read."""

    def __init__(self) -> None:
        self._metadata: dict[str, dict[str, str]] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._raw: dict[int, tuple[list[int], list[bytes]]] = {}
        self._states: list[Mapping[str, str]] = []
        self._lost: list[Lost] = []
        self._doubtful: list[str] = []

    @property
    def ended(self) -> bool:
        """Whether the file says why its test ended."""
        return END_RECORD in self._metadata

    @property
    def latest(self) -> float:
        """Time of the last tick that is present on all topics, in s; 0 without ticks."""
        last = [
            times[-1]
            for number, (times, _) in self._raw.items()
            # Damage may have taken the record that names a channel.
            if times and number in self._channels and self._channels[number].topic in list_topics()
        ]
        return 1e-9 * min(last, default=0)

    def add(self, record: McapRecord | Messages | Lost) -> None:
        """Add one record, in the order of the file."""
        if isinstance(record, Lost):
            self._lost.append(record)
        elif isinstance(record, Messages):
            times, data = self._raw.setdefault(record.channel_id, ([], []))
            # Lists grow in place: a long test has millions of messages.
            times += record.times
            data += record.data
        elif isinstance(record, Message):
            times, data = self._raw.setdefault(record.channel_id, ([], []))
            times.append(record.log_time)
            data.append(record.data)
        elif isinstance(record, Metadata):
            values, whole = unseal(record.metadata)
            if not whole:
                self._doubtful.append(record.name)
            # The last record of a name counts: a writer can add to a file, but not change it.
            self._metadata[record.name] = values
            # A full disk makes the writer repeat a transition, so duplicates are dropped.
            if record.name == TRANSITION_RECORD and values not in self._states:
                self._states.append(values)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record

    def forget(self, before: float) -> None:
        """Drop all messages before a time in s; none for minus infinity."""
        if before == -math.inf:
            return
        for times, data in self._raw.values():
            # Messages are in order of time, so a prefix is dropped.
            first = bisect_left(times, round(before * 1e9))
            del times[:first], data[:first]

    def build(self, path: Path) -> RecordedTest:
        """Return the recording.

        Parameters
        ----------
        path
            Path of the file, for messages.

        Returns
        -------
        RecordedTest
            Recording of all ticks that were added and not dropped.

        Raises
        ------
        RigtwinError
            If the content is no recording, holds no ticks, or has a format this version does not
            read.
        """
        metadata, lost, doubtful = self._metadata, self._lost, self._doubtful
        # A file without a single readable record is no damaged recording.
        if lost and not metadata and not self._channels:
            raise RigtwinError(f"{path} is not an MCAP file{_hint(path)}")
        about = metadata.get(RECORD)
        if about is None:
            raise RigtwinError(
                f"{path} is not a rig recording: it has no metadata record {RECORD!r}"
            )
        period = _period(path, about)
        # Settings with a wrong checksum would mislead a diagnosis; they are left out.
        controller = {} if RECORD in doubtful else _controller(path, about)
        notes: list[str] = []
        tables = self._tables(path, notes)
        time, columns = align(tables, notes)
        # Damage comes first among the notes.
        notes[:0] = _describe_damage(lost, doubtful, time)
        if not len(time):
            raise RigtwinError(
                f"{path}: {' and '.join(tables)} have no tick in common; "
                "expected the same times on each"
            )
        check_times(path, time, period, notes)
        return RecordedTest(
            path=path,
            machine=printable(about.get("machine", DEFAULT_MACHINE)),
            experiment=printable(about.get("experiment", "")),
            period=period,
            time=time,
            columns=columns,
            controller=controller,
            twin=printable_values(metadata.get(TWIN_RECORD, {})),
            end=printable(metadata.get(END_RECORD, {}).get("reason", "")),
            notes=tuple(notes),
            transitions=sort_transitions(self._states),
            lateness=printable_values(metadata.get(LATENESS_RECORD, {})),
            description=None if RECORD in doubtful else description_of(path, about),
        )

    def _tables(
        self, path: Path, notes: list[str]
    ) -> dict[str, tuple[NDArray[np.int64], dict[str, Array]]]:
        """Return times in ns and columns by topic, as they are in the file."""
        tables: dict[str, tuple[NDArray[np.int64], dict[str, Array]]] = {}
        for number, (times, data) in self._raw.items():
            channel = self._channels.get(number)
            if channel is None or channel.topic not in list_topics() or not times:
                continue
            if channel.topic in tables:
                raise RigtwinError(f"{path}: two channels on {channel.topic}; expected one")
            # Times are unsigned in the file; half of their range does not fit numpy's int64.
            if max(times) >= 2**63:
                raise RigtwinError(
                    f"{path}: a message on {channel.topic} has time {max(times)} ns; "
                    "expected ns since the start"
                )
            values = decode_columns(
                path, channel, self._schemas.get(channel.schema_id), data, notes
            )
            # Times stay in whole nanoseconds until topics are aligned: doubles would not compare
            # equal.
            stamps = np.array(times, np.int64)
            check_order(path, channel.topic, stamps, notes)
            tables[channel.topic] = (stamps, values)
        if not tables:
            end = self._metadata.get(END_RECORD)
            said = "" if end is None else f"; it ended: {end.get('reason', '')}"
            raise RigtwinError(f"{path} holds no ticks on {' or '.join(list_topics())}{said}")
        return tables


def _describe_damage(lost: list[Lost], doubtful: list[str], time: Array) -> list[str]:
    """Describe the parts of a file that cannot be read or trusted."""
    notes = []
    if any(part.first is None for part in lost):
        end = f"; readable up to {time[-1]:.3f} s" if len(time) else ""
        notes.append(f"damaged or cut off{end}")
    for first, last in dict.fromkeys((part.first, part.last) for part in lost):
        if first is not None and last is not None:
            notes.append(f"damaged: what was recorded from {first:.3f} to {last:.3f} s is lost")
    if RECORD in doubtful:
        notes.append(
            "damaged: what it says of the test has a wrong checksum; the controller's "
            "settings are left out"
        )
    notes += [f"damaged: {name} has a wrong checksum" for name in doubtful if name != RECORD]
    return notes


def _period(path: Path, about: Mapping[str, str]) -> float:
    """Return the recorded period in s. Raise RigtwinError if format or period is wrong."""
    # A later format may mean something else by the same names, so it is refused.
    if about.get("format") != WRITTEN_FORMAT:
        raise RigtwinError(
            f"{path}: format {about.get('format')!r}; this version reads {WRITTEN_FORMAT!r}"
        )
    try:
        period = float(about.get("period", ""))
    except ValueError:
        period = math.nan
    if not 1e-6 <= period <= 10.0:
        raise RigtwinError(f"{path}: period {about.get('period')!r}; expected 1e-6 to 10 seconds")
    return period


def _controller(path: Path, about: Mapping[str, str]) -> Mapping[str, object]:
    """Return the recorded settings of the controller."""
    try:
        # Other programs may write recordings without settings.
        config = json.loads(about.get("config", "{}"))
        controller = config.get("controller", {})
        if not isinstance(controller, dict):
            raise ValueError
    except (ValueError, AttributeError, RecursionError):
        raise RigtwinError(
            f"{path}: metadata config is not a JSON object with an object 'controller'"
        ) from None
    return {
        printable(name): printable(value) if isinstance(value, str) else value
        for name, value in controller.items()
    }
