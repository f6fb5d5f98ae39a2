"""Writer of recordings, block by block. A block is on its way to the disk when `append` returns.

The mcap package's own writer takes one message at a time, which costs half as much as simulating
the test. Here numpy lays out a whole block of messages. All other records are encoded by the mcap
package.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from machines import DEFAULT_MACHINE
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording.channels import topic_fields
from rigtwin.recording.checksum import seal
from rigtwin.recording.description_path import description_values
from rigtwin.recording.owner import open_alone
from rigtwin.recording.schema import (
    END_RECORD,
    RECORD,
    TWIN_RECORD,
    WRITTEN_FORMAT,
    check_names,
    descriptor,
    encode_rows,
    type_name,
)

_MESSAGE = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
_RESERVE, _RESERVED = "rigtwin.reserve", 4096
"""Name of the metadata record that reserves space, and its size in bytes."""
_PREFIX = 9
"""Number of bytes of a record's opcode and length."""


def _encode(record: McapRecord) -> bytes:
    """Return a record as bytes."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def twin_values(
    seed: int,
    parameters: Mapping[str, object],
    effects: Sequence[str],
    version: str,
    effects_from: float = 0.0,
) -> dict[str, str]:
    """Return the metadata TWIN_RECORD, from which a twin's recording can be repeated."""
    return {
        "seed": str(seed),
        "parameters": json.dumps(parameters),
        "effects": json.dumps(effects),
        "version": version,
        **({"effects_from": repr(effects_from)} if effects_from else {}),
    }


