"""What a test has to demand of a machine, and what it demands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.components import ForceActuator, Servo, measures
from rigtwin.description.control import Channel
from rigtwin.description.machine import Machine, Structure
from rigtwin.errors import RigtwinError
from rigtwin.models.commanding import Tick
from rigtwin.numerics.arrays import Array

TOGETHER = (Structure.MOVED, Structure.COUPLED)
"""Structures of joints that act on each other."""
Columns = dict[str, dict[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


def demanded_channels(machine: Machine) -> list[Channel]:
    """What a test has to demand of a machine.

    Parameters
    ----------
    machine
        Its description.

    Returns
    -------
    list of channels
        Commands that no described controller computes, what the controller is given besides its own
        sensors, and motions that are prescribed.
    """
    found: list[Channel] = []
    for replay in machine.replays:
        if machine.structure in TOGETHER:
            channels = [machine.components[name].channel for name in replay.moved_by]
            computed = _list_computed(machine).values()
            found += [c for c in channels if c is not None and c not in computed]
            if computed and machine.control is not None:
                sensed = list_sensed(machine)
                found += [channel for channel in machine.control.channels if channel not in sensed]
            continue
        mover = machine.components[replay.moved_by[0]]
        own = {
            c.channel
            for c in machine.components.values()
            if c.joint == replay.joint.name and c.element == "sensor"
        }
        if replay.closed and machine.control is not None:
            found += [channel for channel in machine.control.channels if channel not in own]
        elif mover.channel is not None:
            found.append(mover.channel)
    return list(dict.fromkeys(found))


def list_sensed(machine: Machine) -> set[Channel]:
    """Channels of sensors of positions and velocities."""
    return {
        component.channel
        for name, component in machine.components.items()
        if component.channel is not None
        and measures(getattr(machine.plant, name)) in ("position", "velocity")
    }


def _list_commandable(machine: Machine) -> dict[str, Channel]:
    """Actuators of joints that act on each other which a controller can command → their commands.
    What prescribes a motion is given ahead of the test."""
    if machine.structure is not Structure.COUPLED:
        return {}
    channels = {name: machine.components[name].channel for name in machine.replays[0].moved_by}
    return {
        name: channel
        for name, channel in channels.items()
        if channel is not None and isinstance(getattr(machine.plant, name), ForceActuator | Servo)
    }


def _list_computed(machine: Machine) -> dict[str, Channel]:
    """Those of them that the described controller commands."""
    outputs = () if machine.control is None else machine.control.outputs
    commandable = _list_commandable(machine)
    return {name: channel for name, channel in commandable.items() if channel[1] in outputs}


def list_wanted(
    machine: Machine, demands: Mapping[str, Array], controller: Tick | None
) -> tuple[list[Channel], list[str]]:
    """What has to be demanded, and what is commanded tick by tick.

    Parameters
    ----------
    machine
        Its description.
    demands
        That a test makes, by field or topic.field.
    controller
        One of one's own, which takes whatever demands it knows.

    Returns
    -------
    tuple
        Channels that have to be demanded, and actuators of joints that act on each other that a
        controller commands.

    Raises
    ------
    RigtwinError
        If there is nothing for a controller of one's own to command.
    """
    if controller is None:
        return demanded_channels(machine), list(_list_computed(machine))
    if machine.structure is Structure.JOINTS:
        return [("/command", name) for name in demands], []

    def is_demanded(channel: Channel) -> bool:
        return channel[1] in demands or ".".join(channel) in demands

    commandable = _list_commandable(machine)
    outputs = [name for name, channel in commandable.items() if not is_demanded(channel)]
    if not outputs:
        raise RigtwinError(f"{machine.name}: a controller has nothing to command in this test")
    movers = [machine.components[name].channel for name in machine.replays[0].moved_by]
    wanted = [c for c in movers if c is not None and c not in [commandable[o] for o in outputs]]
    known = {name for _, name in wanted} | {".".join(channel) for channel in wanted}
    return wanted + [("/command", name) for name in demands if name not in known], outputs


def check_demands(
    machine: Machine, wanted: Sequence[Channel], demands: Mapping[str, Array]
) -> Columns:
    columns: Columns = {}
    names = {f"{topic}.{name}" for topic, name in wanted} | {name for _, name in wanted}
    if unknown := [name for name in demands if name not in names]:
        there = ", ".join(name for _, name in wanted)
        raise RigtwinError(
            f"{machine.name}: nothing takes the demand {unknown[0]!r}; there are {there}"
        )
    lengths = set()
    for topic, name in wanted:
        given = demands.get(f"{topic}.{name}", demands.get(name))
        if given is None:
            there = ", ".join(name for _, name in wanted)
            raise RigtwinError(
                f"{machine.name}: no demand for {topic}.{name}; a test gives {there}"
            )
        values = np.asarray(given, float)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise RigtwinError(
                f"{machine.name}: demand {name}: expected finite numbers, one a tick"
            )
        lengths.add(len(values))
        columns.setdefault(topic, {})[name] = values
    if len(lengths) > 1:
        raise RigtwinError(
            f"{machine.name}: demands have {', '.join(map(str, sorted(lengths)))} "
            "ticks; expected one length"
        )
    return columns
