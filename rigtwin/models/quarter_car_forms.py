"""Ways in which a quarter car's components may be disturbed freely: functions of what they go through."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from controllers import Measurements
from rigtwin.models.forms import polynomials, relaxed
from rigtwin.numerics.arrays import Array

PLACES = (
    "motor",
    "rail",
    "tyre",
    "carriage",
    "ground_cylinder",
    "structure_cylinder",
    *Measurements._fields,
)
"""Components that are disturbed in turn."""
STRENGTH = {"m": 1e-4, "N": 4.0}
"""rms of each disturbance as tried; its response is taken as in proportion to it."""
WAVES = (0.005, 0.008, 0.012, 0.018, 0.028)
"""m; wave lengths of friction along the way."""
RELAXATIONS = (0.02, 0.07, 0.25)
"""s; times in which a tyre may relax."""


@dataclass(frozen=True)
class Signals:
    """What the components go through, shape (ticks,) each; sensed: shape (4, ticks)."""

    time: Array
    sensed: Array
    wheel: Array
    wheel_speed: Array
    wheel_acceleration: Array
    deflection: Array
    travel: Array
    sliding: Array
    force: Array
    period: float


def signals(true: Array, sensed: Array, period: float) -> Signals:
    """true, sensed: rows as in Measurements, shape (4, ticks)."""
    wheel = true[1] - true[2]
    speed = np.gradient(wheel, period)
    deflection = np.maximum(true[0] - wheel, 0.0)
    sliding = np.gradient(true[2], period)
    time = np.arange(true.shape[1]) * period
    acceleration = np.gradient(speed, period)
    return Signals(time, sensed, wheel, speed, acceleration, deflection, true[2], sliding, true[3], period)


def quarter_car_forms(component: str, signals: Signals) -> Iterator[tuple[str, str, Array]]:
    """(what the disturbance goes with, where it enters, the disturbance) of one component."""
    time, period = signals.time, signals.period
    if component in Measurements._fields:
        row = Measurements._fields.index(component)
        for name, signal in polynomials(signals.sensed[row], time, period):
            yield name, component, signal
        if component == "load_cell":
            yield "the carriage's acceleration", component, signals.wheel_acceleration
    elif component in ("ground_cylinder", "structure_cylinder"):
        place = component.removesuffix("_cylinder")
        motion = signals.sensed[("ground_cylinder", "structure_cylinder").index(component)]
        for name, signal in polynomials(motion, time, period):
            yield name, place, signal
        for seconds in RELAXATIONS:
            yield "its past", place, relaxed(motion, seconds, period)
        yield "its load", place, signals.force - np.mean(signals.force)
    elif component == "motor":
        sign = np.sign(signals.sliding)
        for name, signal in polynomials(signals.force, time, period):
            yield name, "voltage", signal
        yield "sliding speed", "voltage", signals.sliding
        yield "sliding speed squared", "voltage", signals.sliding * np.abs(signals.sliding)
        yield "sliding direction", "voltage", sign
        yield "sliding direction growing with time", "voltage", sign * time
        yield "travel", "voltage", signals.travel
    elif component == "rail":
        sign = np.sign(signals.wheel_speed)
        yield "speed", "force", signals.wheel_speed
        yield "speed squared", "force", signals.wheel_speed * np.abs(signals.wheel_speed)
        yield "direction", "force", sign
        yield "direction growing with time", "force", sign * time
        yield "place", "force", signals.wheel
        for wave in WAVES:
            yield "direction and place", "force", sign * np.sin(2 * np.pi * signals.wheel / wave)
            yield "direction and place", "force", sign * np.cos(2 * np.pi * signals.wheel / wave)
    elif component == "tyre":
        squeeze = np.gradient(signals.deflection, period)
        yield "deflection", "force", signals.deflection
        yield "deflection squared", "force", signals.deflection**2
        yield "deflection cubed", "force", signals.deflection**3
        yield "deflection growing with time", "force", signals.deflection * time
        yield "rate of deflection", "force", squeeze
        yield "rate and deflection", "force", squeeze * signals.deflection
        for seconds in RELAXATIONS:
            yield "its past", "force", relaxed(signals.deflection, seconds, period)
    else:
        yield "acceleration", "force", signals.wheel_acceleration
        yield "acceleration growing with time", "force", signals.wheel_acceleration * time
        yield "acceleration squared", "force", signals.wheel_acceleration * np.abs(signals.wheel_acceleration)
