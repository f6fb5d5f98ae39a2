"""Numbers in ROS 2 messages of any type, by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from rigtwin.importing.naming import name_items

LABELS = ("name", "names", "joint_names", "dof_names", "interface_names")
"""Fields that name the items of a message's other lists."""
PASSED_OVER = ("header", "layout", "__msgtype__", *LABELS)
"""Fields that hold no signal."""
MOST_ITEMS = 256
"""Longest list whose items become signals. Longer lists are pictures and point clouds."""
MEASURED = ("sensor_msgs/", "geometry_msgs/", "nav_msgs/")
"""Packages of messages that hold measurements; all others hold commands and states."""
SECOND = 1_000_000_000
"""Duration of a second, ns."""
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


def list_numbers(
    message: Any, prefix: str = "", labels: Sequence[str] = ()
) -> Iterator[tuple[str, float]]:
    """Yield all numbers of a message.

    Parameters
    ----------
    message
        Message as `rosbags` reads it.
    prefix
        Text put before every field name.
    labels
        Joint names of the enclosing message, for a message without names.

    Yields
    ------
    tuple
        `.field`, `.field.inner`, `.position[shoulder]` or `.data[0]`, and the number. Items of a
        list are named after the joints if the list has one item per joint, and numbered otherwise.
    """
    labels = _labels_of(message) or labels
    for entry in fields(message):
        if entry.name not in PASSED_OVER:
            yield from _numbers_in(getattr(message, entry.name), f"{prefix}.{entry.name}", labels)


def _labels_of(message: Any) -> Sequence[str]:
    for name in LABELS:
        names = getattr(message, name, None)
        if isinstance(names, list) and names and all(isinstance(label, str) for label in names):
            return names
    return ()


def _numbers_in(value: Any, name: str, labels: Sequence[str]) -> Iterator[tuple[str, float]]:
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and len(value) <= MOST_ITEMS:
        yield from zip(name_items(name, len(value), labels), value.tolist(), strict=True)
    elif is_dataclass(value):
        if (time := time_of(value)) is not None:
            yield name, 1e-9 * time
        else:
            yield from list_numbers(value, name, labels)
    elif isinstance(value, list | tuple) and len(value) <= MOST_ITEMS:
        for item, inner in zip(name_items(name, len(value), labels), value, strict=True):
            yield from _numbers_in(inner, item, labels)


def time_of(value: Any) -> int | None:
    """Return a ROS time or duration in ns; None for any other message."""
    if hasattr(value, "sec") and hasattr(value, "nanosec"):
        return int(value.sec) * SECOND + int(value.nanosec)
    return None


def stamp_of(message: Any) -> int | None:
    """Return the time in a message's header, ns; None without a stamp, and for an unset one (0)."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return (time_of(stamp) or None) if stamp is not None else None


def list_points(message: Any) -> Iterator[tuple[int, list[tuple[str, float]]]]:
    """Yield the time since the trajectory's start, ns, and the named numbers of each point."""
    for point in message.points:
        numbers = [
            (name, number)
            for name, number in list_numbers(point, "", message.joint_names)
            if not name.startswith(".time_from_start")
        ]
        yield time_of(point.time_from_start) or 0, numbers
