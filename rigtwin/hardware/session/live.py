"""Live view of a session for Foxglove, served on this computer only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording.schema import descriptor, encode, type_name

HOST = "127.0.0.1"
SHOWN = 10
"""Interval of the ticks that are shown."""


def open_live_view(port: int, fields: Mapping[str, Sequence[str]]) -> Callable[[str, Array], None]:
    """Start serving a live view.

    Parameters
    ----------
    port
        Port on this computer.
    fields
        Topic → names of its fields.

    Returns
    -------
    callable
        Function that shows rows of a topic. The first column of a row is the time in s.

    Raises
    ------
    RigtwinError
        If the package is missing or the port is in use.
    """
    try:
        import foxglove
    except ImportError:
        raise RigtwinError(
            "the foxglove-sdk package is missing; pip install 'rigtwin[live]'"
        ) from None
    try:
        server = foxglove.start_server(name="rigtwin", host=HOST, port=port)
    except (RuntimeError, OverflowError) as error:
        raise RigtwinError(f"no live view on port {port}: {error}") from None
    channels: dict[str, Any] = {"server": server}

    def show(topic: str, rows: Array) -> None:
        # A topic is announced with its first rows, because not every session has every topic.
        if topic not in channels:
            schema = foxglove.Schema(
                name=type_name(topic), encoding="protobuf", data=descriptor(topic, fields[topic])
            )
            channels[topic] = foxglove.Channel(topic, schema=schema, message_encoding="protobuf")
        for row in rows[::SHOWN]:
            channels[topic].log(encode(row), log_time=max(0, round(float(row[0]) * 1e9)))

    return show
