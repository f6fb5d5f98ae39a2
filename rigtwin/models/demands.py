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
            control, read = machine.control, list_sensed(machine)
            output = None if control is None else ("/command", *control.outputs)
            found += [c for c in channels if c is not None and c != output]
            if control is not None and output in channels:
                found += [c for c in control.channels if c not in read and c not in found]
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


def list_wanted(
    machine: Machine, demands: Mapping[str, Array], controller: Tick | None
) -> tuple[list[Channel], list[str]]:
    """Channels that have to be demanded, and actuators of joints that act on each other that a
    controller commands."""
    channels = demanded_channels(machine)
    if machine.structure is not Structure.COUPLED:
        # A controller of one's own takes whatever demands it knows.
        return (channels if controller is None else [("/command", name) for name in demands]), []
    outputs = []
    for name in machine.replays[0].moved_by:
        channel, part = machine.components[name].channel, getattr(machine.plant, name)
        if channel is None or not isinstance(part, ForceActuator | Servo):
            continue
        own = controller is not None and not {channel[1], ".".join(channel)} & set(demands)
        if own or (controller is None and channel not in channels):
            outputs.append(name)
    given = {machine.components[name].channel for name in outputs}
    wanted = [channel for channel in channels if channel not in given]
    if controller is not None:
        known = {name for _, name in channels} | {".".join(channel) for channel in channels}
        wanted += [("/command", name) for name in demands if name not in known]
        if not outputs:
            raise RigtwinError(f"{machine.name}: every command is demanded; nothing is controlled")
    return wanted, outputs


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
