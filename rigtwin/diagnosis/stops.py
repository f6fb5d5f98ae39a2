"""Limits that a recording reaches: stops at the ends of a joint's range, and limits of commands.

Models of coupled joints have no stops, so that contact with one would be diagnosed as an effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import PUSHERS, PositionActuator, component_of
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.recording import RecordedTest

COMMANDED = (*PUSHERS, PositionActuator)
"""Types of actuators whose commands have declared limits."""
NEAR = 1e-3
"""Distance from an end of the range, as a share of it, within which a joint is at a stop."""


def find_stops(machine: Machine, recordings: Sequence[RecordedTest]) -> list[str]:
    """Find joints that reach a stop which the model does not predict.

    Parameters
    ----------
    machine
        Described machine.
    recordings
        Recordings of the machine.

    Returns
    -------
    list of str
        One line for each joint and recording.
    """
    if not machine.physics.lacks_stops:
        return []
    model = Mechanism(machine.model).model
    notes = []
    for name, component in machine.components.items():
        # The sum or difference of several joints has no range of its own.
        if component.quantity != "position" or len(component.acts_on) != 1:
            continue
        # A sensor may count against its joint. The coefficient is negative then, and sorting puts
        # the transformed ends in order.
        joint, coefficient = component.acts_on[0]
        number = model.joint(joint).id
        if not model.jnt_limited[number] or component.channel is None:
            continue
        low, high = np.sort(model.jnt_range[number] * coefficient)
        for recording in recordings:
            place = recording.column(*component.channel)
            # A joint at its stop is measured with noise about it: hence a margin.
            at_stop = (place < low + NEAR * (high - low)) | (place > high - NEAR * (high - low))
            if at_stop.any():
                first = int(np.argmax(at_stop))
                end = high if place[first] > 0.5 * (low + high) else low
                notes.append(
                    f"{recording.path.name}: {name} is at {place[first]:.4g} {component.unit} "
                    f"after {first * recording.period:.3g} s, and joint {joint} ends at {end:.4g}: "
                    "no stop is predicted"
                )
    return notes


def find_cut_commands(machine: Machine, recordings: Sequence[RecordedTest]) -> list[str]:
    """Find commands that exceed the limits of their actuators.

    Parameters
    ----------
    machine
        Described machine.
    recordings
        Recordings of the machine.

    Returns
    -------
    list of str
        One line for each actuator and recording.
    """
    notes = []
    for name, component in machine.components.items():
        if component.channel is None or component.component_type not in COMMANDED:
            continue
        actuator = component_of(machine.plant, name, *COMMANDED)
        low, high = actuator.command_low, actuator.command_high
        for recording in recordings:
            if not recording.has(*component.channel):
                continue
            command = recording.column(*component.channel)
            beyond = float(np.mean((command < low) | (command > high)))
            if beyond > 0.0:
                notes.append(
                    f"{recording.path.name}: {name} takes commands from {low:g} to {high:g}, and "
                    f"{100.0 * beyond:.3g} % of the ticks are beyond: they are cut off there"
                )
    return notes
