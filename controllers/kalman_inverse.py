"""Kalman-filtered inverse: the command that makes the actuator follow best, from estimates of its
state, of an offset at its input, and of the desired motion and its derivatives.

    actuator     x' = A x + B (u(t − θ) + w),   y = C x;   w a slow random walk
    desired      (d/dt + λ)^m r = white noise
    cost         Σ (C x − r)² + ρ (u − r)²

One Kalman filter estimates all from r and y, one linear-quadratic regulator follows; both from
discrete Riccati equations. Anderson, Moore: Optimal Control: Linear Quadratic Methods (1990), ch.
8, 9. Needs the actuator as it is: what a diagnosis found of its lag and delay goes straight into A,
B and θ. How far noise gets into the command is weighed by the filter: `sensor_noise` large against
`offset_walk` trusts the model, small the measurement.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, matrix_balance, solve_discrete_are

from controllers.linear_law import LinearLaw

Array = NDArray[np.float64]


class Actuator(NamedTuple):
    """Continuous, from command to position, unit gain within a few per cent: a (n, n), b (n,), c
    (n,); delay: s, of the command."""

    a: Array
    b: Array
    c: Array
    delay: float


class Weights(NamedTuple):
    """What the filter and the regulator weigh.

    effort: ρ, 1; derivatives: m; decay: λ, 1/s; desired_noise: rms of the noise on r over that of
    its m-th derivative, s^m; sensor_noise, offset_walk, state_noise: rms of the noise on y, of the
    offset's steps and of disturbances of the input in a tick, m.
    """

    effort: float = 1e-4
    derivatives: int = 4
    decay: float = 10.0
    desired_noise: float = 1e-12
    sensor_noise: float = 1e-5
    offset_walk: float = 1e-6
    state_noise: float = 1e-5


def first_order(lag: float, delay: float) -> Actuator:
    """An actuator of unit gain with a lag and a delay, s, as a diagnosis gives them."""
    return Actuator(np.array([[-1.0 / lag]]), np.array([1.0 / lag]), np.array([1.0]), delay)


def sampled_actuator(actuator: Actuator, period: float) -> tuple[Array, Array, Array]:
    """A, B, C at the period, s, with the command held; commands under way are states. A delay
    between ticks is interpolated."""
    size = len(actuator.a)
    both = np.zeros((size + 1,) * 2)
    both[:size, :size], both[:size, size] = actuator.a, actuator.b
    both = expm(both * period)
    whole = math.floor(actuator.delay / period + 1e-9)
    part = max(actuator.delay / period - whole, 0.0)
    length = whole + 1 if part > 1e-9 else whole
    a, b, c = np.zeros((size + length,) * 2), np.zeros(size + length), np.zeros(size + length)
    a[:size, :size], c[:size] = both[:size, :size], actuator.c
    for share, age in ((1.0 - part, whole), (part, whole + 1)):
        if age == 0:
            b[:size] += share * both[:size, size]
        elif age <= length:
            a[:size, size + age - 1] += share * both[:size, size]
    if length:
        b[size] = 1.0
    for place in range(1, length):
        a[size + place, size + place - 1] = 1.0
    return a, b, c


def kalman_inverse(actuator: Actuator, period: float, weights: Weights) -> LinearLaw:
    """The law for an actuator, the period in s and what is weighed."""
    a, b, c = sampled_actuator(_balanced(actuator), period)
    # The chain of derivatives in units of the decay-free period, or its numbers differ by T^m.
    order, unit = weights.derivatives, 50.0 * period
    chain = np.eye(order, k=1) - weights.decay * unit * np.eye(order)
    chain = expm(chain * period / unit)
    size, total = len(a), len(a) + 1 + order
    offset, wanted = size, size + 1
    whole = np.asarray(block_diag(a, np.eye(1), chain))
    # The offset enters where the command enters.
    whole[:size, offset] = b
    entry = np.append(b, np.zeros(1 + order))
    seen = np.zeros((2, total))
    seen[0, wanted], seen[1, :size] = 1.0, c
    noise = np.zeros((total, total))
    noise[:size, :size] = weights.state_noise**2 * np.outer(b, b)
    noise[offset, offset] = weights.offset_walk**2
    noise[-1, -1] = 1.0
    measured = np.diag([weights.desired_noise**2, weights.sensor_noise**2])
    spread = solve_discrete_are(whole.T, seen.T, noise, measured)
    gain = spread @ seen.T @ np.linalg.inv(seen @ spread @ seen.T + measured)
    cost, cross, effort = _cost(c, total, offset, wanted, weights.effort)
    regulator = _regulator(whole, entry, cost, cross, effort)
    # From the prediction x⁻: x = x⁻ + L (z − H x⁻), u = −K x, x⁻ next = A x + B u.
    corrected = np.eye(total) - gain @ seen
    closed = whole - np.outer(entry, regulator)
    return LinearLaw(closed @ corrected, closed @ gain, -regulator @ corrected, -regulator @ gain)


def _balanced(actuator: Actuator) -> Actuator:
    """The same actuator in states of one size; companion forms differ by decades in theirs, which
    no Riccati equation survives."""
    a, change = matrix_balance(actuator.a, permute=False)
    b = np.asarray(np.linalg.solve(change, actuator.b), dtype=np.float64)
    c = actuator.c @ change
    size = math.sqrt(float(np.linalg.norm(b) / np.linalg.norm(c)))
    return Actuator(a, b / size, c * size, actuator.delay)


def _cost(
    c: Array, total: int, offset: int, wanted: int, effort: float
) -> tuple[Array, Array, float]:
    """Of (c x − r)² + ρ (u + w − r)²: of the states, of states with command, of the command."""
    error = np.zeros(total)
    error[: len(c)], error[wanted] = c, -1.0
    beside = np.zeros(total)
    beside[offset], beside[wanted] = 1.0, -1.0
    cost = np.outer(error, error) + effort * np.outer(beside, beside)
    return cost, effort * beside, effort


def _regulator(a: Array, b: Array, cost: Array, cross: Array, effort: float) -> Array:
    """K of u = −K x. Neither offset nor desired motion can be controlled, so that they are let fade
    a little for the Riccati equation to have its solution."""
    fading = a * (1.0 - 1e-7)
    solved = solve_discrete_are(
        fading, b[:, None], cost, np.array([[effort]]), s=cross[:, None], balanced=False
    )
    return (b @ solved @ fading + cross) / (effort + b @ solved @ b)
