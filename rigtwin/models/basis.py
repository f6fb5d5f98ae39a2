"""Ways in which a component may be disturbed freely: functions of what it goes through.

Where no effect of the library explains a gap, the combination of these that does says where it
enters and what it goes with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.models.model import Form
from rigtwin.numerics.arrays import Array

WAVES = (0.005, 0.008, 0.012, 0.018, 0.028)
"""m; wave lengths of the rail's friction along the way."""
STROKE_WAVES = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Of the stroke; wave lengths of what changes along a guide."""
RELAXATIONS = (0.02, 0.07, 0.25)
"""s; times in which a tyre or a cylinder may relax."""
TICK_RELAXATIONS = (2.0, 8.0, 30.0, 120.0)
"""Ticks; times in which a part of any machine may relax."""
NamedSignals = Iterator[tuple[str, Array]]


@dataclass(frozen=True)
class Passage:
    """What a component goes through, shape (ticks,) each: the signal that it handles, position m,
    speed m/s, load N; period: of a tick, s."""

    signal: Array
    position: Array
    speed: Array
    load: Array
    period: float

    @property
    def time(self) -> Array:
        return np.arange(len(self.signal)) * self.period

    @property
    def acceleration(self) -> Array:
        return np.gradient(self.speed, self.period)


def low_pass(signal: Array, time_constant: float, period: float) -> Array:
    """The signal through a first-order lag, from where it starts.

    Parameters
    ----------
    signal
        Shape (ticks,).
    time_constant, period
        s.

    Returns
    -------
    array
        Shape (ticks,).
    """
    share = period / (time_constant + period)
    start = [(1.0 - share) * signal[0]]
    from scipy.signal import lfilter  # Late: it takes a second.

    out, _ = lfilter([share], [1.0, share - 1.0], signal, zi=start)
    return np.asarray(out)


def _past(signal: Array, seconds: Sequence[float], period: float) -> NamedSignals:
    for each in seconds:
        yield "its recent past", low_pass(signal, each, period)


def _ticks(period: float) -> list[float]:
    return [ticks * period for ticks in TICK_RELAXATIONS]


def _distortion(by: Passage) -> NamedSignals:
    """What a signal may be bent by."""
    time = by.time
    centred = by.signal - np.mean(by.signal)
    rate = np.gradient(centred, by.period)
    yield "a constant", np.ones_like(time)
    yield "time", time
    yield "time squared", time**2
    yield "its value", centred
    yield "its value squared", centred**2
    yield "its value cubed", centred**3
    yield "its value growing with time", centred * time
    yield "its rate", rate
    yield "its rate of rate", np.gradient(rate, by.period)


def _inertia(by: Passage) -> NamedSignals:
    acceleration = by.acceleration
    yield "acceleration", acceleration
    yield "acceleration growing with time", acceleration * by.time
    yield "acceleration squared", acceleration * np.abs(acceleration)


def _friction(by: Passage) -> NamedSignals:
    """What dry and viscous friction may go with."""
    sign = np.sign(by.speed)
    yield "speed", by.speed
    yield "speed squared", by.speed * np.abs(by.speed)
    yield "direction", sign
    yield "direction growing with time", sign * by.time
    yield "place", by.position


def _motor(by: Passage) -> NamedSignals:
    yield from _distortion(by)
    yield from _friction(by)


def _rail(by: Passage) -> NamedSignals:
    yield from _friction(by)
    sign = np.sign(by.speed)
    for wave in WAVES:
        yield "direction and place", sign * np.sin(2 * np.pi * by.position / wave)
        yield "direction and place", sign * np.cos(2 * np.pi * by.position / wave)


def _tyre(by: Passage) -> NamedSignals:
    deflection, squeeze = by.signal, np.gradient(by.signal, by.period)
    yield "deflection", deflection
    yield "deflection squared", deflection**2
    yield "deflection cubed", deflection**3
    yield "deflection growing with time", deflection * by.time
    yield "rate of deflection", squeeze
    yield "rate and deflection", squeeze * deflection
    yield from _past(deflection, RELAXATIONS, by.period)


def _load_cell(by: Passage) -> NamedSignals:
    yield from _distortion(by)
    yield "the carriage's acceleration", by.acceleration


def _cylinder(by: Passage) -> NamedSignals:
    yield from _distortion(by)
    yield from _past(by.signal, RELAXATIONS, by.period)
    yield "its load", by.load - np.mean(by.load)


def _position(by: Passage) -> NamedSignals:
    """A joint's position that is commanded or measured."""
    yield from _distortion(by)
    yield from _past(by.signal, _ticks(by.period), by.period)
    yield "direction", np.sign(by.speed)


def _guide(by: Passage) -> NamedSignals:
    speed, position = by.speed, by.position - np.mean(by.position)
    sign = np.sign(speed)
    typical = float(np.sqrt(np.mean(speed**2))) or 1.0
    yield "a constant", np.ones_like(speed)
    yield "speed", speed
    yield "speed squared", speed * np.abs(speed)
    yield "speed cubed", speed**3
    yield "speed either way", np.abs(speed)
    yield "direction", np.tanh(speed / (0.02 * typical))
    yield "slow motion's direction", sign * np.exp(-((speed / (0.3 * typical)) ** 2))
    yield "direction growing with time", sign * by.time
    yield "place", position
    yield "place cubed", position**3
    stroke = float(np.ptp(position)) or 1.0
    for share in STROKE_WAVES:
        for name, weight in (("place along the stroke", 1.0), ("direction and place", sign)):
            yield name, weight * np.sin(2 * np.pi * position / (share * stroke))
            yield name, weight * np.cos(2 * np.pi * position / (share * stroke))
    yield from _past(speed, _ticks(by.period), by.period)


BASES: dict[str, Callable[[Passage], NamedSignals]] = {
    "sensor": _distortion,
    "load cell": _load_cell,
    "force": _distortion,
    "position": _position,
    "cylinder": _cylinder,
    "motor": _motor,
    "rail": _rail,
    "guide": _guide,
    "tyre": _tyre,
    "mass": _inertia,
}
"""Role of a component → the functions that may disturb it."""


def forms(role: str, entry: str, by: Passage) -> list[Form]:
    """All ways to disturb one component freely.

    Parameters
    ----------
    role
        Its part in the machine, see `BASES`.
    entry
        Where the disturbance enters the model.
    by
        What the component goes through.

    Returns
    -------
    list of Form
        One a function.
    """
    return [Form(name, entry, signal) for name, signal in BASES[role](by)]
