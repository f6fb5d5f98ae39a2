"""Delay compensation of the plate: a linear law between the structure model and its cylinder, made
of what the controller is told of that cylinder.

The limits stay outside: what the law asks for is judged like any other command.
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
from controllers.kalman_inverse import Actuator, Weights, kalman_inverse
from controllers.lag_compensation import lag_compensation
from controllers.linear_law import LinearLaw, step_linear
from controllers.settings import PlateCompensator, Settings

Array = NDArray[np.float64]
FADE = 0.01
"""s over which the compensation sets in: a plate that is read with hum is not where the law starts,
and would be answered by a jump of the command."""
LONGEST = 0.5
"""s of delay that is taken away by one number."""
DERIVATIVES = 3
"""Of the desired motion that the Kalman filter has as states."""
NOTHING = LinearLaw(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([1.0, 0.0]))


class Plate(NamedTuple):
    """law: of positions as differences from where the test began, without a state if there is no
    compensation; set_in: by how much more of it counts each tick."""

    law: LinearLaw
    set_in: float


def told(settings: Settings) -> ClosedLoop:
    """What the controller is told of the structure cylinder."""
    return ClosedLoop(*(getattr(settings, f"plate_{name}") for name in ClosedLoop._fields))


def plate(settings: Settings, period: float) -> Plate:
    """The compensator that settings ask for. period: s. Raises ValueError if there is none for
    such a cylinder."""
    kind = PlateCompensator(settings.plate_compensator)
    if kind == PlateCompensator.NONE:
        return compensation(NOTHING, period)
    weights = settings.plate_effort, settings.plate_roughness, settings.plate_noise
    return compensation(_law(kind, told(settings), weights, period), period)


def compensation(law: LinearLaw, period: float) -> Plate:
    """A compensator of one's own. period: s."""
    contiguous = LinearLaw(*(np.ascontiguousarray(part, dtype=np.float64) for part in law))
    # Compiled here, not in the first tick.
    if len(contiguous.a):
        step_linear(contiguous, np.zeros(len(contiguous.a)), 0.0, 0.0)
    return Plate(contiguous, period / FADE)


def total_delay(loop: ClosedLoop) -> float:
    """s by which the cylinder follows slow motions late: the slope of its phase at rest."""
    return inverse_coefficients(*transfer(loop), loop.delay, 1)[1] * loop.gain


@lru_cache(maxsize=64)
def _law(
    kind: PlateCompensator, loop: ClosedLoop, weights: tuple[float, float, float], period: float
) -> LinearLaw:
    if kind in (PlateCompensator.FORWARD_PREDICTION, PlateCompensator.LAG):
        late = total_delay(loop)
        if not 0.0 < late <= LONGEST:
            raise ValueError(
                f"controller.plate_b2 to plate_delay describe a cylinder that is late by {late:g} "
                f"s; {kind.label} takes away more than 0 and up to {LONGEST:g} s"
            )
        if kind == PlateCompensator.LAG:
            return lag_compensation(late, period)
        return forward_prediction(late, period)
    actuator = Actuator(*with_lag(loop), loop.delay)
    if np.max(np.linalg.eigvals(actuator.a).real) >= 0.0:
        raise ValueError(
            "controller.plate_a0 to plate_a3 describe a cylinder that is not stable by itself"
        )
    effort, roughness, noise = weights
    weighed = Weights(
        effort=effort, derivatives=DERIVATIVES, desired_noise=roughness, sensor_noise=noise
    )
    try:
        law = kalman_inverse(actuator, period, weighed)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ValueError(
            f"controller.plate_compensator = kalman-inverse: there is none for the cylinder that "
            f"plate_b2 to plate_delay describe: {error}"
        ) from error
    return law


def at_rest(plate: Plate) -> Array:
    """What the compensator remembers from tick to tick, before its first: the law's state, the
    share that counts, and where the test began."""
    return np.append(np.zeros(len(plate.law.a)), [0.0, math.nan])


@compilable
def compensate(plate: Plate, memory: Array, wanted: float, measured: float) -> tuple[Array, float]:
    """The command that brings the plate to where it is wanted, m, and what is remembered after; of
    `at_rest`, which stays as it is."""
    size = len(plate.law.a)
    if size == 0:
        return memory, wanted
    after = memory.copy()
    if math.isnan(after[size + 1]):
        after[size + 1] = wanted
    start = after[size + 1]
    away = wanted - start
    asked = step_linear(plate.law, after[:size], away, measured - start)
    after[size] = min(after[size] + plate.set_in, 1.0)
    return after, away + after[size] * (asked - away) + start
