"""Command channels that were not recorded: constant, although the command must have changed.

A constant command alone is no fault, as a test may hold it. It is a fault if the described
controller or a sensor shows that the command changed.
"""

from __future__ import annotations

import numpy as np

from rigtwin.components import Cylinder, PositionActuator
from rigtwin.components.quantity import fields
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import remove_mains, white_noise

LEAST_CHANGE = 1e-9
"""Smallest change of a replayed command, as a share of its size."""
LEAST_MOTION = 10.0
"""Smallest motion of a signal, in units of its noise."""


def dead_commands(
    machine: Machine, recording: RecordedTest, configuration: Configuration
) -> dict[str, str]:
    """Find command channels that are constant although the command changed.

    Parameters
    ----------
    machine, recording, configuration
        Machine, recording and configuration of the twin, as for `find_faults`.

    Returns
    -------
    dict
        Channel → reason in words: its controller, or a sensor that follows it.
    """
    computed: dict[tuple[str, str], Array] | None = None
    reasons: dict[str, str] = {}
    for name, component in machine.components.items():
        channel = component.channel
        if channel is None or channel[0] != "/command" or not recording.has(*channel):
            continue
        if np.ptp(recording.column(*channel)):
            continue
        # The controller is replayed once, and only if a command is constant.
        if computed is None:
            computed = _computed_commands(machine, recording, configuration)
        replayed = computed.get(channel)
        if replayed is not None and np.ptp(replayed) > LEAST_CHANGE * np.max(np.abs(replayed)):
            reasons[".".join(channel)] = "its controller changes it"
        elif (follower := _moving_follower(machine, recording, name)) is not None:
            reasons[".".join(channel)] = f"{follower} moves"
    return reasons


def _computed_commands(
    machine: Machine, recording: RecordedTest, configuration: Configuration
) -> dict[tuple[str, str], Array]:
    """Return the commands of the described controller for the recorded inputs.

    Commands that are not finite are left out; a recording made with a controller of the user's own
    has none.
    """
    control = machine.control
    if control is None or OWN in recording.controller:
        return {}
    inputs = [recording.column(*channel) for channel in control.channels]
    # A dead input may drive an integrator of the controller beyond all limits. Such commands are
    # dropped below.
    with np.errstate(all="ignore"):
        commands = control.replay(configuration.controller, inputs, recording.period)
    return {
        ("/command", name): row
        for name, row in zip(control.outputs, commands, strict=True)
        if np.isfinite(row).all()
    }


def _moving_follower(machine: Machine, recording: RecordedTest, name: str) -> str | None:
    """Return the channel of a position sensor that moves at the joint of a position actuator.

    The motion must exceed noise, mains and the compliance of a cylinder under the measured load.
    None if there is no such sensor.
    """
    mover = machine.components[name]
    follows = mover.component_type in (Cylinder, PositionActuator)
    if not follows or not mover.joint:
        return None
    loads = [recording.column(*row.channel) for row in machine.rows if row.kind == "force"]
    most = max((float(np.ptp(load)) for load in loads), default=0.0)
    # A loaded cylinder yields without a command: at most its largest compliance times the load.
    yields = fields(Cylinder)["compliance"].high * most
    for row in machine.rows:
        if row.kind != "position" or machine.components[row.name].joint != mover.joint:
            continue
        signal = recording.column(*row.channel)
        clean = remove_mains(signal, recording.period, machine.plant.mains.frequency)
        if np.ptp(clean) > yields and np.std(clean) > LEAST_MOTION * white_noise(signal):
            return ".".join(row.channel)
    return None
