"""Kalman-filtered inverse: the optimal command from estimates of actuator and desired motion.

The estimated states are those of the actuator, an offset at its input, and the desired motion with
its derivatives:

    actuator     x' = A x + B (u(t − θ) + w),   y = C x;   w a slow random walk
    desired      (d/dt + λ)^m r = white noise
    cost         Σ (C x − r)² + ρ (u − r)²

A Kalman filter estimates them from r and y, and a linear-quadratic regulator computes the command.
Both follow from discrete Riccati equations (Anderson, Moore: Optimal Control: Linear Quadratic
Methods (1990), ch. 8, 9). The law needs the true actuator: the lag and delay of a diagnosis go
straight into A, B and θ. The filter weighs noise: a `sensor_noise` that is large against
`offset_walk` trusts the model, a small one the measurement.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, matrix_balance, solve_discrete_are

from controllers.linear_law import LinearLaw

Array = NDArray[np.float64]


class ActuatorDynamics(NamedTuple):
    """Continuous model from command to position, with a gain of about 1.

    Attributes
    ----------
    a, b, c : ndarray
        Matrices of the state space, shapes (n, n), (n,) and (n,).
    delay : float
        Delay of the command, s.
    """

    a: Array
    b: Array
    c: Array
    delay: float


class Weights(NamedTuple):
    """Weights of the filter and the regulator.

    Attributes
    ----------
    effort : float
        Weight ρ of the deviation of the command from the desired motion, 1.
    derivatives : int
        Number m of states of the desired motion.
    decay : float
        Decay λ of the desired motion, 1/s.
    desired_noise : float
        Noise of r relative to that of its m-th derivative, s^m.
    sensor_noise, offset_walk, state_noise : float
        Noise of y, of the offset's steps and of the input's disturbance in a tick, m rms.
    """

    effort: float = 1e-4
    derivatives: int = 4
    decay: float = 10.0
    desired_noise: float = 1e-12
    sensor_noise: float = 1e-5
    offset_walk: float = 1e-6
    state_noise: float = 1e-5


def sampled_actuator(actuator: ActuatorDynamics, period: float) -> tuple[Array, Array, Array]:
    """Return A, B and C at a period, s, with the command held.

    Delayed commands are additional states. A delay of a fraction of a tick is interpolated.
    """
    size = len(actuator.a)
    augmented = np.zeros((size + 1,) * 2)
    augmented[:size, :size], augmented[:size, size] = actuator.a, actuator.b
    augmented = expm(augmented * period)
    whole = math.floor(actuator.delay / period + 1e-9)
    fraction = max(actuator.delay / period - whole, 0.0)
    length = whole + 1 if fraction > 1e-9 else whole
    a, b, c = np.zeros((size + length,) * 2), np.zeros(size + length), np.zeros(size + length)
    a[:size, :size], c[:size] = augmented[:size, :size], actuator.c
    # A delay between two ticks applies both neighbouring commands, weighted linearly.
    for share, age in ((1.0 - fraction, whole), (fraction, whole + 1)):
        if age == 0:
            b[:size] += share * augmented[:size, size]
        elif age <= length:
            a[:size, size + age - 1] += share * augmented[:size, size]
    if length:
        b[size] = 1.0
    for index in range(1, length):
        a[size + index, size + index - 1] = 1.0
    return a, b, c


def kalman_inverse(actuator: ActuatorDynamics, period: float, weights: Weights) -> LinearLaw:
    """Return the law for an actuator, a period, s, and weights."""
    a, b, c = sampled_actuator(_balanced(actuator), period)
    # Derivatives in units of 50 periods: in SI units they would differ by factors of T^m.
    order, unit = weights.derivatives, 50.0 * period
    chain = np.eye(order, k=1) - weights.decay * unit * np.eye(order)
    chain = expm(chain * period / unit)
    size, total = len(a), len(a) + 1 + order
    offset, desired = size, size + 1
    whole = np.asarray(block_diag(a, np.eye(1), chain))
    # The offset acts at the same place as the command.
    whole[:size, offset] = b
    entry = np.append(b, np.zeros(1 + order))
    outputs = np.zeros((2, total))
    outputs[0, desired], outputs[1, :size] = 1.0, c
    noise = np.zeros((total, total))
    # Disturbances act at the input, where friction and valve errors act.
    noise[:size, :size] = weights.state_noise**2 * np.outer(b, b)
    noise[offset, offset] = weights.offset_walk**2
    noise[-1, -1] = 1.0
    # The desired motion is known almost exactly; its noise only regularises the filter.
    measured = np.diag([weights.desired_noise**2, weights.sensor_noise**2])
    # Steady-state filter: P from the Riccati equation, L = P Hᵀ (H P Hᵀ + R)⁻¹.
    covariance = solve_discrete_are(whole.T, outputs.T, noise, measured)
    gain = covariance @ outputs.T @ np.linalg.inv(outputs @ covariance @ outputs.T + measured)
    cost, cross, effort = _cost(c, total, offset, desired, weights.effort)
    regulator = _regulator(whole, entry, cost, cross, effort)
    # From the prediction x⁻: x = x⁻ + L (z − H x⁻), u = −K x, x⁻ next = A x + B u.
    corrected = np.eye(total) - gain @ outputs
    closed = whole - np.outer(entry, regulator)
    return LinearLaw(closed @ corrected, closed @ gain, -regulator @ corrected, -regulator @ gain)


def _balanced(actuator: ActuatorDynamics) -> ActuatorDynamics:
    """Return the same actuator in balanced states.

    The states of a companion form differ by decades, which makes the Riccati equations fail.
    """
    a, change = matrix_balance(actuator.a, permute=False)
    b = np.asarray(np.linalg.solve(change, actuator.b), dtype=np.float64)
    c = actuator.c @ change
    size = math.sqrt(float(np.linalg.norm(b) / np.linalg.norm(c)))
    return ActuatorDynamics(a, b / size, c * size, actuator.delay)


def _cost(
    c: Array, total: int, offset: int, desired: int, effort: float
) -> tuple[Array, Array, float]:
    """Return the quadratic cost of (c x − r)² + ρ (u + w − r)².

    Its three parts weigh the states, the product of states and command, and the command.
    """
    error = np.zeros(total)
    error[: len(c)], error[desired] = c, -1.0
    deviation = np.zeros(total)
    deviation[offset], deviation[desired] = 1.0, -1.0
    cost = np.outer(error, error) + effort * np.outer(deviation, deviation)
    return cost, effort * deviation, effort


def _regulator(a: Array, b: Array, cost: Array, cross: Array, effort: float) -> Array:
    """Return the gain K of u = −K x.

    Offset and desired motion are uncontrollable. They fade slightly here, so that the Riccati
    equation has a solution.
    """
    fading = a * (1.0 - 1e-7)
    riccati = solve_discrete_are(
        fading, b[:, None], cost, np.array([[effort]]), s=cross[:, None], balanced=False
    )
    return (b @ riccati @ fading + cross) / (effort + b @ riccati @ b)
