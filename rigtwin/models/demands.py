"""What a test has to demand of a machine, and what it demands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.components import PUSHERS, measures
from rigtwin.description.control import Channel
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

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
        Commands that no described controller computes, motions that are prescribed, and what the
        controller is given besides its sensors.
    """
    computed = list_computed(machine).values()
    found = [channel for channel in list_movers(machine).values() if channel not in computed]
    if computed and machine.control is not None:
        sensed = list_sensed(machine)
        found += [channel for channel in machine.control.channels if channel not in sensed]
    return list(dict.fromkeys(found))


def list_movers(machine: Machine) -> dict[str, Channel]:
    """What moves a machine → its channel."""
    names = [name for replay in machine.replays for name in replay.moved_by]
    channels = {name: machine.components[name].channel for name in names}
    return {name: channel for name, channel in channels.items() if channel is not None}


def list_pushers(machine: Machine) -> dict[str, Channel]:
    """Actuators that push a machine's joints, as a controller can tick by tick → their commands.
    What prescribes a motion is given ahead of the test."""
    movers = list_movers(machine).items()
    return {name: c for name, c in movers if isinstance(getattr(machine.plant, name), PUSHERS)}


def list_computed(machine: Machine) -> dict[str, Channel]:
    """Those of them that the described controller commands."""
    outputs = () if machine.control is None else machine.control.outputs
    pushers = list_pushers(machine).items()
    return {name: channel for name, channel in pushers if channel[1] in outputs}


def list_sensors(machine: Machine) -> dict[str, str]:
    """Sensors of a machine that is pushed which a controller can read tick by tick → whether of
    position, velocity or force. The force that a prescribed motion takes is known only after."""
    plant, prescribed = machine.plant, set(list_movers(machine)) - set(list_pushers(machine))
    held = {machine.components[name].joint for name in prescribed}
    found = {}
    for name, component in machine.components.items():
        kind = measures(getattr(plant, name))
        if not kind or component.channel is None or not component.acts_on:
            continue
        if kind != "force" or not held & {joint for joint, _ in component.acts_on}:
            found[name] = kind
    return found


def list_sensed(machine: Machine) -> set[Channel]:
    """Channels of those sensors."""
    channels = (machine.components[name].channel for name in list_sensors(machine))
    return {channel for channel in channels if channel is not None}


def list_wanted(
    machine: Machine, demands: Mapping[str, Array], controller: object | None
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
        Channels that have to be demanded, and actuators that a controller commands.

    Raises
    ------
    RigtwinError
        If there is nothing for a controller of one's own to command.
    """
    if controller is None:
        return demanded_channels(machine), list(list_computed(machine))

    def is_demanded(channel: Channel) -> bool:
        return channel[1] in demands or ".".join(channel) in demands

    pushers = list_pushers(machine)
    outputs = [name for name, channel in pushers.items() if not is_demanded(channel)]
    if not outputs:
        raise RigtwinError(f"{machine.name}: a controller has nothing to command in this test")
    wanted = [c for name, c in list_movers(machine).items() if name not in outputs]
    known = {name for _, name in wanted} | {".".join(channel) for channel in wanted}
    return wanted + [("/command", name) for name in demands if name not in known], outputs


def check_demands(
    machine: Machine, wanted: Sequence[Channel], demands: Mapping[str, Array]
) -> Columns:
    if not isinstance(demands, Mapping) or not all(isinstance(name, str) for name in demands):
        raise RigtwinError(
            f"{machine.name}: a test demands {demands!r:.60}; expected signals by channel"
        )
    columns: Columns = {}
    names = {f"{topic}.{name}" for topic, name in wanted} | {name for _, name in wanted}
    if unknown := [name for name in demands if name not in names]:
        there = ", ".join(name for _, name in wanted) or "none: nothing need be demanded"
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
        try:
            values = np.asarray(given, float)
        except (TypeError, ValueError, OverflowError):
            values = np.array(math.nan)
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