class Writer:
    """Recording that is being written.

    Use the writer as a context manager: leaving it finishes the file, also after an exception. A
    process that dies without leaving it (kill -9, power failure) loses at most the block it was
    about to append.
    """

    def __init__(
        self,
        path: Path,
        experiment: str,
        period: float,
        controller: Mapping[str, object],
        machine: str = DEFAULT_MACHINE,
        fields: Mapping[str, Sequence[str]] | None = None,
        description: Path | None = None,
    ) -> None:
        """Create the file.

        Parameters
        ----------
        path
            Path of the file, which is replaced if it exists.
        experiment
            Name of the experiment.
        period
            Period of a tick, in s.
        controller
            The operator's settings, as `config.controller` stores them.
        machine
            Name of the machine.
        fields
            Topic → field names. Defaults to those of the channel table.
        description
            Description of the machine, remembered in the file; None for a shipped one.


        Raises
        ------
        RigtwinError
            If a field cannot have its name, or the file cannot be written.
        """
        self._fields = dict(fields or {})
        for topic, names in self._fields.items():
            check_names(topic, names)
        try:
            self._file: BinaryIO = open_alone(path)
        except OSError as error:
            raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
        self._path = path
        self._ticks = self._next = 0
        self._counts: dict[str, int] = {}
        self._full = False
        self._room: tuple[int, int] | None = None
        self._nanoseconds = period * 1e9
        self._offset = 0
        self._topics: dict[str, int] = {}
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        # MCAP: magic bytes, header, data section, summary section, footer, magic bytes.
        self._put_head(experiment, period, controller, machine, description)

    def _put_head(
        self,
        experiment: str,
        period: float,
        controller: Mapping[str, object],
        machine: str,
        description: Path | None,
    ) -> None:
        """Write what stands before the first tick: the format, and what the test is."""
        self._put(MCAP0_MAGIC + _encode(Header(profile="", library="rigtwin")))
        # The controller's settings are what its operator knows; hidden effects are not stored here.
        config = json.dumps({"controller": controller})
        self.add_metadata(
            RECORD,
            {
                "format": WRITTEN_FORMAT,
                "machine": machine,
                "experiment": experiment,
                "period": repr(period),
                "config": config,
                **description_values(self._path, description),
            },
        )

    def add_twin(
        self,
        seed: int,
        parameters: Mapping[str, object],
        effects: tuple[str, ...],
        version: str,
        effects_from: float = 0.0,
    ) -> None:
        """Add the metadata of a twin, from which the recording can be repeated."""
        values = twin_values(seed, parameters, effects, version, effects_from)
        self.add_metadata(TWIN_RECORD, values)

    def reserve(self) -> None:
        """Reserve space in the file for the last records on a full disk.

        Metadata that fit are then written there.
        """
        place = self._offset
        # An ordinary metadata record, so that every MCAP reader passes over it.
        self.add_metadata(_RESERVE, {"": " " * _RESERVED})
        self._room = (place, self._offset)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record now."""
        record = _encode(Metadata(name=name, metadata=seal(values)))
        if self._full:
            # Not in the metadata index, which a full disk cannot hold anyway.
            self._put_into_room(record)
            return
        self._metadata.append(MetadataIndex(offset=self._offset, length=len(record), name=name))
        self._put(record)

    def append(self, **topics: Array | None) -> None:
        """Add consecutive ticks.

        Parameters
        ----------
        topics
            Topic name without its slash → values, shape (ticks, fields); None is left out.
        """
        ticks = next((len(values) for values in topics.values() if values is not None), 0)
        self.append_at(np.arange(self._next, self._next + ticks), topics)

    def append_at(self, sequence: NDArray[np.int64], topics: Mapping[str, Array | None]) -> None:
        """Add ticks with ascending numbers, shape (ticks,); see `append` for the values."""
        columns = {f"/{name}": values for name, values in topics.items() if values is not None}
        for topic in columns:
            if topic not in self._topics:
                self._register(topic)
        ticks = len(sequence)
        if ticks == 0:
            return
        # Numbers may leave gaps where ticks were missed.
        self._next = int(sequence[-1]) + 1
        self._ticks += ticks
        self._put_messages(
            columns, np.round(sequence * self._nanoseconds).astype(np.uint64), sequence
        )

    def append_beside(self, topic: str, values: Array, times: Array) -> None:
        """Add messages to a topic that has its own times, such as a session's before its test.

        Parameters
        ----------
        topic
            Name of the topic.
        values
            Values, shape (messages, fields).
        times
            Ascending times since the start of the test in s, shape (messages,). Earlier times are
            stored as the start, because times in a file are unsigned.
        """
        if topic not in self._topics:
            self._register(topic)
        if len(values):
            # MCAP times are unsigned, so messages before the test's start have time 0; the true
            # time is in their first field.
            stamps = np.round(np.maximum(times, 0.0) * 1e9).astype(np.uint64)
            self._put_messages(
                {topic: values}, stamps, np.arange(len(values)) + self._counts.get(topic, 0)
            )

    def _put_messages(
        self, columns: Mapping[str, Array], times: NDArray[np.uint64], sequence: NDArray[np.int64]
    ) -> None:
        # One structured array is the chunk's content byte for byte: the messages of a tick, topic
        # by topic, then those of the next tick.
        ticks = len(times)
        for topic in columns:
            self._counts[topic] = self._counts.get(topic, 0) + ticks
        # All messages of a topic have one length, so each topic is one rectangular array.
        encoded = {topic: encode_rows(values) for topic, values in columns.items()}
        layout = np.dtype(
            [
                (topic, [*_MESSAGE, ("fields", "u1", (rows.shape[1],))])
                for topic, rows in encoded.items()
            ]
        )
        # A dtype made of a list has no padding, so the array's bytes are the records themselves.
        messages = np.zeros(ticks, layout)
        for topic, rows in encoded.items():
            message = messages[topic]
            message["opcode"] = Opcode.MESSAGE
            message["length"] = layout[topic].itemsize - _PREFIX
            message["channel"] = self._topics[topic]
            message["sequence"] = sequence
            message["log_time"] = message["publish_time"] = times
            message["fields"] = rows
        self._put_chunk(messages, times)

    def finish(self, reason: str) -> None:
        """Write the reason for the end and the index, and close the file. May be called twice."""
        if self._file.closed:
            return
        # On a full disk the index is given up: readers can do without it.
        if self._full:
            self.add_metadata(END_RECORD, {"reason": reason, "ticks": str(self._ticks)})
            self._file.close()
            return
        self.add_metadata(END_RECORD, {"reason": reason, "ticks": str(self._ticks)})
        # A checksum of 0 means none: each chunk has its own.
        self._put(_encode(DataEnd(data_section_crc=0)))
        # Offsets in the footer count from the file's start; the summary begins here.
        start = self._offset
        # The summary lets readers find channels and chunks without reading the whole file.
        summary = bytearray()
        offsets = bytearray()
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, [*self._schemas]),
            (Opcode.CHANNEL, [*self._channels]),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, [*self._chunks]),
            (Opcode.METADATA_INDEX, [*self._metadata]),
        ]
        for opcode, records in groups:
            encoded = b"".join(_encode(record) for record in records)
            offsets += _encode(
                SummaryOffset(
                    group_opcode=opcode, group_start=start + len(summary), group_length=len(encoded)
                )
            )
            summary += encoded
        footer = Footer(
            summary_start=start, summary_offset_start=start + len(summary), summary_crc=0
        )
        self._put(bytes(summary + offsets) + _encode(footer) + MCAP0_MAGIC)
        self._file.close()

    def _register(self, topic: str) -> None:
        """Write schema and channel of a topic, before its first message."""
        number = len(self._topics) + 1
        # The schema's number 0 means none, so numbers start at 1.
        self._topics[topic] = number
        names = self._fields.get(topic) or topic_fields(topic)
        assert names, f"no channels defined for {topic}"
        schema = Schema(
            id=number, name=type_name(topic), encoding="protobuf", data=descriptor(topic, names)
        )
        channel = Channel(
            id=number, schema_id=number, topic=topic, message_encoding="protobuf", metadata={}
        )
        self._schemas.append(schema)
        self._channels.append(channel)
        self._put(_encode(schema) + _encode(channel))

    def _put_chunk(self, messages: NDArray[np.void], times: NDArray[np.uint64]) -> None:
        """Write a chunk, and the index of each of its topics."""
        content = messages.tobytes()
        # The fastest level, because blocks are compressed while a test runs.
        packed = zstandard.ZstdCompressor(level=1).compress(content)
        start = self._offset
        chunk = _encode(
            Chunk(
                compression="zstd",
                data=packed,
                message_start_time=int(times[0]),
                message_end_time=int(times[-1]),
                uncompressed_crc=zlib.crc32(content),
                uncompressed_size=len(content),
            )
        )
        assert messages.dtype.fields is not None
        places: dict[int, int] = {}
        index = bytearray()
        for topic, (_, place, *_) in messages.dtype.fields.items():
            number = self._topics[topic]
            places[number] = start + len(chunk) + len(index)
            pairs = np.empty((len(times), 2), "<u8")
            pairs[:, 0] = times
            # A message's offset within the uncompressed chunk.
            pairs[:, 1] = place + messages.dtype.itemsize * np.arange(len(times))
            index += _message_index(number, pairs.tobytes())
        self._put(chunk + bytes(index))
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(packed),
                message_start_time=int(times[0]),
                message_end_time=int(times[-1]),
                message_index_length=len(index),
                message_index_offsets=places,
                uncompressed_size=len(content),
            )
        )

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={
                number: self._counts.get(topic, 0) for topic, number in self._topics.items()
            },
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_start_time=0,
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _put(self, data: bytes) -> None:
        """Write bytes at the end of the file. Raise RigtwinError if the disk is full."""
        try:
            # An unbuffered write may be partial without an error.
            written = self._file.write(data)
            # The kernel writes what fits before it reports a full disk in the next call.
            if written != len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self._give_up()
            raise RigtwinError(
                f"cannot write {self._path}: {error.strerror}; it holds {self._ticks} ticks"
            ) from None
        self._offset += len(data)

    def _give_up(self) -> None:
        """Stop adding records; the file is cut to its last complete one."""
        if self._room is None:
            self._file.close()
            return
        self._full = True
        # A part of a record at the end would count as damage; the space before it is reserved.
        with suppress(OSError):
            self._file.truncate(self._offset)

    def _put_into_room(self, record: bytes) -> None:
        """Overwrite the reserved space, which needs no free disk, and keep its remainder."""
        assert self._room is not None
        place, end = self._room
        # What remains must hold the head of another reserve record, so that readers find no gap.
        rest = end - place - len(record) - len(_encode(Metadata(name=_RESERVE, metadata={"": ""})))
        # The reserved space is used up; the record is lost, but the rig must still be stopped.
        if rest < 0:
            return
        filling = _encode(Metadata(name=_RESERVE, metadata={"": " " * rest}))
        with suppress(OSError):
            # The end of the file is full, but its beginning can still be overwritten.
            self._file.seek(place)
            self._file.write(record + filling)
        self._room = (place + len(record), end)

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.finish("completed" if kind is None else f"interrupted: {kind.__name__}")


def _message_index(channel: int, pairs: bytes) -> bytes:
    """Return the index of one channel's messages in a chunk: pairs of time and offset."""
    builder = RecordBuilder()
    builder.start_record(Opcode.MESSAGE_INDEX)
    builder.write2(channel)
    builder.write4(len(pairs))
    builder.write(pairs)
    builder.finish_record()
    return builder.end()
