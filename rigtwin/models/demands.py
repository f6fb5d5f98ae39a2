"""Demands of a test on a machine: which ones are required, and whether they are valid."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.components import PUSHERS
from rigtwin.description.control import Channel
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

Columns = dict[str, dict[str, Array]]
"""Topic → field → signal, shape (ticks,)."""


def demanded_channels(machine: Machine) -> list[Channel]:
    """Return the channels that a test has to demand of a machine.

    Parameters
    ----------
    machine
        Description of the machine.

    Returns
    -------
    list of channels
        Commands that no described controller computes, prescribed motions, and inputs of the
        controller that no sensor reads.
    """
    computed = list_computed(machine).values()
    channels = [channel for channel in list_movers(machine).values() if channel not in computed]
    if computed and machine.control is not None:
        sensed = list_sensed(machine)
        channels += [channel for channel in machine.control.channels if channel not in sensed]
    return list(dict.fromkeys(channels))


def list_movers(machine: Machine) -> dict[str, Channel]:
    """Return all actuators and sensors that move a machine's replays, with their channels."""
    names = [name for replay in machine.replays for name in replay.moved_by]
    channels = {name: machine.components[name].channel for name in names}
    return {name: channel for name, channel in channels.items() if channel is not None}


def list_pushers(machine: Machine) -> dict[str, Channel]:
    """Return the actuators that push a machine's joints, with the channels of their commands.

    A controller can command these tick by tick. Prescribed motions are known before the test.
    """
    pushers = {pusher.name for pusher in machine.components_of(*PUSHERS)}
    return {name: channel for name, channel in list_movers(machine).items() if name in pushers}


def list_computed(machine: Machine) -> dict[str, Channel]:
    """Return the pushing actuators that the described controller commands, with their channels."""
    outputs = () if machine.control is None else machine.control.outputs
    pushers = list_pushers(machine).items()
    return {name: channel for name, channel in pushers if channel[1] in outputs}


def list_sensors(machine: Machine) -> dict[str, str]:
    """Return the sensors that a controller can read tick by tick, with their quantity.

    The quantity is `position`, `velocity` or `force`. The force required by a prescribed motion is
    not among them: inverse dynamics computes it after the test.
    """
    prescribed = set(list_movers(machine)) - set(list_pushers(machine))
    prescribed_joints = {machine.components[name].joint for name in prescribed}
    readable = {}
    for name, component in machine.components.items():
        kind = component.quantity
        if not kind or component.channel is None or not component.acts_on:
            continue
        if kind != "force" or not prescribed_joints & {joint for joint, _ in component.acts_on}:
            readable[name] = kind
    return readable


def list_sensed(machine: Machine) -> set[Channel]:
    """Return the channels of the sensors that a controller can read tick by tick."""
    channels = (machine.components[name].channel for name in list_sensors(machine))
    return {channel for channel in channels if channel is not None}


def list_wanted(
    machine: Machine, demands: Mapping[str, Array], controller: object | None
) -> tuple[list[Channel], list[str]]:
    """Return required demands and the actuators that are commanded tick by tick.

    Parameters
    ----------
    machine
        Description of the machine.
    demands
        Demands of the test, by field or topic.field.
    controller
        Controller of the user, which may take any demand; None for the described one.

    Returns
    -------
    tuple
        Channels that have to be demanded, and names of the actuators that a controller commands.

    Raises
    ------
    RigtwinError
        If the user's controller has no actuator to command.
    """
    if controller is None:
        return demanded_channels(machine), list(list_computed(machine))

    def is_demanded(channel: Channel) -> bool:
        return channel[1] in demands or ".".join(channel) in demands

    pushers = list_pushers(machine)
    outputs = [name for name, channel in pushers.items() if not is_demanded(channel)]
    if not outputs:
        raise RigtwinError(f"{machine.name}: a controller has nothing to command in this test")
    # A demand that is not a channel of the machine goes to the controller.
    wanted = [c for name, c in list_movers(machine).items() if name not in outputs]
    known = {name for _, name in wanted} | {".".join(channel) for channel in wanted}
    return wanted + [("/command", name) for name in demands if name not in known], outputs


def check_demands(
    machine: Machine, wanted: Sequence[Channel], demands: Mapping[str, Array]
) -> Columns:
    """Return the demands of a test by channel, checked.

    Parameters
    ----------
    machine
        Description of the machine.
    wanted
        Channels that have to be demanded.
    demands
        Field, or topic.field → signal, shape (ticks,).

    Returns
    -------
    Columns
        Topic → field → signal, shape (ticks,).

    Raises
    ------
    RigtwinError
        If a demand is missing, unknown, not finite, or of another length than the others.
    """
    if not isinstance(demands, Mapping) or not all(isinstance(name, str) for name in demands):
        raise RigtwinError(
            f"{machine.name}: a test demands {demands!r:.60}; expected signals by channel"
        )
    columns: Columns = {}
    names = {f"{topic}.{name}" for topic, name in wanted} | {name for _, name in wanted}
    if unknown := [name for name in demands if name not in names]:
        available = ", ".join(name for _, name in wanted) or "no demand at all"
        raise RigtwinError(
            f"{machine.name}: unknown demand {unknown[0]!r}; this test takes {available}"
        )
    lengths = set()
    for topic, name in wanted:
        demand = demands.get(f"{topic}.{name}", demands.get(name))
        if demand is None:
            required = ", ".join(name for _, name in wanted)
            raise RigtwinError(
                f"{machine.name}: no demand for {topic}.{name}; this test needs {required}"
            )
        try:
            values = np.asarray(demand, float)
        except (TypeError, ValueError, OverflowError):
            values = np.array(math.nan)  # Refused by the next check.
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
