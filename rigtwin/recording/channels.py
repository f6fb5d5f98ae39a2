"""Channels of a recording: topic, field, unit and meaning.

They are defined here once; the file format and all tables follow them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from controllers import Commands, Measurements
from machines import DEFAULT_MACHINE


@dataclass(frozen=True)
class Channel:
    """Column of a recording."""

    topic: str
    name: str
    unit: str
    meaning: str


CHANNELS = (
    Channel("/command", "ground", "m", "ground cylinder position demanded"),
    Channel("/command", "structure", "m", "structure cylinder position demanded"),
    Channel("/command", "force", "N", "suspension force demanded, positive in compression"),
    Channel("/command", "voltage", "V", "to the motor amplifier"),
    Channel("/sensor", "ground_lvdt", "m", "ground cylinder position"),
    Channel("/sensor", "structure_lvdt", "m", "structure cylinder (plate) position"),
    Channel("/sensor", "suspension_lvdt", "m", "suspension travel: plate minus carriage"),
    Channel("/sensor", "load_cell", "N", "suspension force, positive in compression"),
    Channel("/truth", "ground", "m", "ground plate position in the twin"),
    Channel("/truth", "structure", "m", "structure plate position in the twin"),
    Channel("/truth", "suspension", "m", "suspension travel in the twin"),
    Channel("/truth", "load_cell", "N", "force in the load cell, without noise"),
)

SESSION = (
    Channel("/session", "time", "s", "since the start of the test; negative before it"),
    Channel(
        "/session",
        "phase",
        "1",
        "0 idle, 1 armed, 2 ramping, 3 running, 4 stopping, 5 stopped, 6 faulted",
    ),
    Channel("/session", "ground", "m", "ground cylinder position written to the rig"),
    Channel("/session", "structure", "m", "structure cylinder position written to the rig"),
    Channel("/session", "voltage", "V", "written to the motor amplifier"),
    Channel("/session", "pressure", "1", "whether the hydraulics have pressure"),
    *(replace(channel, topic="/session") for channel in CHANNELS if channel.topic == "/sensor"),
    Channel("/session", "late", "s", "by which the tick began after it was due"),
    Channel("/session", "missed", "tick", "that passed unread before this one"),
)
"""Channels of a supervised session: every tick from arming to rest, including the test's. No
diagnosis reads them."""


def channels_of(
    columns: Mapping[str, Mapping[str, object]],
    machine: str = DEFAULT_MACHINE,
    units: Mapping[str, str] | None = None,
) -> list[Channel]:
    """List the channels that a recording holds, those of the rig's table first.

    Parameters
    ----------
    columns
        Topic → field → values, as recordings have them.
    machine
        Name of the machine; names of the rig's table mean something else on another machine.
    units
        `/topic.field` → unit, of channels that the rig's table does not have.

    Returns
    -------
    list of Channel
        Channels with unit and meaning, empty where they are unknown.
    """
    present = [(topic, name) for topic, names in columns.items() for name in names]
    # Another program's recording may lack a machine, which then reads as the rig; only its
    # sensors' names show that it is one.
    rig = machine == DEFAULT_MACHINE and any(
        topic == "/sensor" and name in Measurements._fields for topic, name in present
    )
    # The table's order, not the file's, so that exports of all rig recordings have the same
    # columns.
    known = [c for c in CHANNELS if rig and (c.topic, c.name) in present]
    named = {(channel.topic, channel.name) for channel in known}
    return known + [
        Channel(topic, name, (units or {}).get(f"{topic}.{name}", ""), "")
        for topic, name in present
        if (topic, name) not in named
    ]


def topic_fields(topic: str) -> tuple[str, ...]:
    """Return the field names of a topic in order."""
    return tuple(channel.name for channel in (*CHANNELS, *SESSION) if channel.topic == topic)


assert topic_fields("/command") == Commands._fields
assert topic_fields("/sensor") == Measurements._fields
