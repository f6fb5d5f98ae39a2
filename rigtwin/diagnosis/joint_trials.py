"""Where the search for an effect of a described machine starts: at shares of the swing that the recording itself has."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from rigtwin.components.parts import ForceActuator, ForceSensor, Guide, Mass, PositionActuator, PositionSensor, VelocitySensor
from rigtwin.diagnosis.trial import Swing, Trials
from rigtwin.machine.effects import Effect
from rigtwin.models.predictor import Motion


@dataclass(frozen=True)
class Scales:
    """What a joint goes through: half its stroke m, speed m/s, acceleration m/s², force N, rms each but the first; fastest: its
    highest speed, m/s; period: of a tick, s."""

    stroke: float
    speed: float
    fastest: float
    acceleration: float
    force: float
    period: float

    @property
    def time(self) -> float:
        """s in which the joint goes its stroke."""
        return max(self.stroke / self.speed, self.period)


def scales(motion: Motion, force: float, period: float) -> Scales:
    """force: rms of what is measured of it, N."""
    tiny = 1e-12
    speed = max(float(np.sqrt(np.mean(motion.speed**2))), tiny)
    acceleration = max(float(np.std(np.gradient(motion.speed, period))), tiny)
    fastest = max(float(np.max(np.abs(motion.speed))), tiny)
    own = float(np.sqrt(np.mean(motion.force**2)))
    stroke = max(0.5 * float(np.ptp(motion.position)), tiny)
    return Scales(stroke, speed, fastest, acceleration, max(force, own, tiny), period)


SLOWEST, SLOW = 0.01, 0.35
"""Shares of the highest speed between which Stribeck friction must fade."""
WAVES = 1.5
"""Waves along the stroke that cogging has at least."""
Searched = Callable[[Effect, Any, Scales, Swing], Trials]


def _around(unit: Callable[[Scales], float], shares: Sequence[float], step: float, relative: bool = True) -> Searched:
    """Shares of a unit, on top of what there is nominally unless not relative."""

    def search(effect: Effect, plant: Any, scale: Scales, _swing: Swing) -> Trials:
        parameter = effect.kind.parameters[0]
        meaning = effect.quantities()[parameter]
        there = effect.nominal(plant)[parameter] if relative else 0.0
        size = unit(scale)
        values = dict.fromkeys(min(max(there + share * size, meaning.low), meaning.high) for share in shares)
        return Trials(tuple((value,) for value in values if value != there), (step * size,))

    return search


def _shares(shares: Sequence[float], step: float) -> Searched:
    """Shares of the nominal value, or of what would explain the whole force where there is none."""

    def search(effect: Effect, plant: Any, scale: Scales, _swing: Swing) -> Trials:
        nominal = effect.nominal(plant)[effect.kind.parameters[0]]
        size = nominal if nominal > 0.0 else scale.force / scale.acceleration
        return Trials(tuple((size * share,) for share in shares), (step * size,))

    return search


def _stribeck(_effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    amplitudes = [share * scale.force for share in (-0.3, 0.1, 0.4)]
    speeds = [share * scale.fastest for share in (0.02, 0.06, 0.2)]
    # What does not fade well below the highest speed cannot be told from Coulomb and viscous friction.
    bounds = ((-1e7, 1e7), (SLOWEST * scale.fastest, SLOW * scale.fastest))
    return Trials(tuple(product(amplitudes, speeds)), (0.005 * scale.force, 0.005 * scale.fastest), bounds=bounds)


def _cogging(_effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    # Waves that fit the stroke one and a half to forty times: a longer one is no wave.
    pitches = 2.0 * scale.stroke / np.geomspace(WAVES, 40.0, 24)
    starts = tuple((0.03 * scale.force, float(pitch), phase) for pitch in pitches for phase in (0.0, 0.5 * math.pi))
    bounds = ((0.0, 1e7), (0.02 * scale.stroke, 2.0 * scale.stroke / WAVES), (-6.3, 6.3))
    return Trials(starts, (0.003 * scale.force, 0.002 * scale.stroke, 0.05), quadrature=True, bounds=bounds)


def _two_lags(_effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    sizes = [share * scale.time for share in (0.005, 0.02, 0.06, 0.2)]
    starts = tuple((long, ratio * long) for long in sizes for ratio in (0.2, 0.7))
    return Trials(starts, (0.002 * scale.time, 0.002 * scale.time))


def _resonance(_effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    slowest = 1.0 / (2.0 * math.pi * scale.time)
    starts = tuple(product((slowest * ratio for ratio in (1.5, 4.0, 10.0, 30.0, 80.0)), (0.15, 0.5, 0.9)))
    return Trials(starts, (0.02 * slowest, 0.01))


def _limit(which: str) -> Searched:
    def search(_effect: Effect, _plant: Any, _scale: Scales, swing: Swing) -> Trials:
        values: tuple[float, ...] = getattr(swing, which)
        tried = tuple(dict.fromkeys(max(value, 1e-3 * max(values), 1e-9) for value in values))
        return Trials(tuple((value,) for value in tried), (0.004 * max(float(np.median(tried)), 1e-9),))

    return search


def _deadband(effect: Effect, _plant: Any, scale: Scales, swing: Swing) -> Trials:
    size = scale.stroke if effect.of is PositionActuator else max(swing.largest[0], 1e-12)
    return Trials(tuple((share * size,) for share in (0.003, 0.01, 0.03, 0.1, 0.3)), (0.001 * size,))


def _offset(effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    size = {ForceSensor: scale.force, VelocitySensor: scale.speed}.get(effect.of, scale.stroke)
    return Trials(tuple((share * size,) for share in (-0.2, -0.02, 0.02, 0.2)), (0.002 * size,))


def _force(scale: Scales) -> float:
    return scale.force


def _damping(scale: Scales) -> float:
    return scale.force / scale.speed


def _late(_effect: Effect, _plant: Any, scale: Scales, _swing: Swing) -> Trials:
    """Times of a few ticks, and of a share of the motion's own."""
    times = sorted(
        {*(ticks * scale.period for ticks in (0.5, 2.0, 6.0)), *(share * scale.time for share in (0.012, 0.05, 0.15))}
    )
    return Trials(tuple((time,) for time in times), (min(0.001 * scale.time, 0.25 * scale.period),))


