"""Command channels that were not recorded: they stay put, although something shows that what was
commanded did not. A command that is constant by itself is a test."""

from __future__ import annotations

import numpy as np

from rigtwin.components import Cylinder, PositionActuator
from rigtwin.components.quantity import fields
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import remove_mains, white_noise

CHANGES = 1e-9
"""Share of itself by which a command changes at least."""
MOVES = 10.0
"""Times its noise that a signal moves at least."""


def dead_commands(
    machine: Machine, recording: Recording, configuration: Configuration
) -> dict[str, str]:
    """Command channels that are constant and cannot have been.

    Parameters
    ----------
    machine, recording, configuration
        As of `find_faults`.

    Returns
    -------
    dict
        Channel → what shows that it changed, in words: its controller, or a sensor that follows it.
    """
    computed: dict[tuple[str, str], Array] | None = None
    found: dict[str, str] = {}
    for name, component in machine.components.items():
        channel = component.channel
        if channel is None or channel[0] != "/command" or not recording.has(*channel):
            continue
        if np.ptp(recording.column(*channel)):
            continue
        if computed is None:
            computed = _computed_commands(machine, recording, configuration)
        replayed = computed.get(channel)
        if replayed is not None and np.ptp(replayed) > CHANGES * np.max(np.abs(replayed)):
            found[".".join(channel)] = "its controller changes it"
        elif (follower := _moving_follower(machine, recording, name)) is not None:
            found[".".join(channel)] = f"{follower} moves"
    return found


def _computed_commands(
    machine: Machine, recording: Recording, configuration: Configuration
) -> dict[tuple[str, str], Array]:
    """What the described controller makes of the recorded inputs."""
    control = machine.control
    if control is None or OWN in recording.controller:
        return {}
    inputs = [recording.column(*channel) for channel in control.channels]
    with np.errstate(all="ignore"):
        commands = control.replay(configuration.controller, inputs, recording.period)
    return {
        ("/command", name): row
        for name, row in zip(control.outputs, commands, strict=True)
        if np.isfinite(row).all()
    }


def _moving_follower(machine: Machine, recording: Recording, name: str) -> str | None:
    """The channel of a sensor that moves with a position actuator, by more than noise, mains and a
    plate that yields to its load."""
    mover = machine.components[name]
    follows = isinstance(getattr(machine.plant, name), Cylinder | PositionActuator)
    if not follows or not mover.joint:
        return None
    loads = [recording.column(*each.channel) for each in machine.rows if each.kind == "force"]
    most = max((float(np.ptp(load)) for load in loads), default=0.0)
    yields = fields(Cylinder)["compliance"].high * most
    for row in machine.rows:
        if row.kind != "position" or machine.components[row.name].joint != mover.joint:
            continue
        signal = recording.column(*row.channel)
        clean = remove_mains(signal, recording.period, machine.plant.mains.frequency)
        if np.ptp(clean) > yields and np.std(clean) > MOVES * white_noise(signal):
            return ".".join(row.channel)
    return None
