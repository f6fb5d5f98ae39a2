"""The force loop under dry friction, simulated with and without the compensator."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controllers import Settings
from controllers.filters import low_pass
from controllers.friction import MOTOR_LAG, NO_ERRORS, NO_VELOCITIES, REST, step_compensator
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


@kernel
def _detect(settings: Settings, travels: Array, errors: Array, period: float, out: Array) -> None:
    """Write the direction of the compensator's step at each tick, or 0, as if none were applied."""
    state, velocities, last = REST, NO_VELOCITIES, NO_ERRORS
    for tick in range(len(travels)):
        before = state.added
        state, velocities, last = step_compensator(
            settings,
            state,
            velocities,
            last,
            travel=travels[tick],
            error=errors[tick],
            period=period,
        )
        out[tick] = np.sign(state.added - before)


class ForceTest(NamedTuple):
    """Inputs of the force loop at each tick of a test.

    Attributes
    ----------
    travels
        Measured travel, in m.
    rest
        Force error not due to friction, in N.
    friction
        Friction force, in N.
    period
        Duration of a tick, in s.
    """

    travels: Array
    rest: Array
    friction: Array
    period: float


@kernel
def close_loop(
    settings: Settings, compensated: bool, test: ForceTest, errors: Array, steps: Array
) -> float:
    """Simulate the force loop under friction, with or without the compensator.

    The motor is a first-order lag, the controller proportional-integral on the filtered error.

    Parameters
    ----------
    errors, steps
        Outputs, one value per tick: the filtered force error due to friction, in N, and the
        direction of each step.

    Returns
    -------
    float
        Mean square of the force error that friction causes, in N².
    """
    state, velocities, last = REST, NO_VELOCITIES, NO_ERRORS
    motor, integral, filtered, total = 0.0, 0.0, 0.0, 0.0
    period = test.period
    # Exact discretisation of the first-order lag under a held command.
    stays = np.exp(-period / MOTOR_LAG)
    for tick in range(len(test.travels)):
        # Load cell = motor force minus friction: the loop is linear, so the response to friction
        # can be simulated alone and the measured remainder added where the compensator reads it.
        felt = motor - test.friction[tick]
        total += felt**2
        filtered = felt if tick == 0 else low_pass(filtered, felt, settings.filter_force, period)
        errors[tick] = -filtered
        before = state.added
        if compensated:
            state, velocities, last = step_compensator(
                settings,
                state,
                velocities,
                last,
                travel=test.travels[tick],
                error=test.rest[tick] - filtered,
                period=period,
            )
        steps[tick] = np.sign(state.added - before)
        integral -= settings.ki * filtered * period
        command = integral - settings.kp * filtered + state.added
        motor = stays * motor + (1.0 - stays) * command
    return total / len(test.travels)


@kernel
def filter_lag(samples: Array, time_constant: float, period: float) -> Array:
    """Return the samples filtered by the controller's first-order low pass.

    The filter starts at the first sample. The time constant and the period are in s.
    """
    out = np.empty_like(samples)
    out[0] = samples[0]
    for tick in range(1, len(samples)):
        out[tick] = low_pass(out[tick - 1], samples[tick], time_constant, period)
    return out


def detections(
    settings: Settings, travels: Array, demanded: Array, cells: Array, period: float
) -> Array:
    """Return the direction of the compensator's step at each tick, or 0, as if none were applied.

    Parameters
    ----------
    settings
        Settings of the compensator.
    travels
        Measured travel, in m, shape (ticks,).
    demanded
        Demanded force, in N, shape (ticks,).
    cells
        Measured force, in N, shape (ticks,).
    period
        Duration of a tick, in s.
    """
    out = np.empty(len(travels))
    errors = demanded - filter_lag(np.ascontiguousarray(cells), settings.filter_force, period)
    _detect(settings, np.ascontiguousarray(travels), errors, period, out)
    return out
