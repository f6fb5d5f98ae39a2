"""Topics of a ROS 2 bag: their messages as series."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from statistics import median_low
from typing import TYPE_CHECKING, Any

from rigtwin.importing.ros_messages import MEASURED, TRAJECTORY, list_numbers, list_points, stamp_of
from rigtwin.importing.series import Join, Series

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag2 import Reader

Decode = Callable[[bytes], Any]
"""Makes a message of its bytes."""


@dataclass
class Topic:
    """Messages of one topic.

    Parameters
    ----------
    name
        Name, with the slash.
    type
        Type of the messages, such as `sensor_msgs/msg/JointState`.
    series
        Column → its samples.
    times
        Time of each message, ns.
    columns
        All columns of the messages, in order.
    delay
        Median of the time of recording less the time in the header, ns; None without headers.
    unordered
        Number of messages whose time is before that of the one before.
    """

    name: str
    type: str
    series: dict[str, Series] = field(default_factory=dict)
    times: array[int] = field(default_factory=lambda: array("q"))
    columns: dict[str, None] = field(default_factory=dict)
    delay: int | None = None
    unordered: int = 0


def list_columns(reader: Reader, connections: Sequence[Connection], decode: Decode) -> list[str]:
    """Return the columns that the first message of a topic has."""
    for connection, _, data in reader.messages(connections):
        suffixes = (suffix for _, pairs in _samples(decode(data)) for suffix, _ in pairs)
        return [f"{connection.topic}{suffix}" for suffix in dict.fromkeys(suffixes)]
    return []


def read_topic(
    reader: Reader,
    connections: Sequence[Connection],
    decode: Decode,
    takes: Callable[[str], bool],
    by_recorder: bool,
) -> Topic:
    """Read the messages of a topic.

    Parameters
    ----------
    reader
        The open bag.
    connections
        The topic in the bag, once for each of its writers.
    decode
        Makes a message of its bytes.
    takes
        Whether a column is needed.
    by_recorder
        Whether times are those of recording rather than those in the headers.

    Returns
    -------
    Topic
        The needed columns.
    """
    topic = Topic(connections[0].topic, connections[0].msgtype)
    # What is measured changes between samples; what is commanded changes only with them.
    join = Join.INTERPOLATE if topic.type.startswith(MEASURED) else Join.HOLD
    plans = topic.type == TRAJECTORY
    delays: list[int] = []
    latest = -1
    for _, recorded, data in reader.messages(connections):
        message = decode(data)
        stamp = stamp_of(message)
        if stamp is not None:
            delays.append(recorded - stamp)
        begin = recorded if stamp is None or by_recorder else stamp
        # Messages may overtake each other on the way; series are sorted before use.
        topic.unordered += begin < latest
        latest = begin
        topic.times.append(begin)
        for after, pairs in _samples(message):
            for suffix, number in pairs:
                name = f"{topic.name}{suffix}"
                topic.columns[name] = None
                if not takes(name):
                    continue
                series = topic.series.get(name)
                if series is None:
                    series = topic.series[name] = Series(join=join)
                if plans:
                    # A new trajectory replaces the points of the last one that are not due yet.
                    series.cut(begin + after)
                    series.join = Join.PLAN if len(message.points) > 1 else series.join
                series.add(begin + after, number)
    if delays and not by_recorder:
        # The median is robust against messages that waited; median_low stays an integer of ns.
        topic.delay = median_low(delays)
    return topic


def _samples(message: Any) -> Iterator[tuple[int, list[tuple[str, float]]]]:
    """Yield the samples in a message: time after the message's, ns, and numbers by name."""
    if hasattr(message, "points") and hasattr(message, "joint_names"):
        yield from list_points(message)
    else:
        yield 0, list(list_numbers(message))


def decoder(connections: Sequence[Connection]) -> Callable[[str], Decode | None]:
    """Return the function that finds the decoder of a message type, or None for an unknown type.

    Types are taken from the bag where it holds their definitions, else from those that come with
    ROS 2.

    Parameters
    ----------
    connections
        Topics of the bag.
    """
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = get_typestore(Stores.LATEST)
    embedded = get_typestore(Stores.EMPTY)
    for connection in connections:
        if connection.msgdef.format == MessageDefinitionFormat.MSG:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            # Several connections bring the definition of one type; the first is kept.
            embedded.register({k: v for k, v in types.items() if k not in embedded.fielddefs})

    def find(kind: str) -> Decode | None:
        for store in (embedded, known):
            if kind in store.fielddefs:
                return partial(_decode, store, kind)
        return None

    return find


def _decode(store: Any, kind: str, data: bytes) -> Any:
    return store.deserialize_cdr(data, kind)
