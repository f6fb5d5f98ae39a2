"""Where in frequency, speed, force and time a difference lies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.effect import Motion
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Place
from rigtwin.diagnosis.units import find_unit, spell
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import band

CONCENTRATED = 1.6
"""Times the average power from which a region is where a difference lies."""
STRETCHES = 8
"""Of time."""
SLOW, FAST, LARGE = 0.2, 1.2, 1.2
"""In rms of the motion's speed, or of the force about its mean."""
REST = 0.25
"""s without motion is rest."""
GROWS = 5.0
"""Times the power of the first third that the last third has if a difference grows."""
LEAST = 0.1
"""Share of a difference's power that a region must hold."""
MOST = 0.8
"""Share of a difference's power that lies within a distance after reversals."""
CLEARER = 0.8
"""How clear such a distance must be beside a low speed, which says less."""
TURNED = 0.01
"""Share of the whole motion by which it must go back to have reversed."""


def distance_since_reversal(position: Array) -> Array:
    """Distance since the last reversal, m, shape (ticks,)."""
    least = TURNED * float(np.ptp(position))
    found = np.empty(len(position))
    base = extreme = float(position[0])
    turn, rising = 0, True
    for tick, here in enumerate(position.tolist()):
        if (here >= extreme) if rising else (here <= extreme):
            extreme, turn = here, tick
        elif abs(here - extreme) > least:
            base, rising = extreme, not rising
            found[turn:tick] = np.abs(position[turn:tick] - base)
            extreme, turn = here, tick
        found[tick] = abs(here - base)
    return found


def region(difference: Array, motion: Motion, period: float, unit: str = "m") -> str:
    """The operating region in which a difference, shape (ticks,), is concentrated, or
    `throughout`. unit: of the motion's position, m or rad."""
    speed, force, power = motion.speed, motion.force, difference**2
    total = float(np.sum(power))
    if total <= 0.0:
        return "throughout"
    typical = float(np.sqrt(np.mean(speed**2))) or 1.0
    swing = force - np.mean(force)
    still = np.abs(speed) < 0.02 * typical
    length = max(1, round(REST / period))
    rest = np.convolve(still, np.ones(length), mode="same") >= length - 0.5
    regions: dict[str, NDArray[np.bool_]] = {
        "at rest": rest,
        "velocity reversal": (np.abs(speed) < SLOW * typical) & ~rest,
        "high speed": np.abs(speed) > FAST * typical,
        "large force": np.abs(swing) > LARGE * float(np.std(force)),
    }
    third = len(power) // 3
    if third and float(np.sum(power[-third:])) > GROWS * float(np.sum(power[:third])):
        return "growing with time"
    edges = np.linspace(0, len(power), STRETCHES + 1).astype(int)
    for start, end in pairwise(edges):
        stretch = np.zeros(len(power), bool)
        stretch[start:end] = True
        regions[f"{start * period:.1f} to {end * period:.1f} s"] = stretch
    after = distance_since_reversal(motion.position)
    near = np.sort(after)[
        np.searchsorted(np.cumsum(power[np.argsort(after)]), MOST * total).clip(0, len(power) - 1)
    ]
    factor, shown = find_unit(unit, float(near))
    regions[f"within {spell(factor * float(near), 2)} {shown} after a reversal"] = after <= near
    best, name = 0.0, "throughout"
    for label, inside in regions.items():
        share = float(np.sum(power[inside])) / total
        concentration = share / max(float(np.mean(inside)), 1e-9)
        # A stretch of time is no explanation where a signal's own swing is.
        threshold = CONCENTRATED * (
            1.6 if label.endswith(" s") else CLEARER if label.startswith("within") else 1.0
        )
        if share > LEAST and concentration > threshold and concentration / threshold > best:
            best, name = concentration / threshold, label
    return name


def _unit_of_way(machine: Machine, name: str) -> str:
    """Unit of the coordinate along which a component moves."""
    component = machine.components.get(name)
    if component is not None and component.acts_on:
        return "rad" if component.turns else "m"
    turns = [replay.joint.turns for replay in machine.replays]
    return "rad" if turns and all(turns) else "m"


def locate(
    evidence: Evidence, component: str, share: float, differences: list[Array], words: str = ""
) -> Place:
    """The place of differences, shape (rows, ticks) for each recording, that a component causes."""
    noise = evidence.lines[0].noise
    power = [
        sum(float(np.mean(d[row] ** 2)) for d in differences) / noise[row] ** 2
        for row in range(len(noise))
    ]
    row = int(np.argmax(power))
    longest = int(np.argmax([d.shape[1] for d in differences]))
    difference, recording = differences[longest][row], evidence.recordings[longest]
    motion = evidence.models[longest].motion(component, evidence.plant)
    where = region(difference, motion, recording.period, _unit_of_way(evidence.machine, component))
    low, high = band(difference, recording.period)
    return Place(
        component, share, (low, high), where, words or f"most of it seen by {evidence.names[row]}"
    )
