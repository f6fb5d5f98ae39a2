"""Columns of numbers out of the messages of a topic, JSON or protobuf."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
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
    path: Path, channel: Channel, schema: Schema | None, data: list[bytes]
) -> dict[str, Array]:
    """The columns of a topic: every number in it, those that the channel table names first.

    Parameters
    ----------
    path
        Of the file, for what is said of it.
    channel, schema
        Of the topic; a protobuf topic needs its schema.
    data
        The messages, in order.

    Returns
    -------
    dict
        Each field's values, shape (messages,).

    Raises
    ------
    RigtwinError
        If a message cannot be read, or a field is no number in all of them.
    """
    names = topic_fields(channel.topic)
    if channel.message_encoding == "json":
        decode: Callable[[bytes], Mapping[str, Any]] = json.loads
    elif channel.message_encoding == "protobuf":
        if schema is None:
            raise RigtwinError(f"{path}: {channel.topic} is protobuf without a schema")
        present, numbers, decode = _protobuf(path, schema)
        block = b"".join(data)
        ours = [
            *(name for name in names if name in present),
            *(n for n in present if n not in names),
        ]
        if numbers == list(range(1, len(present) + 1)):
            values = decode_rows(block, len(data), len(present))
            if values is not None:
                return {name: values[:, present.index(name)].copy() for name in ours}
    else:
        raise RigtwinError(
            f"{path}: {channel.topic} is encoded as {channel.message_encoding!r}; "
            "expected json or protobuf"
        )
    rows = _json_at_once(data) if decode is json.loads else None
    if rows is None:
        rows = []
        for number, item in enumerate(data):
            try:
                row = decode(item)
            except (ValueError, RecursionError, DecodeError):
                row = None
            if not isinstance(row, Mapping):
                raise RigtwinError(
                    f"{path}: message {number} on {channel.topic} cannot be read; "
                    "expected an object of numbers"
                )
            rows.append(row)
    ours = [name for name in names if any(name in row for row in rows)]
    ours += [name for name in _numbers(rows) if name not in ours]
    if not ours:
        raise RigtwinError(f"{path}: {channel.topic} has none of the fields {', '.join(names)}")
    return {
        name: _column(path, f"{channel.topic}.{name}", [row.get(name) for row in rows])
        for name in ours
    }


def _json_at_once(data: list[bytes]) -> list[Mapping[str, Any]] | None:
    """Flat JSON objects, twice as fast as one by one; None if they are anything else."""
    if not all(each.count(b"{") == 1 == each.count(b"}") for each in data):
        return None
    try:
        rows = json.loads(b"[" + b",".join(data) + b"]")
    except (ValueError, RecursionError):
        return None
    flat = len(rows) == len(data) and all(isinstance(row, dict) for row in rows)
    return rows if flat else None


def _numbers(rows: list[Mapping[str, Any]]) -> list[str]:
    """Fields that hold numbers throughout."""
    return (
        [
            name
            for name in rows[0]
            if name.isprintable() and {type(row.get(name)) for row in rows} <= {int, float, bool}
        ]
        if rows
        else []
    )


def _column(path: Path, channel: str, values: list[Any]) -> Array:
    """Numbers as they came; anything else is refused with its place."""
    for number, value in enumerate(values):
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
    """Field names and numbers of a message type, and a decoder that takes anything of that type."""
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.Add(file)
        found = pool.FindMessageTypeByName(schema.name)
    except (KeyError, TypeError, DecodeError) as error:
        raise RigtwinError(f"{path}: schema {schema.name!r} cannot be read: {error}") from None
    names = [item.name for item in found.fields]
    doubles = all(item.type == item.TYPE_DOUBLE for item in found.fields)
    kind = message_factory.GetMessageClass(found)

    def decode(item: bytes) -> Mapping[str, Any]:
        message = kind.FromString(item)
        return {name: getattr(message, name) for name in names}

    return names, [item.number for item in found.fields] if doubles else [], decode
