"""Joints that did not move although they were pushed: bounds on friction, and no values.

Where nothing moves, every effect that stops a motion explains the data equally well: a friction of
any size above the push, a saturated actuator, a blocked joint. Only the push itself is known, which
the dry friction was able to hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import PUSHERS, Guide, Pusher
from rigtwin.components.plant import parameter_of
from rigtwin.components.servo import push_all, push_law, pusher_of
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.diagnosis.units import say
from rigtwin.diagnosis.words import name_part
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import smallest_step, white_noise

BLOCKS = 50
"""Number of parts of a recording whose mean positions are compared."""
NOISES = 6.0
"""Range of the parts' mean positions that noise may have, in its standard errors."""
STEPS = 2.0
"""Range that a sensor's resolution may have, in its smallest steps."""
FEW = 8
"""Number of different positions up to which a sensor is coarse."""
PUSHED = 1.5
"""Factor on the nominal dry friction that a push must exceed for the twin to move."""


@dataclass(frozen=True)
class Standstill:
    """A joint that did not move although it was pushed.

    Attributes
    ----------
    sensor, guide, actuator
        Components of the joint: what saw no motion, what held it, and what pushed.
    push
        Largest force of the actuator, N or Nm.
    travel
        Range of the measured positions, m or rad.
    """

    sensor: str
    guide: str
    actuator: str
    push: float
    travel: float


def find_standstill(machine: Machine, recordings: Sequence[RecordedTest]) -> tuple[Standstill, ...]:
    """Find joints that stood still although the twin's actuators would have moved them.

    Parameters
    ----------
    machine
        Machine of the recordings.
    recordings
        Recordings that are fitted.

    Returns
    -------
    tuple of Standstill
        One for each joint, or empty unless every observed joint stood still.
    """
    standing = []
    for replay in machine.replays:
        for row in replay.rows:
            still = _stands(machine, replay, row, recordings)
            if still is None:
                return ()
            standing.append(still)
    return tuple(standing)


def describe_standstill(machine: Machine, standing: Sequence[Standstill]) -> str:
    """Describe what a standstill bounds, in one sentence."""
    parts = []
    for still in standing:
        turns = machine.components[still.sensor].turns
        force, length = ("Nm", "rad") if turns else ("N", "m")
        parts.append(
            f"{still.sensor} stayed within {say(still.travel, length)} while the "
            f"{name_part(still.actuator)} pushed with up to {say(still.push, force)}, so dry "
            f"friction at the {name_part(still.guide)} is at least that"
        )
    return (
        f"Nothing moved: {'; '.join(parts)}. Or the joint is blocked, the actuator is off, or the "
        "sensor is dead: these data cannot tell."
    )


def _stands(
    machine: Machine, replay: ReplayOf, row: Row, recordings: Sequence[RecordedTest]
) -> Standstill | None:
    """Return the standstill of one observed joint; None if it moved or was not pushed."""
    components, plant = machine.components, machine.plant
    if row.kind != "position" or replay.closed or row.name not in components:
        return None
    joint = components[row.name].joint
    pushers = [
        name
        for name in replay.moved_by
        if components[name].joint == joint and components[name].component_type in PUSHERS
    ]
    guides = [
        name
        for name, known in components.items()
        if known.joint == joint and known.component_type is Guide
    ]
    if len(pushers) != 1 or not guides:
        return None
    channel = components[pushers[0]].channel
    if channel is None or not all(r.has(*channel) and r.has(*row.channel) for r in recordings):
        return None
    pushes, travels = [], []
    for recording in recordings:
        position = recording.column(*row.channel)
        if not _is_still(position):
            return None
        travels.append(float(np.ptp(position)))
        pushes.append(_push(pusher_of(plant, pushers[0]), recording.column(*channel), position))
    held = parameter_of(plant, guides[0], "coulomb")
    # A push that the nominal friction holds is no observation: the twin would stand still as well.
    if max(pushes) <= PUSHED * held or max(pushes) == 0.0:
        return None
    return Standstill(row.name, guides[0], pushers[0], max(pushes), max(travels))


def _is_still(position: Array) -> bool:
    """Return whether a position shows noise and resolution alone."""
    if np.ptp(position) == 0.0:
        return True
    parts = np.array_split(position, BLOCKS)
    # Means average the noise out and leave a slow drift. The range of 50 normal deviates is 4.5
    # standard deviations on average, and hardly ever more than `NOISES`.
    span = float(np.ptp([np.mean(part) for part in parts]))
    noise = white_noise(position) / np.sqrt(len(parts[-1]))
    values = np.unique(position)
    # Few values are those of a coarse sensor, whose step is the least of their differences.
    coarse = float(np.min(np.diff(values))) if len(values) <= FEW else smallest_step(position)
    return span <= max(NOISES * noise, STEPS * coarse)


def _push(actuator: Pusher, command: Array, position: Array) -> float:
    """Return the largest change of force with which an actuator pushed, N."""
    forces = push_all(
        push_law(actuator), actuator.gain * command, position, np.zeros_like(position)
    )
    return float(np.max(np.abs(forces)))