GAIN: Searched = lambda _effect, _plant, _scale, _swing: Trials(((0.8,), (0.93,), (1.07,), (1.2,)), (0.004,))  # noqa: E731
ANY = (ForceActuator, PositionActuator, PositionSensor, VelocitySensor, ForceSensor)
JOINT_TRIALS: dict[tuple[str, type], Searched] = {
    ("mass", Mass): _shares((0.7, 0.9, 0.97, 1.03, 1.1, 1.4), 0.005),
    ("coulomb", Guide): _around(_force, (-0.1, 0.03, 0.1, 0.3, 0.8), 0.005),
    ("viscous", Guide): _around(_damping, (-0.3, -0.05, 0.05, 0.3, 0.9), 0.005),
    ("stiffness", Guide): _around(lambda s: s.force / s.stroke, (-0.3, -0.05, 0.05, 0.3, 0.9), 0.005),
    ("stribeck", Guide): _stribeck,
    ("asymmetry", Guide): _around(_force, (-0.5, -0.1, 0.1, 0.5), 0.005),
    ("offset", Guide): _around(_force, (-0.3, -0.05, 0.05, 0.3), 0.003),
    ("viscous_asymmetry", Guide): _around(_damping, (-0.6, -0.1, 0.1, 0.6), 0.01),
    ("drag", Guide): _around(lambda s: s.force / s.speed**2, (-0.3, -0.05, 0.05, 0.3), 0.005),
    ("backlash", Guide): _around(lambda s: s.stroke, (0.003, 0.01, 0.04, 0.12, 0.4), 0.002),
    ("compliance", Guide): _around(lambda s: s.stroke / s.force, (0.002, 0.01, 0.05, 0.2, 0.8), 0.002),
    ("relaxation", Guide): _late,
    ("cogging", Guide): _cogging,
    ("two_lags", PositionActuator): _two_lags,
    ("resonance", PositionActuator): _resonance,
    **{("gain", of): GAIN for of in ANY},
    **{("lag", of): _late for of in ANY},
    **{("delay", of): _late for of in ANY},
    **{("offset", of): _offset for of in (PositionActuator, PositionSensor, VelocitySensor, ForceSensor)},
    **{("saturation", of): _limit("largest") for of in (ForceActuator, PositionActuator)},
    **{("rate_limit", of): _limit("fastest") for of in (ForceActuator, PositionActuator)},
    **{("deadband", of): _deadband for of in (ForceActuator, PositionActuator)},
}
"""(kind, type of component) → its trials."""
