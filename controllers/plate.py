"""Delay compensation of the plate: a linear law between structure model and cylinder.

The law is designed from the cylinder model in the settings. The limits judge its commands like all
others.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.closed_loop import ClosedLoop, transfer, with_lag
from controllers.compiled import compilable
from controllers.forward_prediction import forward_prediction
from controllers.inverse_model import inverse_coefficients
from controllers.kalman_inverse import ActuatorDynamics, Weights, kalman_inverse
from controllers.lag_compensation import lag_compensation
from controllers.linear_law import LinearLaw, step_linear
from controllers.settings import PlateCompensator, Settings

Array = NDArray[np.float64]
FADE = 0.01
"""Time over which the compensation fades in, s.

Noise and hum of the first reading would otherwise make the command jump.
"""
LONGEST = 0.5
"""Longest delay that forward prediction or lag compensation removes, s."""
DERIVATIVES = 3
"""Number of states of the desired motion in the Kalman filter."""
NO_LAW = LinearLaw(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([1.0, 0.0]))


class Plate(NamedTuple):
    """Delay compensator of the plate.

    Attributes
    ----------
    law : LinearLaw
        Law of positions relative to the start of the test. It has no states if there is no
        compensation.
    set_in : float
        Increase of the compensation's share per tick while it fades in.
    """

    law: LinearLaw
    set_in: float


def cylinder_model(settings: Settings) -> ClosedLoop:
    """Return the model of the structure cylinder in the settings."""
    values = settings._asdict()
    return ClosedLoop(*(values[f"plate_{name}"] for name in ClosedLoop._fields))


def plate(settings: Settings, period: float) -> Plate:
    """Return the compensator of some settings; period: s.

    Raises ValueError if the cylinder model allows no such compensator.
    """
    kind = PlateCompensator(settings.plate_compensator)
    if kind == PlateCompensator.NONE:
        return compensation(NO_LAW, period)
    # Only the Kalman inverse uses the weights; the other laws need the cylinder alone.
    weights = settings.plate_effort, settings.plate_roughness, settings.plate_noise
    return compensation(_law(kind, cylinder_model(settings), weights, period), period)


def compensation(law: LinearLaw, period: float) -> Plate:
    """Return a compensator with a given law; period: s."""
    contiguous = LinearLaw(*(np.ascontiguousarray(part, dtype=np.float64) for part in law))
    # Compile now: in the first tick it would take far longer than a period.
    if len(contiguous.a):
        step_linear(contiguous, np.zeros(len(contiguous.a)), 0.0, 0.0)
    return Plate(contiguous, period / FADE)


def total_delay(loop: ClosedLoop) -> float:
    """Return the delay of a cylinder for slow motions, s: the slope of its phase at 0 Hz."""
    return inverse_coefficients(*transfer(loop), loop.delay, 1)[1] * loop.gain


@lru_cache(maxsize=64)
def _law(
    kind: PlateCompensator, loop: ClosedLoop, weights: tuple[float, float, float], period: float
) -> LinearLaw:
    """Return the law of a compensator; equal settings share it. Raises ValueError, see `plate`."""
    if kind in (PlateCompensator.FORWARD_PREDICTION, PlateCompensator.LAG):
        delay = total_delay(loop)
        if not 0.0 < delay <= LONGEST:
            raise ValueError(
                f"controller.plate_b2 to plate_delay describe a cylinder that is late by {delay:g} "
                f"s; {kind.label} takes away more than 0 and up to {LONGEST:g} s"
            )
        if kind == PlateCompensator.LAG:
            return lag_compensation(delay, period)
        return forward_prediction(delay, period)
    actuator = ActuatorDynamics(*with_lag(loop), loop.delay)
    if np.max(np.linalg.eigvals(actuator.a).real) >= 0.0:
        raise ValueError(
            "controller.plate_a0 to plate_a3 describe a cylinder that is not stable by itself"
        )
    effort, roughness, noise = weights
    kalman_weights = Weights(
        effort=effort, derivatives=DERIVATIVES, desired_noise=roughness, sensor_noise=noise
    )
    try:
        law = kalman_inverse(actuator, period, kalman_weights)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ValueError(
            f"controller.plate_compensator = kalman-inverse: there is none for the cylinder that "
            f"plate_b2 to plate_delay describe: {error}"
        ) from error
    return law


def at_rest(plate: Plate) -> Array:
    """Return the memory of a compensator before the first tick.

    It holds the state of the law, the share of the compensation, and the start of the test, m.
    """
    return np.append(np.zeros(len(plate.law.a)), [0.0, math.nan])


@compilable
def compensate(plate: Plate, memory: Array, wanted: float, measured: float) -> tuple[Array, float]:
    """Return the memory after a tick, and the command that brings the plate to a position, m.

    memory: of `at_rest` at first; it is not changed. wanted, measured: positions of the plate, m.
    """
    size = len(plate.law.a)
    if size == 0:
        return memory, wanted
    next_memory = memory.copy()
    if math.isnan(next_memory[size + 1]):
        next_memory[size + 1] = wanted
    start = next_memory[size + 1]
    # Differences from the start: an offset of the sensor is no tracking error.
    desired = wanted - start
    compensated = step_linear(plate.law, next_memory[:size], desired, measured - start)
    next_memory[size] = min(next_memory[size] + plate.set_in, 1.0)
    # Fade in: the share of the compensated command grows from 0 to 1.
    return next_memory, desired + next_memory[size] * (compensated - desired) + start
