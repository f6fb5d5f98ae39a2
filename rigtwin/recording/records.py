"""The records of an MCAP file, whatever of it is whole: damage costs the chunk that it hits and not
what comes after it; and metadata that say of themselves whether they are as written."""

from __future__ import annotations

import io
import json
import mmap
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, get_chunk_data_stream

DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zstandard.ZstdError,
    RuntimeError,
    EOFError,
    UnicodeDecodeError,
    ValueError,
    MemoryError,
)
"""What the mcap package raises on a file that ends or breaks in the middle."""
_COMPRESSION = b"\x04\x00\x00\x00zstd"
"""How a chunk names its compression, and where that stands in it."""
_PLACE = 37
CHUNK_HEAD = _PLACE + len(_COMPRESSION)
"""Bytes by which the beginning of a chunk is known."""
FEW = 8
"""Turns of the same channels below which it is not worth while to take them at once."""
_KNOWN, PRIVATE = frozenset(int(opcode) for opcode in Opcode), 0x80
"""Kinds of record of the format, and the first of those that programs may define."""
_PREFIX = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
"""Of a record: its kind and length; of a message: its channel, number and two times."""
_CHECKSUM = "crc32"
"""Key of metadata that holds the checksum of the others."""


@dataclass(frozen=True)
class Messages:
    """Some consecutive messages of one channel. times: ns; data: what each holds."""

    channel_id: int
    times: list[int]
    data: list[bytes]


@dataclass(frozen=True)
class Lost:
    """Something that cannot be read. first, last: s, of a chunk; None of anything else."""

    first: float | None = None
    last: float | None = None


