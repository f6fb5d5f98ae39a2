"""Limits that a recording reaches: stops at the ends of a joint's range, which models of joints
that act on each other lack, and commands that an actuator does not take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import PUSHERS, PositionActuator, measures
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.recording import Recording

NEAR = 1e-3
"""Share of its range within which of its end a joint is at a stop."""


def find_stops(machine: Machine, recordings: Sequence[Recording]) -> list[str]:
    """Which joints come to a stop that nothing predicts.

    Parameters
    ----------
    machine
        Its description.
    recordings
        Of it.

    Returns
    -------
    list of str
        A line for each joint and recording.
    """
    if not machine.physics.lacks_stops:
        return []
    model = Mechanism(machine.model).model
    found = []
    for name, component in machine.components.items():
        if measures(getattr(machine.plant, name)) != "position" or len(component.acts_on) != 1:
            continue
        joint, coefficient = component.acts_on[0]
        number = model.joint(joint).id
        if not model.jnt_limited[number] or component.channel is None:
            continue
        low, high = np.sort(model.jnt_range[number] * coefficient)
        for recording in recordings:
            place = recording.column(*component.channel)
            at_stop = (place < low + NEAR * (high - low)) | (place > high - NEAR * (high - low))
            if at_stop.any():
                first = int(np.argmax(at_stop))
                end = high if place[first] > 0.5 * (low + high) else low
                found.append(
                    f"{recording.path.name}: {name} is at {place[first]:.4g} {component.unit} "
                    f"after {first * recording.period:.3g} s, and joint {joint} ends at {end:.4g}: "
                    "no stop is predicted"
                )
    return found


def find_cut_commands(machine: Machine, recordings: Sequence[Recording]) -> list[str]:
    """Which commands go beyond what their actuators take.

    Parameters
    ----------
    machine
        Its description.
    recordings
        Of it.

    Returns
    -------
    list of str
        A line for each actuator and recording.
    """
    found = []
    for name, component in machine.components.items():
        actuator = getattr(machine.plant, name)
        if not isinstance(actuator, (*PUSHERS, PositionActuator)):
            continue
        if component.channel is None:
            continue
        low, high = actuator.command_low, actuator.command_high
        for recording in recordings:
            if not recording.has(*component.channel):
                continue
            command = recording.column(*component.channel)
            beyond = float(np.mean((command < low) | (command > high)))
            if beyond > 0.0:
                found.append(
                    f"{recording.path.name}: {name} takes commands from {low:g} to {high:g}, and "
                    f"{100.0 * beyond:.3g} % of the ticks are beyond: they are cut off there"
                )
    return found
