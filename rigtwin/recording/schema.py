"""Protobuf message types of the topics, made from the channel table.

All fields are doubles, so every message of a topic has the same length and whole blocks are
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
"""Name of the metadata record that says what the test was."""
TWIN_RECORD = "rigtwin.twin"
"""Name of the metadata record that says how a twin made the recording."""
END_RECORD = "rigtwin.end"
"""Name of the metadata record that says why the test ended."""
TRANSITION_RECORD = "rigtwin.transition"
"""Name of the metadata records that say when and why a session went from one state to the next,
one for each."""
CARD_RECORD = "rigtwin.card"
"""Name of the metadata record that holds the channel table."""
LATENESS_RECORD = "rigtwin.lateness"
"""Name of the metadata record that says how late the ticks of a loop in real time were."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
"""Of a field, as protobuf takes it."""
_DOUBLE_WIRE_TYPE = 1


def type_name(topic: str) -> str:
    """Full name of a topic's message type, e.g. `rigtwin.Command`."""
    return "rigtwin." + topic.strip("/").capitalize()


def check_names(topic: str, names: Sequence[str]) -> None:
    """Raises RigtwinError for names that the fields of a topic cannot have together: a recording
    with them could be written and not be read."""
    for name in names:
        if not NAME.fullmatch(name):
            raise RigtwinError(
                f"{topic}.{name}: expected a name of letters without accents, digits and _"
            )
    # Readers tell fields apart by their names in camel case too.
    seen: dict[str, str] = {}
    for name in names:
        same = re.sub(r"_(.?)", lambda found: found.group(1).upper(), name)
        if same in seen:
            raise RigtwinError(f"{topic} cannot have both {seen[same]} and {name}; rename one")
        seen[same] = name


def descriptor(topic: str, names: Sequence[str]) -> bytes:
    """Describes a topic's message type as an MCAP schema holds it.

    Parameters
    ----------
    topic : str
        Its name, with the slash.
    names : sequence of str
        Of the fields, all of them doubles.

    Returns
    -------
    bytes
        A serialized FileDescriptorSet.
    """
    file = descriptor_pb2.FileDescriptorProto(
        name=f"rigtwin/{topic.strip('/')}.proto", package="rigtwin", syntax="proto3"
    )
    message = file.message_type.add(name=type_name(topic).partition(".")[2])
    for number, name in enumerate(names, start=1):
        message.field.add(
            name=name,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


Bytes = NDArray[np.uint8]


def _segments(count: int) -> Iterator[tuple[slice, np.dtype[np.void], Bytes]]:
    """Fields 1 … count in runs whose tags are of equal length: which fields, the layout of one of
    them, and their tags, shape (fields, length).

    A tag is a varint: seven bits a byte, the lowest first, the highest bit set in all but the last.
    """
    first, length = 1, 1
    while first <= count:
        last = min(count, (1 << (7 * length - 3)) - 1)
        numbers = (np.arange(first, last + 1) << 3) | _DOUBLE_WIRE_TYPE
        parts = numbers[:, None] >> (7 * np.arange(length)) & 0x7F
        parts[:, :-1] |= 0x80
        layout = np.dtype([("tag", "u1", (length,)), ("value", "<f8")])
        yield slice(first - 1, last), layout, parts.astype(np.uint8)
        first, length = last + 1, length + 1


def encode_rows(values: Array) -> Bytes:
    """Encode messages of doubles as protobuf does.

    Parameters
    ----------
    values
        Fields 1, 2, … of each message, shape (messages, fields).

    Returns
    -------
    array
        One message a row, shape (messages, bytes).
    """
    parts = [np.empty((len(values), 0), np.uint8)]
    for fields, layout, tags in _segments(values.shape[1]):
        part = np.empty((len(values), len(tags)), layout)
        part["tag"], part["value"] = tags, values[:, fields]
        parts.append(part.view(np.uint8).reshape(len(values), -1))
    return np.hstack(parts)


def decode_rows(block: bytes, messages: int, count: int) -> Array | None:
    """Decode messages that `encode_rows` made.

    Parameters
    ----------
    block
        All messages, one after another.
    messages, count
        Number of messages, and of fields in each.

    Returns
    -------
    array or None
        Shape (messages, fields); None if they are encoded in another way.
    """
    segments = list(_segments(count))
    width = sum(len(tags) * layout.itemsize for _, layout, tags in segments)
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
    """Decode messages of 16 fields and more as earlier releases wrote them: the tags cut to a byte,
    which no other reader understands."""
    layout = np.dtype([("tag", "u1"), ("value", "<f8")])
    if len(block) != messages * count * layout.itemsize:
        return None
    fields = np.frombuffer(block, layout).reshape(messages, count)
    tags = ((np.arange(1, count + 1) << 3) | _DOUBLE_WIRE_TYPE) & 0xFF
    return fields["value"].copy() if (fields["tag"] == tags).all() else None


def list_topics() -> tuple[str, ...]:
    """Topics of the channel table, in order."""
    return tuple(dict.fromkeys(channel.topic for channel in CHANNELS))


def encode(values: Array) -> bytes:
    """One message of a topic, of its fields' values."""
    return encode_rows(values[None, :]).tobytes()
