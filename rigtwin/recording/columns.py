"""Decoding of a topic's messages, JSON or protobuf, into columns of numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from mcap.records import Channel, Schema

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording.channels import topic_fields
from rigtwin.recording.schema import decode_rows


def decode_columns(
    path: Path, channel: Channel, schema: Schema | None, data: list[bytes], notes: list[str]
) -> dict[str, Array]:
    """Decode the columns of a topic. Fields listed in `channels` come first.

    Parameters
    ----------
    path
        Path of the file, for messages.
    channel, schema
        Channel and schema of the topic. A protobuf topic needs its schema.
    data
        Messages in order.
    notes
        Notes on the file. A note on each channel that is left out is appended.

    Returns
    -------
    dict
        Field → values, shape (messages,).

    Raises
    ------
    RigtwinError
        If a message cannot be read, or lacks a number in a field listed in `channels`.
    """
    names = topic_fields(channel.topic)
    if channel.message_encoding == "json":
        rows = _json_at_once(data)
        if rows is None:
            rows = _decode_singly(path, channel.topic, data, json.loads)
    elif channel.message_encoding == "protobuf":
        if schema is None:
            raise RigtwinError(f"{path}: {channel.topic} is protobuf without a schema")
        present, numbers, decode = _protobuf(path, schema)
        # `encode_rows` writes doubles numbered 1, 2, …, so all messages have one length and numpy
        # decodes them as a block. `decode_rows` returns None if the messages deviate from this.
        if numbers == list(range(1, len(present) + 1)):
            values = decode_rows(b"".join(data), len(data), len(present))
            if values is not None:
                order = [name for name in names if name in present]
                order += [name for name in present if name not in names]
                return {name: values[:, present.index(name)].copy() for name in order}
        rows = _decode_singly(path, channel.topic, data, decode)
    else:
        raise RigtwinError(
            f"{path}: {channel.topic} is encoded as {channel.message_encoding!r}; "
            "expected json or protobuf"
        )
    order = [name for name in names if any(name in row for row in rows)]
    order += [name for name in _numbers(rows) if name not in order]
    notes += _notes_on_left_out(channel.topic, rows, order)
    if not order:
        raise RigtwinError(f"{path}: {channel.topic} has none of the fields {', '.join(names)}")
    return {
        name: _column(path, f"{channel.topic}.{name}", [row.get(name) for row in rows])
        for name in order
    }


def _decode_singly(
    path: Path, topic: str, data: list[bytes], decode: Callable[[bytes], Mapping[str, Any]]
) -> list[Mapping[str, Any]]:
    """Decode messages one by one. Raise RigtwinError for the first that cannot be read."""
    rows = []
    for number, item in enumerate(data):
        try:
            row = decode(item)
        except (ValueError, RecursionError, DecodeError):
            row = None
        if not isinstance(row, Mapping):
            raise RigtwinError(
                f"{path}: message {number} on {topic} cannot be read; expected an object of numbers"
            )
        rows.append(row)
    return rows


def _json_at_once(data: list[bytes]) -> list[Mapping[str, Any]] | None:
    """Decode flat JSON objects in one call, which is twice as fast; None for any others."""
    # One brace pair means no nested object and, almost surely, no text with braces. A wrong guess
    # costs only time: the rows are checked below.
    if not all(item.count(b"{") == 1 == item.count(b"}") for item in data):
        return None
    try:
        # One call of the JSON parser for all messages instead of one call each.
        rows = json.loads(b"[" + b",".join(data) + b"]")
    except (ValueError, RecursionError):
        return None
    flat = len(rows) == len(data) and all(isinstance(row, dict) for row in rows)
    return rows if flat else None


def _numbers(rows: list[Mapping[str, Any]]) -> list[str]:
    """Return the fields that are numbers in all messages."""
    return (
        [
            name
            for name in rows[0]
            # A name with control characters could act on the terminal that prints it.
            if name.isprintable() and {type(row.get(name)) for row in rows} <= {int, float, bool}
        ]
        if rows
        else []
    )


def _notes_on_left_out(
    topic: str, rows: list[Mapping[str, Any]], order: list[str]
) -> Iterator[str]:
    """Note the fields that are numbers in some messages only. Fields that are never numbers, such
    as texts, need no note."""
    for name in dict.fromkeys(name for row in rows for name in row):
        if name in order or not name.isprintable():
            continue
        missing = [type(row.get(name)) not in (int, float) for row in rows]
        if not all(missing):
            yield (
                f"{topic}.{name} is not a number in {sum(missing)} messages, the first is message "
                f"{missing.index(True)}; the channel is left out"
            )


def _column(path: Path, channel: str, values: list[Any]) -> Array:
    """Return the values as an array. Raise RigtwinError for the first that is not a number."""
    for number, value in enumerate(values):
        # An exact test, because a JSON boolean is an int in Python.
        if type(value) is not float and type(value) is not int:
            shown = "missing" if value is None else f"{value!r:.40}"
            raise RigtwinError(
                f"{path}: {channel} of message {number} is {shown}; expected a number"
            )
    try:
        return np.array(values, np.float64)
    except OverflowError:
        raise RigtwinError(f"{path}: {channel} holds a number too large to be read") from None


def _protobuf(
    path: Path, schema: Schema
) -> tuple[list[str], list[int], Callable[[bytes], Mapping[str, Any]]]:
    """Return field names and field numbers of a message type, and a decoder of its messages.

    The list of field numbers is empty unless all fields are doubles.
    """
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
        # A pool of its own: two files may define the same type differently.
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.Add(file)
        kind = pool.FindMessageTypeByName(schema.name)
    except (KeyError, TypeError, DecodeError) as error:
        raise RigtwinError(f"{path}: schema {schema.name!r} cannot be read: {error}") from None
    names = [item.name for item in kind.fields]
    # Messages with fields of other types vary in length and are decoded one by one.
    doubles = all(item.type == item.TYPE_DOUBLE for item in kind.fields)
    message_class = message_factory.GetMessageClass(kind)

    def decode(item: bytes) -> Mapping[str, Any]:
        message = message_class.FromString(item)
        return {name: getattr(message, name) for name in names}

    return names, [item.number for item in kind.fields] if doubles else [], decode
