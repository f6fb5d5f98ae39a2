"""Ways in which a joint's components may be disturbed freely: functions of what they go through."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import lfilter

from rigtwin.models.predictor import Form
from rigtwin.numerics.arrays import Array

WAVES = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Of the stroke; wave lengths of what changes along the way."""
RELAXATIONS = (2.0, 8.0, 30.0, 120.0)
"""Ticks; times in which something may relax."""


def relaxed(signal: Array, time_constant: float, period: float) -> Array:
    """The signal through a first-order lag, from where it starts."""
    share = period / (time_constant + period)
    out, _ = lfilter([share], [1.0, share - 1.0], signal, zi=[(1.0 - share) * signal[0]])
    return np.asarray(out)


def polynomials(signal: Array, time: Array, period: float) -> Iterator[tuple[str, Array]]:
    """What a signal may be bent by."""
    centred = signal - np.mean(signal)
    rate = np.gradient(centred, period)
    yield "constant", np.ones_like(signal)
    yield "time", time
    yield "time squared", time**2
    yield "its value", centred
    yield "its value squared", centred**2
    yield "its value cubed", centred**3
    yield "its value growing with time", centred * time
    yield "its rate", rate
    yield "its rate of rate", np.gradient(rate, period)


def joint_forms(kind: str, entry: str, signal: Array, moved: Array, period: float) -> list[Form]:
    """Forms of one component. kind: sensor, motion, drive, mass or guide; signal: what it handles; moved: position,
    velocity and force of the joint, shape (≥ 3, ticks)."""
    return [Form(name, entry, each) for name, each in _forms(kind, signal, moved, period)]


def _forms(kind: str, signal: Array, moved: Array, period: float) -> Iterator[tuple[str, Array]]:
    time = np.arange(len(signal)) * period
    position, speed = moved[0] - np.mean(moved[0]), moved[1]
    acceleration = np.gradient(speed, period)
    if kind in ("sensor", "drive"):
        yield from polynomials(signal, time, period)
    elif kind == "motion":
        yield from polynomials(signal, time, period)
        for ticks in RELAXATIONS:
            yield "its past", relaxed(signal, ticks * period, period)
        yield "direction", np.sign(speed)
    elif kind == "mass":
        yield "acceleration", acceleration
        yield "acceleration growing with time", acceleration * time
        yield "acceleration squared", acceleration * np.abs(acceleration)
    else:
        sign = np.sign(speed)
        typical = float(np.sqrt(np.mean(speed**2))) or 1.0
        yield "constant", np.ones_like(time)
        yield "speed", speed
        yield "speed squared", speed * np.abs(speed)
        yield "speed cubed", speed**3
        yield "speed either way", np.abs(speed)
        yield "direction", np.tanh(speed / (0.02 * typical))
        yield "slow motion's direction", sign * np.exp(-((speed / (0.3 * typical)) ** 2))
        yield "direction growing with time", sign * time
        yield "place", position
        yield "place cubed", position**3
        stroke = float(np.ptp(position)) or 1.0
        for share in WAVES:
            for name, weight in (("place along the stroke", 1.0), ("direction and place", sign)):
                yield name, weight * np.sin(2 * np.pi * position / (share * stroke))
                yield name, weight * np.cos(2 * np.pi * position / (share * stroke))
        for ticks in RELAXATIONS:
            yield "its past", relaxed(speed, ticks * period, period)
