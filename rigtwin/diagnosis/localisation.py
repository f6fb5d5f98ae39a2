"""Location of a difference in frequency, operating region and time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.scales import Motion
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Place
from rigtwin.diagnosis.units import find_unit, spell
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import band

CONCENTRATED = 1.6
"""Ratio of the power density inside a region to the average from which the region is named."""
STRETCHES = 8
"""Stretches of equal length into which a recording is divided."""
SLOW, FAST, LARGE = 0.2, 1.2, 1.2
"""Limits of slow and fast motion in rms speeds, and of a large force in standard deviations."""
STANDSTILL = 0.02
"""Share of the rms speed below which a component counts as standing still."""
REST = 0.25
"""Duration without motion from which a component is at rest, s."""
GROWS = 5.0
"""Ratio of the power in the last third to that in the first from which a difference grows."""
LEAST = 0.1
"""Share of a difference's power that a region must hold."""
MOST = 0.8
"""Share of a difference's power that defines the distance after a reversal."""
CLEARER = 0.8
"""Factor on the threshold of a distance after reversals, which says more than a low speed."""
STRETCH_FACTOR = 1.6
"""Factor on the threshold of a stretch of time, which is no physical cause."""
TURNED = 0.01
"""Share of the whole stroke by which a motion must go back to have reversed."""


def distance_since_reversal(position: Array) -> Array:
    """Return the distance travelled since the last reversal of the motion.

    A turning point counts only once the motion went back by `TURNED` of the stroke, so noise at
    standstill makes no reversals. The ticks between the turning point and its detection are then
    corrected.

    Parameters
    ----------
    position
        Position, m or rad, shape (ticks,).

    Returns
    -------
    array
        Distance in the unit of the position, shape (ticks,).
    """
    least = TURNED * float(np.ptp(position))
    distance = np.empty(len(position))
    # `base` is the last turning point, and `extreme` the furthest position since, which becomes the
    # next turning point once the motion has come back from it.
    base = extreme = float(position[0])
    turn, rising = 0, True
    for tick, current in enumerate(position.tolist()):
        if (current >= extreme) if rising else (current <= extreme):
            extreme, turn = current, tick
        elif abs(current - extreme) > least:
            base, rising = extreme, not rising
            distance[turn:tick] = np.abs(position[turn:tick] - base)
            extreme, turn = current, tick
        distance[tick] = abs(current - base)
    return distance


def region(difference: Array, motion: Motion, period: float, unit: str = "m") -> str:
    """Name the operating region in which a difference is concentrated.

    Parameters
    ----------
    difference
        Measured minus predicted, shape (ticks,).
    motion
        Motion of the component.
    period
        Duration of a tick, s.
    unit
        SI unit of the component's position, "m" or "rad".

    Returns
    -------
    str
        Region such as "velocity reversal", or "throughout".
    """
    power = difference**2
    total = float(np.sum(power))
    if total <= 0.0:
        return "throughout"
    # Growth is asked for first: a twin that diverges would otherwise be located in the last stretch
    # of time.
    third = len(power) // 3
    if third and float(np.sum(power[-third:])) > GROWS * float(np.sum(power[:third])):
        return "growing with time"
    best, name = 0.0, "throughout"
    for label, inside, factor in _regions(power, motion, period, unit):
        # The concentration is the power density inside relative to the average; 1 for power that is
        # spread evenly over time.
        share = float(np.sum(power[inside])) / total
        concentration = share / max(float(np.mean(inside)), 1e-9)
        threshold = CONCENTRATED * factor
        if share > LEAST and concentration > threshold and concentration / threshold > best:
            best, name = concentration / threshold, label
    return name


def _regions(
    power: Array, motion: Motion, period: float, unit: str
) -> list[tuple[str, NDArray[np.bool_], float]]:
    """Label, ticks and threshold factor of every region; the first of equals is preferred."""
    speed, force = motion.speed, motion.force
    # The speed limits are relative, and a component that never moves has no speed to relate them
    # to.
    typical = float(np.sqrt(np.mean(speed**2))) or 1.0
    swing = force - np.mean(force)
    still = np.abs(speed) < STANDSTILL * typical
    length = max(1, round(REST / period))
    # All of the `length` ticks about one must be still. The sum is a float, hence the half.
    rest = np.convolve(still, np.ones(length), mode="same") >= length - 0.5
    regions: list[tuple[str, NDArray[np.bool_], float]] = [
        ("at rest", rest, 1.0),
        ("velocity reversal", (np.abs(speed) < SLOW * typical) & ~rest, 1.0),
        ("high speed", np.abs(speed) > FAST * typical, 1.0),
        ("large force", np.abs(swing) > LARGE * float(np.std(force)), 1.0),
    ]
    edges = np.linspace(0, len(power), STRETCHES + 1).astype(int)
    for start, end in pairwise(edges):
        stretch = np.zeros(len(power), bool)
        stretch[start:end] = True
        label = f"{start * period:.1f} to {end * period:.1f} s"
        regions.append((label, stretch, STRETCH_FACTOR))
    # Play and compliance act over a distance after each reversal, at whatever speed that is passed.
    distance = distance_since_reversal(motion.position)
    order = np.argsort(distance)
    # With the ticks in the order of their distance, this is the distance within which `MOST` of the
    # power lies.
    last = np.searchsorted(np.cumsum(power[order]), MOST * float(np.sum(power)))
    reach = np.sort(distance)[last.clip(0, len(power) - 1)]
    factor, shown = find_unit(unit, float(reach))
    gap = "" if shown == "°" else " "
    label = f"within {spell(factor * float(reach), 2)}{gap}{shown} after a reversal"
    return [*regions, (label, distance <= reach, CLEARER)]


def is_angular(machine: Machine, component: str) -> bool:
    """Return whether a component's position is an angle.

    Parameters
    ----------
    machine
        Machine that has the component.
    component
        Name of the component. A name that the machine lacks counts as sliding.

    Returns
    -------
    bool
        True if the component, or the joint that it acts on, turns.
    """
    described = machine.components.get(component)
    turning = {replay.joint.name for replay in machine.replays if replay.joint.turns}
    return described is not None and (described.turns or described.joint in turning)


def locate(
    evidence: Evidence, component: str, share: float, differences: list[Array], words: str = ""
) -> Place:
    """Locate the differences that a component causes.

    The sensor that shows most power and the longest recording stand for all.

    Parameters
    ----------
    evidence
        Recordings.
    component
        Name of the component.
    share
        Share of the gap's power that the component causes.
    differences
        Differences of each recording, SI, shape (rows, ticks).
    words
        Evidence of the place. Defaults to the name of the sensor that shows most.

    Returns
    -------
    Place
        Frequencies and operating region of the difference.
    """
    noise = evidence.lines[0].noise
    # The sensors' noise makes signals of different units comparable.
    power = [
        sum(float(np.mean(d[row] ** 2)) for d in differences) / noise[row] ** 2
        for row in range(len(noise))
    ]
    row = int(np.argmax(power))
    longest = int(np.argmax([d.shape[1] for d in differences]))
    difference, recording = differences[longest][row], evidence.recordings[longest]
    motion = evidence.models[longest].motion(component, evidence.plant)
    unit = "rad" if is_angular(evidence.machine, component) else "m"
    where = region(difference, motion, recording.period, unit)
    low, high = band(difference, recording.period)
    return Place(
        component, share, (low, high), where, words or f"mostly seen by {evidence.names[row]}"
    )
