"""Adaptive inverse of an actuator, with coefficients estimated while the test runs.

The command is a combination of the desired motion and its derivatives:

    u = θ_0 r + θ_1 r' + ... + θ_n r^(n);   estimated from  u ≈ θ_0 y + θ_1 y' + ... + θ_n y^(n)

u and y pass the same filter, whose states are the derivatives. There are two estimators:

- Adaptive time series: least squares over about one second, n = 2 (Chae, Kazemibidokhti, Ricles,
  Earthquake Eng. Struct. Dyn. 42 (2013) 1697). Their window is cut off; here it fades
  exponentially, and the start coefficients act as a prior until there is motion.
- Adaptive model-based: gradient, θ' = Γ φ (u − θᵀφ)/(ν² + φᵀφ), n = 3 (Chen, Ricles, Karavasilis,
  Chae, Sause, Eng. Struct. 36 (2012); Fermandois 2019; Galmez, Fermandois 2022). It is normalised
  here, so the same Γ suits small and large motions.

Both need start coefficients from a nominal actuator, and motion to learn from. Noise on r reaches
the command amplified as by the inverse model (`inverse_model`). Noise on y reaches it slowly,
through the coefficients.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.compiled import compilable
from controllers.derivatives import derivative_weights
from controllers.state_filter import StateFilter, state_filter, step_filter

Array = NDArray[np.float64]
CORNER, SPAN = 30.0, 0.5
"""Corner frequency of the filter, Hz, and largest relative change of a coefficient."""


class AdaptiveLaw(NamedTuple):
    """Adaptive inverse with n + 1 coefficients.

    Coefficients are scaled: each is in s^order times the filter's corner^order.

    Attributes
    ----------
    least_squares : float
        1 for least squares, 0 for the gradient.
    start, low, high : ndarray
        Initial coefficients and their bounds, shape (n + 1,).
    stencils : ndarray
        Backward differences of the desired motion, divided by corner^order, shape (n + 1, points).
    filter : StateFilter
        Filter of command and measurement.
    fading : float
        Factor by which the window fades per tick.
    hold : float
        Weight of the start coefficients, m².
    rate : float
        Gain of the gradient per tick.
    size : float
        Regularisation ν of the normalisation, m.
    """

    least_squares: float
    start: Array
    low: Array
    high: Array
    stencils: Array
    filter: StateFilter
    fading: float
    hold: float
    rate: float
    size: float


def adaptive_time_series(
    coefficients: list[float],
    period: float,
    window: float = 1.0,
    hold: float = 1e-6,
    span: float = SPAN,
) -> AdaptiveLaw:
    """Return an adaptive inverse by least squares.

    Parameters
    ----------
    coefficients : list of float
        Initial coefficients, in s^order, lowest order first.
    period : float
        Period of the ticks, s.
    window : float
        Time constant of the fading window, s. Defaults to 1.
    hold : float
        Weight of the initial coefficients against motion, m². Defaults to 1e-6.
    span : float
        Largest relative change of a coefficient. Defaults to 0.5.
    """
    law = _law(coefficients, period, span)
    return law._replace(least_squares=1.0, fading=float(np.exp(-period / window)), hold=hold)


def adaptive_model(
    coefficients: list[float],
    period: float,
    rate: float = 2.0,
    size: float = 1e-4,
) -> AdaptiveLaw:
    """Return an adaptive inverse by gradient.

    Parameters
    ----------
    coefficients : list of float
        Initial coefficients, in s^order, lowest order first.
    period : float
        Period of the ticks, s.
    rate : float
        Adaptation gain Γ, 1/s. Defaults to 2.
    size : float
        Regularisation ν, m: motions below it adapt slowly. Defaults to 1e-4.
    """
    return _law(coefficients, period, SPAN)._replace(rate=rate * period, size=size)


def _law(coefficients: list[float], period: float, span: float) -> AdaptiveLaw:
    """Return the parts that both estimators share."""
    order = len(coefficients)
    motion_filter = state_filter(order, CORNER, period)
    # In s^order the coefficients differ by decades; scaled by the corner they are of one size, and
    # one gain suits all.
    units = motion_filter.corner ** np.arange(order, dtype=np.float64)
    start = np.asarray(coefficients, dtype=np.float64) * units
    # Bounds keep a wrong estimate from making the loop unstable.
    reach = span * np.abs(start)
    # Accuracy is the number of points less the power: second order for the highest one.
    points = order + 1
    stencils = np.array([derivative_weights(power, points, period) for power in range(order)])
    return AdaptiveLaw(
        least_squares=0.0,
        start=start,
        low=start - reach,
        high=start + reach,
        stencils=stencils / units[:, None],
        filter=motion_filter,
        fading=1.0,
        hold=0.0,
        rate=0.0,
        size=0.0,
    )


def adaptive_memory(law: AdaptiveLaw) -> Array:
    """Return the memory of a law before its first tick, one array of all numbers.

    It holds the coefficients, the last desired motions, the filtered command and measurement, the
    last command and measurement, and the sums of the window.
    """
    order, points = law.stencils.shape
    return np.concatenate(
        [law.start, np.zeros(points + 2 * order + 2), np.zeros(order * order + order)]
    )


@compilable
def step_adaptive(law: AdaptiveLaw, memory: Array, desired: float, measured: float) -> float:
    """Return the command of one tick, m; memory: of `adaptive_memory`, advanced in place."""
    order, points = law.stencils.shape
    theta = memory[:order]
    history = memory[order : order + points]
    first = order + points
    filtered_command = memory[first : first + order]
    filtered_motion = memory[first + order : first + 2 * order]
    last = memory[first + 2 * order : first + 2 * order + 2]
    sums = memory[first + 2 * order + 2 :]
    step_filter(law.filter, filtered_command, last[0])
    # The command is held over a tick, so its filter is exact. The motion is not: its mean over the
    # tick is the best constant.
    step_filter(law.filter, filtered_motion, 0.5 * (last[1] + measured))
    if law.least_squares > 0.0:
        _fit(law, theta, sums, filtered_motion, filtered_command[0])
    else:
        _descend(law, theta, filtered_motion, filtered_command[0])
    # Shifted by hand: an overlapping slice assignment would copy in compiled code.
    for index in range(points - 1, 0, -1):
        history[index] = history[index - 1]
    history[0] = desired
    command = 0.0
    for power in range(order):
        derivative = 0.0
        for index in range(points):
            derivative += law.stencils[power, index] * history[index]
        command += theta[power] * derivative
    # The next tick filters the command that acts during this one.
    last[0], last[1] = command, measured
    return command


@compilable
def _descend(
    law: AdaptiveLaw, theta: Array, filtered_motion: Array, filtered_command: float
) -> None:
    """Update the coefficients in place by one gradient step."""
    # Normalised by ν² + φᵀφ, so that the step does not depend on the size of the motion.
    error, size = filtered_command, law.size**2
    for power in range(len(theta)):
        error -= theta[power] * filtered_motion[power]
        size += filtered_motion[power] ** 2
    for power in range(len(theta)):
        updated = theta[power] + law.rate * error * filtered_motion[power] / size
        theta[power] = min(max(updated, law.low[power]), law.high[power])


@compilable
def _fit(
    law: AdaptiveLaw, theta: Array, sums: Array, filtered_motion: Array, filtered_command: float
) -> None:
    """Update the coefficients in place by recursive least squares with a fading window."""
    # (Σ λ^k φ φᵀ + h I) θ = Σ λ^k φ u + h θ_0: the prior keeps the system regular at rest.
    order = len(theta)
    square, cross = sums[: order * order].reshape(order, order), sums[order * order :]
    system, right_side = np.empty((order, order)), np.empty(order)
    for row in range(order):
        for column in range(order):
            square[row, column] = (
                law.fading * square[row, column] + filtered_motion[row] * filtered_motion[column]
            )
            system[row, column] = square[row, column]
        cross[row] = law.fading * cross[row] + filtered_motion[row] * filtered_command
        system[row, row] += law.hold
        right_side[row] = cross[row] + law.hold * law.start[row]
    # Clipped one by one below: the bounded optimum is not needed, as the bounds are a safeguard.
    solution = np.linalg.solve(system, right_side)
    for row in range(order):
        theta[row] = min(max(solution[row], law.low[row]), law.high[row])
