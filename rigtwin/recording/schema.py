"""Protobuf message types of the topics, derived from the channel table.

All fields are doubles. Every message of a topic therefore has the same length, and whole blocks are
encoded and decoded at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from google.protobuf import descriptor_pb2
from numpy.typing import NDArray

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording.channels import CHANNELS

WRITTEN_FORMAT = "1"
"""Format number in the metadata of the recordings that this version reads and writes."""
RECORD = "rigtwin"
"""Name of the metadata record that describes the test."""
TWIN_RECORD = "rigtwin.twin"
"""Name of the metadata record that describes how a twin made the recording."""
END_RECORD = "rigtwin.end"
"""Name of the metadata record with the reason for the end of the test."""
TRANSITION_RECORD = "rigtwin.transition"
"""Name of the metadata records with time and cause of a session's transitions, one for each."""
CARD_RECORD = "rigtwin.card"
"""Name of the metadata record with the channel table."""
LATENESS_RECORD = "rigtwin.lateness"
"""Name of the metadata record with the lateness of a loop in real time."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
"""Pattern of a field's name in protobuf."""
_DOUBLE_WIRE_TYPE = 1


def type_name(topic: str) -> str:
    """Return the full name of a topic's message type, such as `rigtwin.Command`."""
    # Protobuf's style: message types begin with a capital, fields are in lower case.
    return "rigtwin." + topic.strip("/").capitalize()


def check_names(topic: str, names: Sequence[str]) -> None:
    """Raise RigtwinError for field names that a topic cannot have.

    A recording with such names could be written, but not read.
    """
    for name in names:
        if not NAME.fullmatch(name):
            raise RigtwinError(
                f"{topic}.{name}: expected a name of letters without accents, digits and _"
            )
    # Field names that differ in capitals and underscores alone collide there.
    # protobuf's JSON mapping distinguishes fields by their names in camel case.
    seen: dict[str, str] = {}
    for name in names:
        camel = re.sub(r"_(.?)", lambda match: match.group(1).upper(), name)
        if camel in seen:
            raise RigtwinError(f"{topic} cannot have both {seen[camel]} and {name}; rename one")
        seen[camel] = name


def descriptor(topic: str, names: Sequence[str]) -> bytes:
    """Return a topic's message type in the form of an MCAP schema.

    Parameters
    ----------
    topic : str
        Name of the topic, with the slash.
    names : sequence of str
        Names of the fields, all of them doubles.

    Returns
    -------
    bytes
        Serialised FileDescriptorSet.
    """
    file = descriptor_pb2.FileDescriptorProto(
        name=f"rigtwin/{topic.strip('/')}.proto", package="rigtwin", syntax="proto3"
    )
    message = file.message_type.add(name=type_name(topic).partition(".")[2])
    for number, name in enumerate(names, start=1):
        # proto3 omits fields at their default; fixed layouts are possible because every field is
        # written explicitly.
        message.field.add(
            name=name,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


Bytes = NDArray[np.uint8]


def _segments(count: int) -> Iterator[tuple[slice, np.dtype[np.void], Bytes]]:
    """Yield fields 1 … count in groups whose tags have equal length.

    A group is the slice of its fields, the layout of one field, and the tags, shape (fields,
    length). A tag is a varint: seven bits per byte, the lowest first, and the highest bit set in
    all bytes but the last.
    """
    first, length = 1, 1
    while first <= count:
        # A tag of `length` bytes has 7·length bits, of which three are the wire type.
        last = min(count, (1 << (7 * length - 3)) - 1)
        # Tag = field number · 8 + wire type; wire type 1 is a 64-bit number in little-endian
        # order.
        numbers = (np.arange(first, last + 1) << 3) | _DOUBLE_WIRE_TYPE
        parts = numbers[:, None] >> (7 * np.arange(length)) & 0x7F
        parts[:, :-1] |= 0x80
        layout = np.dtype([("tag", "u1", (length,)), ("value", "<f8")])
        yield slice(first - 1, last), layout, parts.astype(np.uint8)
        first, length = last + 1, length + 1


def encode_rows(values: Array) -> Bytes:
    """Encode messages of doubles in protobuf's wire format.

    Parameters
    ----------
    values
        Fields 1, 2, … of each message, shape (messages, fields).

    Returns
    -------
    array
        One message per row, shape (messages, bytes).
    """
    parts = [np.empty((len(values), 0), np.uint8)]
    for fields, layout, tags in _segments(values.shape[1]):
        part = np.empty((len(values), len(tags)), layout)
        # Broadcasting repeats the constant tags in every message.
        part["tag"], part["value"] = tags, values[:, fields]
        parts.append(part.view(np.uint8).reshape(len(values), -1))
    return np.hstack(parts)


def decode_rows(block: bytes, messages: int, count: int) -> Array | None:
    """Decode messages encoded by `encode_rows`.

    Parameters
    ----------
    block
        All messages, one after another.
    messages, count
        Number of messages, and number of fields in each.

    Returns
    -------
    array or None
        Values, shape (messages, fields); None if the messages have another encoding.
    """
    segments = list(_segments(count))
    width = sum(len(tags) * layout.itemsize for _, layout, tags in segments)
    # Fields at their default that another writer omitted also make a block shorter.
    if len(block) != messages * width:
        return _decode_wrapped(block, messages, count)
    rows = np.frombuffer(block, np.uint8).reshape(messages, width)
    values, begin = np.empty((messages, count)), 0
    for fields, layout, tags in segments:
        end = begin + len(tags) * layout.itemsize
        part = np.ascontiguousarray(rows[:, begin:end]).view(layout)
        if not (part["tag"] == tags).all():
            return None
        values[:, fields], begin = part["value"], end
    return values


def _decode_wrapped(block: bytes, messages: int, count: int) -> Array | None:
    """Decode messages of 16 or more fields as earlier releases wrote them.

    Those releases truncated tags to one byte, which no other reader understands.
    """
    layout = np.dtype([("tag", "u1"), ("value", "<f8")])
    if len(block) != messages * count * layout.itemsize:
        return None
    fields = np.frombuffer(block, layout).reshape(messages, count)
    tags = ((np.arange(1, count + 1) << 3) | _DOUBLE_WIRE_TYPE) & 0xFF
    return fields["value"].copy() if (fields["tag"] == tags).all() else None


def list_topics() -> tuple[str, ...]:
    """Return the topics of the channel table in order."""
    return tuple(dict.fromkeys(channel.topic for channel in CHANNELS))


def encode(values: Array) -> bytes:
    """Return one message with the fields' values, shape (fields,)."""
    return encode_rows(values[None, :]).tobytes()
