"""Adaptive inverse of the actuator: the command from the desired motion and its derivatives, with
coefficients that are estimated while the test runs.

    u = θ_0 r + θ_1 r' + ... + θ_n r^(n);   estimated from  u ≈ θ_0 y + θ_1 y' + ... + θ_n y^(n)

with u and y through the same filter, whose states are the derivatives. Two estimators:

- adaptive time series: least squares over the last second or so, n = 2 (Chae, Kazemibidokhti,
  Ricles, Earthquake Eng. Struct. Dyn. 42 (2013) 1697). There the window is cut off, here it fades
  exponentially, and the start coefficients hold it where there is no motion yet;
- adaptive model-based: gradient, θ' = Γ φ (u − θᵀφ)/(ν² + φᵀφ), n = 3 (Chen, Ricles, Karavasilis,
  Chae, Sause, Eng. Struct. 36 (2012); Fermandois 2019; Galmez, Fermandois 2022). Normalised here,
  so that one Γ serves small motions and large.

Both need start coefficients, a nominal actuator's, and motion to learn from. Noise on r reaches the
command by θ_n T^−n; noise on y does so slowly, by the coefficients.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.compiled import compilable
from controllers.derivatives import derivative_weights
from controllers.state_filter import StateFilter, state_filter, step_filter

Array = NDArray[np.float64]


class AdaptiveLaw(NamedTuple):
    """One adaptive inverse, n + 1 coefficients.

    least_squares: 1 if by least squares, else 0; start, low, high: coefficients and their bounds,
    shape (n+1,), each in s^order times the filter's corner^order; stencils: shape (n+1, points),
    derivatives of the desired motion by backward differences, divided by corner^order; fading: of
    the window in a tick; hold: (m²) weight of the start coefficients; rate: of the gradient a tick;
    size: ν, m.
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
    corner: float = 30.0,
    window: float = 1.0,
    hold: float = 1e-6,
    span: float = 0.5,
) -> AdaptiveLaw:
    """By least squares. coefficients: to start from, s^order; corner: of the filter, Hz; window:
    s; hold: (m²) how much motion outweighs the start; span: how far coefficients may go, share."""
    law = _law(coefficients, period, corner, span)
    return law._replace(least_squares=1.0, fading=float(np.exp(-period / window)), hold=hold)


def adaptive_model(
    coefficients: list[float],
    period: float,
    corner: float = 30.0,
    rate: float = 2.0,
    size: float = 1e-4,
    span: float = 0.5,
) -> AdaptiveLaw:
    """By gradient. coefficients: to start from, s^order; corner: of the filter, Hz; rate: Γ, 1/s;
    size: ν, m; span: how far coefficients may go, share."""
    return _law(coefficients, period, corner, span)._replace(rate=rate * period, size=size)


def _law(coefficients: list[float], period: float, corner: float, span: float) -> AdaptiveLaw:
    order = len(coefficients)
    one = state_filter(order, corner, period)
    units = one.corner ** np.arange(order, dtype=np.float64)
    start = np.asarray(coefficients, dtype=np.float64) * units
    reach = span * np.abs(start)
    points = order + 1
    stencils = np.array([derivative_weights(power, points, period) for power in range(order)])
    return AdaptiveLaw(
        least_squares=0.0,
        start=start,
        low=start - reach,
        high=start + reach,
        stencils=stencils / units[:, None],
        filter=one,
        fading=1.0,
        hold=0.0,
        rate=0.0,
        size=0.0,
    )


def adaptive_memory(law: AdaptiveLaw) -> Array:
    """Of a law before its first tick: coefficients; last desired motions; filtered command,
    filtered measurement; last command and measurement; the window's sums."""
    order, points = law.stencils.shape
    return np.concatenate(
        [law.start, np.zeros(points + 2 * order + 2), np.zeros(order * order + order)]
    )


@compilable
def step_adaptive(law: AdaptiveLaw, memory: Array, desired: float, measured: float) -> float:
    """One tick: returns the command. memory: of `adaptive_memory`, advanced in place."""
    order, points = law.stencils.shape
    theta = memory[:order]
    history = memory[order : order + points]
    first = order + points
    commanded, moved = memory[first : first + order], memory[first + order : first + 2 * order]
    last = memory[first + 2 * order : first + 2 * order + 2]
    sums = memory[first + 2 * order + 2 :]
    step_filter(law.filter, commanded, last[0])
    # Held commands are exact; the motion between two samples is taken as straight.
    step_filter(law.filter, moved, 0.5 * (last[1] + measured))
    if law.least_squares > 0.0:
        _fit(law, theta, sums, moved, commanded[0])
    else:
        _descend(law, theta, moved, commanded[0])
    for place in range(points - 1, 0, -1):
        history[place] = history[place - 1]
    history[0] = desired
    command = 0.0
    for power in range(order):
        derivative = 0.0
        for place in range(points):
            derivative += law.stencils[power, place] * history[place]
        command += theta[power] * derivative
    last[0], last[1] = command, measured
    return command


@compilable
def _descend(law: AdaptiveLaw, theta: Array, moved: Array, commanded: float) -> None:
    error, size = commanded, law.size**2
    for power in range(len(theta)):
        error -= theta[power] * moved[power]
        size += moved[power] ** 2
    for power in range(len(theta)):
        after = theta[power] + law.rate * error * moved[power] / size
        theta[power] = min(max(after, law.low[power]), law.high[power])


@compilable
def _fit(law: AdaptiveLaw, theta: Array, sums: Array, moved: Array, commanded: float) -> None:
    order = len(theta)
    square, beside = sums[: order * order].reshape(order, order), sums[order * order :]
    system, right = np.empty((order, order)), np.empty(order)
    for row in range(order):
        for column in range(order):
            square[row, column] = law.fading * square[row, column] + moved[row] * moved[column]
            system[row, column] = square[row, column]
        beside[row] = law.fading * beside[row] + moved[row] * commanded
        system[row, row] += law.hold
        right[row] = beside[row] + law.hold * law.start[row]
    found = np.linalg.solve(system, right)
    for row in range(order):
        theta[row] = min(max(found[row], law.low[row]), law.high[row])
