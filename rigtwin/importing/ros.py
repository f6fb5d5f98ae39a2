"""ROS 2 bags: the folder that `ros2 bag record` writes, or one file of it, MCAP or SQLite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format, first_line
from rigtwin.importing.ros_topics import Topic, decoder, list_columns, read_topic
from rigtwin.importing.selection import Selection
from rigtwin.importing.series import join_series
from rigtwin.numerics.arrays import Array

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag2 import Reader

TIME, RECORDED = "time", "recorded"
"""Columns of every topic: time in the header, or of recording where it has none; time of
recording."""
JOINT_STATE = "sensor_msgs/msg/JointState"
ONE_CLOCK = 1_000_000_000
"""ns, by which a message's time may differ from the time of its recording on the same clock."""

COMMON = 0.5
"""Share of the rows that a signal must cover to be read where nobody asked for it by name."""


def read_bag(path: Path, selection: Selection) -> Columns:
    """Read the needed topics of a bag, joined on the times of one of them.

    Parameters
    ----------
    path
        Folder with `metadata.yaml`, or one file of the bag.
    selection
        Needed columns, such as `/joint_states.position[shoulder]`. The topic of the time column
        sets the rows; without one, the `JointState` topic with the most messages.

    Returns
    -------
    Columns
        One row a message of that topic. Measurements of other topics are interpolated, commands
        hold until the next one comes.

    Raises
    ------
    RigtwinError
        If rosbags is not installed, the bag is damaged, or its topics have no time in common.
    """
    try:
        from rosbags.rosbag2 import Reader
    except ImportError:
        raise RigtwinError(f"{path}: ROS bags need rosbags: pip install 'rigtwin[ros]'") from None
    try:
        with Reader(path) as reader:
            return _read(path, reader, selection)
    except (RigtwinError, MemoryError):
        raise
    except Exception as error:  # The reader raises errors of any kind for a damaged bag.
        reason = first_line(error)
        hint = "; a recording of rigtwin needs no import" if "profile" in reason.lower() else ""
        raise RigtwinError(f"{path} is not a ROS 2 bag, or damaged: {reason}{hint}") from None


def _read(path: Path, reader: Reader, selection: Selection) -> Columns:
    by_topic: dict[str, list[Connection]] = {}
    for connection in reader.connections:
        if connection.msgcount:
            by_topic.setdefault(connection.topic, []).append(connection)
    if not by_topic:
        raise RigtwinError(f"{path}: it holds no messages")
    find = decoder(reader.connections)
    by_recorder = any(name.endswith(f".{RECORDED}") for name in selection.time)
    topics: list[Topic] = []
    refused: dict[str, str] = {}
    listed: list[str] = []
    for name, connections in by_topic.items():
        types = {connection.msgtype for connection in connections}
        decode = find(connections[0].msgtype)
        # Topics that cannot be read are an error only if somebody asks for them.
        if decode is None or len(types) > 1:
            why = f"topic {name} has messages of several types: {', '.join(sorted(types))}"
            if decode is None:
                why = f"the bag does not hold the definition of {', '.join(types)}"
            parts = [asked for asked in selection.names or () if asked.startswith(f"{name}.")]
            refused |= dict.fromkeys((name, *parts), why)
        elif selection.takes_within(name):
            topics.append(read_topic(reader, connections, decode, selection.takes, by_recorder))
            listed += topics[-1].columns
        else:
            listed += list_columns(reader, connections, decode)
    if not any(topic.series for topic in topics):
        return Columns({}, {}, "ROS 2 bag", listed=tuple(listed), refused=refused)
    joined = _join(path, topics, selection, RECORDED if by_recorder else TIME)
    return replace(joined, listed=tuple(listed), refused={**refused, **joined.refused})


def _join(path: Path, topics: Sequence[Topic], selection: Selection, clock: str) -> Columns:
    """Join the topics on the times of one of them, the column `clock`."""
    leader = _leader(topics, selection)
    notes = [
        f"{topic.unordered} messages on {topic.name} come after later ones; sorted by time"
        for topic in topics
        if topic.unordered
    ]
    base = _times(leader)
    offset = leader.delay or 0
    values: dict[str, Array] = {}
    # The delay is recording time minus header stamp: a difference of two topics' delays is the
    # difference of their clocks, apart from transport.
    for topic in topics:
        shift = (topic.delay or 0) - offset
        if abs(shift) > ONE_CLOCK:
            notes.append(
                f"{topic.name} has another clock than {leader.name}; set right by "
                f"{1e-9 * shift:.3f} s, from the times of recording"
            )
        for name, series in topic.series.items():
            values[name] = join_series(series, base, shift if abs(shift) > ONE_CLOCK else 0)
        if topic is not leader and topic.series:
            join = next(iter(topic.series.values())).join
            notes.append(f"{topic.name} is {join.value} at the times of {leader.name}")
    refused = _list_sparse(values, leader, 0.0 if selection.names is not None else COMMON)
    values = {name: column for name, column in values.items() if name not in refused}
    if not values:
        return Columns({}, refused=refused)
    # Rows where all signals exist: the test begins with the last topic, and ends with the first.
    known = np.all([np.isfinite(column) for column in values.values()], axis=0)
    if not known.any():
        raise RigtwinError(
            f"{path}: {', '.join(topic.name for topic in topics)} have no time in common; "
            "expected messages of one test"
        )
    # Only the ends are cut: a gap within the test is for people to see.
    rows = slice(int(np.argmax(known)), len(known) - int(np.argmax(known[::-1])))
    if rows.stop - rows.start < len(known):
        notes.append(
            f"{len(known) - rows.stop + rows.start} of {len(known)} messages on {leader.name} lie "
            "before or after the messages of another topic; left out"
        )
    values = {name: column[rows] for name, column in values.items()}
    time = (base[rows] - base[rows][0]) * 1e-9
    stamps = {clock: time, f"{leader.name}.{clock}": time}
    return Columns(
        {**stamps, **values},
        dict.fromkeys(stamps, "s"),
        f"ROS 2 bag, a row each message of {leader.name}",
        tuple(notes),
        refused=refused,
    )


def _list_sparse(values: Mapping[str, Array], leader: Topic, least: float) -> dict[str, str]:
    """Return the signals that cover at most a share of the rows, and why they are refused."""
    return {
        name: f"its messages cover {np.mean(np.isfinite(column)):.0%} of those of {leader.name}"
        for name, column in values.items()
        if np.mean(np.isfinite(column)) <= least
    }


def _leader(topics: Sequence[Topic], selection: Selection) -> Topic:
    """Return the topic whose messages are the rows."""
    for column in selection.time:
        for topic in topics:
            if column.rpartition(".")[0] == topic.name:
                return topic
    # Joint states are the natural rows of a robot; otherwise the fastest topic.
    return max(topics, key=lambda topic: (topic.type == JOINT_STATE, len(topic.times)))


def _times(topic: Topic) -> NDArray[np.int64]:
    """Return the times of the rows, ns: those of the column with the most samples, since a joint
    may be missing in some messages."""
    if not topic.series:
        return np.sort(np.array(topic.times, np.int64))
    return max((series.sorted()[0] for series in topic.series.values()), key=len)


def _is_bag(folder: Path) -> bool:
    return (folder / "metadata.yaml").is_file()


FORMAT = Format("ROS 2 bag (a folder with metadata.yaml)", (".mcap", ".db3"), read_bag, _is_bag)
