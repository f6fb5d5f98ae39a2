"""Records of an MCAP file, as far as they are intact.

Damage costs the chunk it hits, but not what follows. Metadata carry a checksum of themselves.
"""

from __future__ import annotations

import io
import mmap
import os
import struct
from collections.abc import Iterator
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
"""Errors of the mcap package for a file that ends or is corrupt in the middle."""
_COMPRESSION = b"\x04\x00\x00\x00zstd"
"""Name of the compression as it stands in a chunk."""
_PLACE = 37
"""Offset of that name from the chunk's beginning: opcode, lengths, times and checksum."""
CHUNK_HEAD = _PLACE + len(_COMPRESSION)
"""Bytes by which the beginning of a chunk is known."""
FEW = 8
"""Number of repetitions of a channel pattern below which vectorised reading does not pay."""
_KNOWN, PRIVATE = frozenset(int(opcode) for opcode in Opcode), 0x80
"""Kinds of record of the format, and the first of those that programs may define."""
_PREFIX = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
"""Layouts of a record's opcode and length, and of a message's channel, number and two times."""


@dataclass(frozen=True)
class Messages:
    """Consecutive messages of one channel, with their times in ns and their contents."""

    channel_id: int
    times: list[int]
    data: list[bytes]


@dataclass(frozen=True)
class Lost:
    """Part of a file that cannot be read. A lost chunk has the times of its messages, in s."""

    first: float | None = None
    last: float | None = None


class _Reader(StreamReader):
    """Reader that skips message indexes.

    They locate single messages, which is not needed here, and the mcap package parses them number
    by number, which takes longer than everything else.
    """

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        # Read, not skipped: the bytes count towards the checksum of the data section.
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
    """Yield everything that can be read of a file in order, with chunks taken apart.

    Parameters
    ----------
    file
        Seekable file at its beginning.

    Yields
    ------
    McapRecord, Messages or Lost
        Records, and marks where records are missing. A record may come twice near a damage.

    Raises
    ------
    InvalidMagic, struct.error
        If the file does not begin as an MCAP file.
    """
    # A corrupt length must not make the reader allocate more than the file holds.
    size = os.fstat(file.fileno()).st_size
    # mcap checks the data section's checksum here. It cannot after a resumption, which skips the
    # beginning. Every chunk also has its own checksum.
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
                # After damage the search for a chunk starts behind the last one that was read.
                known = file.tell()
                yield from parts
            return
        # Reading continues at the next chunk, since chunks are self-contained.
        except DAMAGE as error:
            # The first record fails: this is no MCAP file, rather than a damaged one.
            if not begun and isinstance(error, InvalidMagic | struct.error):
                raise
            # A start behind the last resumption guarantees progress if the same chunk fails
            # again.
            yield Lost()
            chunk = _find_chunk(file, max(known, resumed + 1))
            if chunk is None:
                return
            resumed = chunk
            file.seek(chunk)
            reader = _Reader(file, skip_magic=True, emit_chunks=True, record_size_limit=size)


def take_apart(chunk: Chunk) -> list[McapRecord | Messages]:
    """Return the records in a chunk.

    The mcap package's `breakup_chunk` reads messages field by field. Here the messages that repeat
    a pattern of channels and sizes, which are nearly all, are read at once, channel by channel.

    Parameters
    ----------
    chunk
        Chunk, compressed as in the file.

    Raises
    ------
    McapError, CRCValidationError and what decompressors raise
        If the chunk is damaged.
    """
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(length)
    records: list[McapRecord | Messages] = []
    at = 0
    seen: dict[int, int] = {}
    passed, wait = 0, 0
    while at < length:
        # Every record starts with its opcode and length, so unknown kinds can be skipped.
        opcode, size = _PREFIX.unpack_from(data, at)
        begin = at + _PREFIX.size
        at = begin + size
        if at > length:
            # The length reaches beyond the chunk, which CRC checks let pass only if the writer
            # was wrong.
            raise EndOfFile()
        if opcode == Opcode.MESSAGE:
            channel, number, logged, published = _MESSAGE.unpack_from(data, begin)
            first = begin - _PREFIX.size
            if channel in seen:
                # The channel comes again: the pattern is complete, and may repeat from here on.
                # Bytes from one message of the channel to its next: one turn of all channels
                # between them.
                stride = first - seen[channel]
                seen.clear()
                passed += 1
                if passed > wait:
                    if turns := _take_turns(data, first, stride):
                        passed, wait = 0, 0
                        records += turns
                        at = first + len(turns[0].times) * sum(map(_length, turns))
                        continue
                    # JSON messages vary in length, so patterns are rare: the search backs off
                    # exponentially.
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
    """Return the number of bytes of one message in the file."""
    return _PREFIX.size + _MESSAGE.size + len(messages.data[0])


def _take_turns(data: bytes, first: int, stride: int) -> list[Messages]:
    """Return messages whose channels and sizes repeat every `stride` bytes from `first` on.

    The result is empty if the pattern repeats fewer than FEW times.
    """
    count = (len(data) - first) // stride
    if count < FEW:
        return []
    # One row per repetition, seen as bytes without a copy.
    table = np.frombuffer(data, np.uint8, count * stride, first).reshape(count, stride)
    places: list[tuple[int, int, int]] = []
    # Rows behind the first irregular one are left to the caller, even if they are regular again.
    regular = np.ones(count, dtype=bool)
    at = 0
    while at < stride:
        # The turn must end exactly with a message; anything else is no pattern.
        if at + _PREFIX.size + _MESSAGE.size > stride:
            return []
        opcode, size = _PREFIX.unpack_from(data, first + at)
        if opcode != Opcode.MESSAGE or not _MESSAGE.size <= size <= stride - at - _PREFIX.size:
            return []
        channel = _MESSAGE.unpack_from(data, first + at + _PREFIX.size)[0]
        # Opcode, length and channel are contiguous, so one comparison checks all three.
        head = table[:, at : at + _PREFIX.size + 2]
        # A quick look at the first rows refuses most false patterns before all rows are compared.
        if not (head[:FEW] == head[0]).all():
            return []
        regular &= (head == head[0]).all(axis=1)
        places.append((channel, at + _PREFIX.size, size))
        at += _PREFIX.size + size
    count = int(np.argmin(regular)) if not regular.all() else count
    messages = []
    for channel, begin, size in places:
        # Offset 6: channel (2 bytes) and sequence number (4) stand before the 8 bytes of log
        # time.
        logged = np.ascontiguousarray(table[:count, begin + 6 : begin + 14]).view("<u8")
        content = table[:count, begin + _MESSAGE.size : begin + size].tobytes()
        width = size - _MESSAGE.size
        # A width of 0 is valid in protobuf: a message with no fields. `range` needs a step above
        # 0.
        parts = [content[part : part + width] for part in range(0, count * width, width or 1)]
        messages.append(Messages(channel, logged[:, 0].tolist(), parts or [b""] * count))
    return messages


def _find_chunk(file: BinaryIO, start: int) -> int | None:
    """Return the offset of the next compressed chunk; None if there is none."""
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
    # The text may also occur in data; a chunk has its opcode at the right distance.
    while at >= 0 and data[at - _PLACE] != Opcode.CHUNK:
        at = data.find(_COMPRESSION, at + 1)
    return at - _PLACE if at >= 0 else None
