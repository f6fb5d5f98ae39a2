"""Basis functions of an unknown input: functions of a component's motion, force, past and time.

Where no effect of the library explains a gap, a linear combination of these functions is fitted as
a free disturbance of one component. It shows where the disturbance enters and what it correlates
with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.models.model import Form
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.filters import low_pass

WAVES = (0.005, 0.008, 0.012, 0.018, 0.028)
"""Wavelengths of the rail's friction along its length, m."""
STROKE_WAVES = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Wavelengths of forces along a guide, as shares of the stroke."""
RELAXATIONS = (0.02, 0.07, 0.25)
"""Relaxation times of a tyre or a cylinder, s."""
TICK_RELAXATIONS = (2.0, 8.0, 30.0, 120.0)
"""Relaxation times of a component of any machine, in ticks."""
NamedSignals = Iterator[tuple[str, Array]]


@dataclass(frozen=True)
class Passage:
    """Signals of a component over a recording.

    Attributes
    ----------
    signal : Array
        Signal that the component handles: reading, force or position, shape (ticks,).
    position, speed, load : Array
        Motion and load of the component, m, m/s and N, shape (ticks,).
    period : float
        Time from tick to tick, s.
    """

    signal: Array
    position: Array
    speed: Array
    load: Array
    period: float

    @property
    def time(self) -> Array:
        """Time since the start, s, shape (ticks,)."""
        return np.arange(len(self.signal)) * self.period

    @property
    def acceleration(self) -> Array:
        """Acceleration, m/s², shape (ticks,)."""
        return np.gradient(self.speed, self.period)


def _past(signal: Array, seconds: Sequence[float], period: float) -> NamedSignals:
    for time_constant in seconds:
        yield "its recent past", low_pass(signal, time_constant, period)


def _ticks(period: float) -> list[float]:
    return [ticks * period for ticks in TICK_RELAXATIONS]


def _distortion(passage: Passage) -> NamedSignals:
    """Yield distortions of a signal: gain, drift, nonlinearity and delay."""
    # A delay, to first order, adds the negative rate; a lag of second order the second derivative.
    time = passage.time
    centred = passage.signal - np.mean(passage.signal)
    rate = np.gradient(centred, passage.period)
    yield "a constant", np.ones_like(time)
    yield "time", time
    yield "time squared", time**2
    yield "its value", centred
    yield "its value squared", centred**2
    yield "its value cubed", centred**3
    yield "its value growing with time", centred * time
    yield "its rate", rate
    yield "its rate of rate", np.gradient(rate, passage.period)


def _inertia(passage: Passage) -> NamedSignals:
    acceleration = passage.acceleration
    yield "acceleration", acceleration
    yield "acceleration growing with time", acceleration * passage.time
    yield "acceleration squared", acceleration * np.abs(acceleration)


def _friction(passage: Passage) -> NamedSignals:
    """Yield functions that dry and viscous friction may correlate with."""
    sign = np.sign(passage.speed)
    yield "speed", passage.speed
    yield "speed squared", passage.speed * np.abs(passage.speed)
    yield "direction", sign
    yield "direction growing with time", sign * passage.time
    yield "place", passage.position


def _motor(passage: Passage) -> NamedSignals:
    yield from _distortion(passage)
    yield from _friction(passage)


def _rail(passage: Passage) -> NamedSignals:
    yield from _friction(passage)
    sign = np.sign(passage.speed)
    # Sine and cosine of each wavelength together represent any phase.
    for wave in WAVES:
        yield "direction and place", sign * np.sin(2 * np.pi * passage.position / wave)
        yield "direction and place", sign * np.cos(2 * np.pi * passage.position / wave)


def _tyre(passage: Passage) -> NamedSignals:
    deflection, squeeze = passage.signal, np.gradient(passage.signal, passage.period)
    yield "deflection", deflection
    yield "deflection squared", deflection**2
    yield "deflection cubed", deflection**3
    yield "deflection growing with time", deflection * passage.time
    yield "rate of deflection", squeeze
    yield "rate and deflection", squeeze * deflection
    yield from _past(deflection, RELAXATIONS, passage.period)


def _load_cell(passage: Passage) -> NamedSignals:
    yield from _distortion(passage)
    yield "the carriage's acceleration", passage.acceleration


def _cylinder(passage: Passage) -> NamedSignals:
    yield from _distortion(passage)
    yield from _past(passage.signal, RELAXATIONS, passage.period)
    yield "its load", passage.load - np.mean(passage.load)


def _position(passage: Passage) -> NamedSignals:
    """Yield disturbances of a joint's commanded or measured position."""
    yield from _distortion(passage)
    yield from _past(passage.signal, _ticks(passage.period), passage.period)
    yield "direction", np.sign(passage.speed)


def _guide(passage: Passage) -> NamedSignals:
    speed, position = passage.speed, passage.position - np.mean(passage.position)
    sign = np.sign(speed)
    typical = float(np.sqrt(np.mean(speed**2))) or 1.0
    yield "a constant", np.ones_like(speed)
    yield "speed", speed
    yield "speed squared", speed * np.abs(speed)
    yield "speed cubed", speed**3
    yield "speed either way", np.abs(speed)
    # A smooth sign: the exact tick of a reversal is not known to better than the noise.
    yield "direction", np.tanh(speed / (0.02 * typical))
    yield "slow motion's direction", sign * np.exp(-((speed / (0.3 * typical)) ** 2))
    yield "direction growing with time", sign * passage.time
    yield "place", position
    yield "place cubed", position**3
    stroke = float(np.ptp(position)) or 1.0
    for share in STROKE_WAVES:
        for name, weight in (("place along the stroke", 1.0), ("direction and place", sign)):
            yield name, weight * np.sin(2 * np.pi * position / (share * stroke))
            yield name, weight * np.cos(2 * np.pi * position / (share * stroke))
    yield from _past(speed, _ticks(passage.period), passage.period)


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
"""Role of a component → basis functions of its disturbances."""


def forms(role: str, entry: str, passage: Passage) -> list[Form]:
    """Return all basis functions of one component's disturbance.

    Parameters
    ----------
    role
        Role of the component in the machine, a key of `BASES`.
    entry
        Place where the disturbance enters, as `Model.predict_disturbed` takes it.
    by
        Signals of the component.

    Returns
    -------
    list of Form
        One form for each basis function.
    """
    return [Form(name, entry, signal) for name, signal in BASES[role](passage)]