class _Reader(StreamReader):
    """Without what a file has to find single messages by: nobody here looks for them, and it is
    read number by number, which takes longer than all that is looked for."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode == Opcode.MESSAGE_INDEX:
            self._stream.read(length)
            return None
        if not is_opcode(opcode):
            raise McapError(f"no record is of kind {opcode}")
        record = super()._read_record(opcode, length)
        if isinstance(record, Chunk) and length_of(record) != length:
            # What follows within the wrong length would be passed over in silence.
            raise McapError(f"chunk of {length_of(record)} bytes says {length}")
        return record


def is_opcode(number: int) -> bool:
    """Whether a byte says the kind of a record: one of the format's, or one that programs may
    define."""
    return number in _KNOWN or number >= PRIVATE


def length_of(chunk: Chunk) -> int:
    """Bytes of a chunk's record by its content: times 8 + 8, size 8, checksum 4, the name of its
    compression behind its length 4, and the data behind their length 8."""
    return 40 + len(chunk.compression) + len(chunk.data)


def read_records(file: BinaryIO) -> Iterator[McapRecord | Messages | Lost]:
    """Everything that can be read of a file, in order, chunks taken apart.

    Parameters
    ----------
    file
        Open at its beginning, and seekable.

    Yields
    ------
    McapRecord, Messages or Lost
        The records, and where some are missing. A record may come twice around a damaged place.

    Raises
    ------
    InvalidMagic, struct.error
        If it does not begin as an MCAP file does.
    """
    size = os.fstat(file.fileno()).st_size
    reader = _Reader(file, emit_chunks=True, validate_crcs=True, record_size_limit=size)
    known, resumed, begun = 0, -1, False
    while True:
        try:
            for record in reader.records:
                begun = True
                if not isinstance(record, Chunk):
                    yield record
                    continue
                try:
                    parts = take_apart(record)
                except DAMAGE:
                    yield Lost(1e-9 * record.message_start_time, 1e-9 * record.message_end_time)
                    continue
                known = file.tell()
                yield from parts
            return
        except DAMAGE as error:
            if not begun and isinstance(error, InvalidMagic | struct.error):
                raise
            yield Lost()
            found = _find_chunk(file, max(known, resumed + 1))
            if found is None:
                return
            resumed = found
            file.seek(found)
            reader = _Reader(file, skip_magic=True, emit_chunks=True, record_size_limit=size)


def take_apart(chunk: Chunk) -> list[McapRecord | Messages]:
    """The records in a chunk, as `mcap.stream_reader.breakup_chunk` has them, which reads a message
    field by field. Nearly all records are messages, and nearly all of these repeat the same few
    channels and sizes in turn: those are taken at once, a channel after the other.

    Parameters
    ----------
    chunk
        Compressed as it stands in the file.

    Raises
    ------
    McapError, CRCValidationError and what decompressors raise
        If it is damaged.
    """
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(length)
    records: list[McapRecord | Messages] = []
    at = 0
    seen: dict[int, int] = {}
    passed, wait = 0, 0
    while at < length:
        opcode, size = _PREFIX.unpack_from(data, at)
        begin = at + _PREFIX.size
        at = begin + size
        if at > length:
            raise EndOfFile()
        if opcode == Opcode.MESSAGE:
            channel, number, logged, published = _MESSAGE.unpack_from(data, begin)
            first = begin - _PREFIX.size
            if channel in seen:
                # A turn is over: as many like it as there are.
                stride = first - seen[channel]
                seen.clear()
                passed += 1
                if passed > wait:
                    if turns := _take_turns(data, first, stride):
                        passed, wait = 0, 0
                        records += turns
                        at = first + len(turns[0].times) * sum(map(_length, turns))
                        continue
                    # Numbers written out are of any length: looked for again, but ever less often.
                    passed, wait = 0, 2 * wait + 1
            seen[channel] = first
            content = data[begin + _MESSAGE.size : at]
            records.append(Message(channel, logged, content, published, number))
        elif opcode == Opcode.SCHEMA:
            records.append(Schema.read(ReadDataStream(io.BytesIO(data[begin:at]))))
        elif opcode == Opcode.CHANNEL:
            records.append(Channel.read(ReadDataStream(io.BytesIO(data[begin:at]))))
    return records


def _length(messages: Messages) -> int:
    """Bytes of one of them in the file."""
    return _PREFIX.size + _MESSAGE.size + len(messages.data[0])


def _take_turns(data: bytes, first: int, stride: int) -> list[Messages]:
    """Messages whose channels and sizes repeat every `stride` bytes from `first` on; none if they
    do not do so at least FEW times."""
    count = (len(data) - first) // stride
    if count < FEW:
        return []
    table = np.frombuffer(data, np.uint8, count * stride, first).reshape(count, stride)
    places: list[tuple[int, int, int]] = []
    alike = np.ones(count, dtype=bool)
    at = 0
    while at < stride:
        if at + _PREFIX.size + _MESSAGE.size > stride:
            return []
        opcode, size = _PREFIX.unpack_from(data, first + at)
        if opcode != Opcode.MESSAGE or not _MESSAGE.size <= size <= stride - at - _PREFIX.size:
            return []
        channel = _MESSAGE.unpack_from(data, first + at + _PREFIX.size)[0]
        # Opcode, length and channel stand in a row.
        head = table[:, at : at + _PREFIX.size + 2]
        if not (head[:FEW] == head[0]).all():
            return []
        alike &= (head == head[0]).all(axis=1)
        places.append((channel, at + _PREFIX.size, size))
        at += _PREFIX.size + size
    count = int(np.argmin(alike)) if not alike.all() else count
    found = []
    for channel, begin, size in places:
        logged = np.ascontiguousarray(table[:count, begin + 6 : begin + 14]).view("<u8")
        content = table[:count, begin + _MESSAGE.size : begin + size].tobytes()
        each = size - _MESSAGE.size
        parts = [content[part : part + each] for part in range(0, count * each, each or 1)]
        found.append(Messages(channel, logged[:, 0].tolist(), parts or [b""] * count))
    return found


def _find_chunk(file: BinaryIO, start: int) -> int | None:
    """Where the next compressed chunk begins; None if there is none."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return find_chunk(data, start)


def find_chunk(data: bytearray | mmap.mmap, start: int) -> int | None:
    """Find the beginning of a compressed chunk.

    Parameters
    ----------
    data
        Bytes of an MCAP file.
    start
        Place from which chunks are looked for.

    Returns
    -------
    int or None
        Place of its first byte; None if no chunk begins at or behind `start`.
    """
    at = data.find(_COMPRESSION, start + _PLACE)
    while at >= 0 and data[at - _PLACE] != Opcode.CHUNK:
        at = data.find(_COMPRESSION, at + 1)
    return at - _PLACE if at >= 0 else None


def seal(values: Mapping[str, str]) -> dict[str, str]:
    """Metadata with a checksum of themselves."""
    return {**values, _CHECKSUM: _checksum(values)}


def unseal(values: Mapping[str, str]) -> tuple[dict[str, str], bool]:
    """Metadata without their checksum, and whether they are as they were written, as far as that
    was said."""
    bare = {name: value for name, value in values.items() if name != _CHECKSUM}
    return bare, values.get(_CHECKSUM, _checksum(bare)) == _checksum(bare)


def _checksum(values: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(values, sort_keys=True).encode()):08x}"
