"""Delay compensators against closed forms: polynomials, sines, noise, loops."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from controllers.adaptive_law import (
    adaptive_memory,
    adaptive_model,
    adaptive_time_series,
    step_adaptive,
)
from controllers.derivatives import derivative_weights, prediction_weights
from controllers.forward_prediction import forward_prediction
from controllers.inverse_model import inverse_coefficients, inverse_model
from controllers.kalman_inverse import (
    ActuatorDynamics,
    Weights,
    kalman_inverse,
    sampled_actuator,
)
from controllers.lag_compensation import lag_compensation
from controllers.linear_law import LinearLaw, pass_through, step_linear
from controllers.smith_predictor import smith_predictor
from controllers.state_filter import state_filter, step_filter
from tests.helpers.linear_law import noise_gain, response

PERIOD = 1e-3


def first_order(lag: float, delay: float) -> ActuatorDynamics:
    """Return an actuator of unit gain with a lag and a delay, s, such as a diagnosis reports."""
    return ActuatorDynamics(np.array([[-1.0 / lag]]), np.array([1.0 / lag]), np.array([1.0]), delay)


def commands(law: LinearLaw, desired: np.ndarray, measured: np.ndarray) -> np.ndarray:
    state = np.zeros(len(law.a))
    pairs = zip(desired.tolist(), measured.tolist(), strict=True)
    return np.array([step_linear(law, state, r, y) for r, y in pairs])


def closed(law: LinearLaw, delay: float, lag: float = 0.02) -> tuple[np.ndarray, complex]:
    """The loop of a law and an actuator of one lag and a delay: its matrix, and what it makes of a
    sine of 3 Hz."""
    a, b, c = sampled_actuator(first_order(lag, delay), PERIOD)
    whole = np.block(
        [
            [a + np.outer(b, c) * law.d[1], np.outer(b, law.c)],
            [np.outer(law.b[:, 1], c), law.a],
        ]
    )
    z = cmath.exp(2j * math.pi * 3.0 * PERIOD)
    actuator = complex(c @ np.linalg.solve(z * np.eye(len(a)) - a, b))
    desired, measured = response(law, 3.0, PERIOD)
    return whole, actuator * desired / (1.0 - actuator * measured)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("delay", [0.007, 0.0155])
def test_a_polynomial_is_predicted_exactly(degree, delay):
    time = np.arange(200) * PERIOD
    desired = np.polyval(np.arange(1.0, degree + 2.0), time)
    ahead = np.polyval(np.arange(1.0, degree + 2.0), time + delay)
    given = commands(forward_prediction(delay, PERIOD, degree), desired, 0.0 * time)
    late = degree * round(delay / PERIOD)
    np.testing.assert_allclose(given[late:], ahead[late:], rtol=1e-9)


def test_horiuchis_weights_are_four_six_four_one():
    np.testing.assert_allclose(prediction_weights(1.0, 4), [4.0, -6.0, 4.0, -1.0], atol=1e-9)
    law = forward_prediction(0.01, PERIOD)
    assert noise_gain(law)[0] == pytest.approx(math.sqrt(16 + 36 + 16 + 1))


def test_forward_prediction_of_a_sine_has_the_gain_and_phase_of_its_sum():
    frequency, delay = 4.0, 0.01
    angle = 2 * math.pi * frequency * delay
    theory = sum(w * cmath.exp(-1j * n * angle) for n, w in enumerate((4, -6, 4, -1)))
    found, measured = response(forward_prediction(delay, PERIOD), frequency, PERIOD)
    assert found == pytest.approx(theory, rel=1e-9)
    assert measured == 0.0
    # Its error begins with the fourth power of the angle.
    assert abs(found - cmath.exp(1j * angle)) == pytest.approx(angle**4, rel=0.3)


def test_the_lag_compensator_undoes_a_lag_and_stops_at_its_limit():
    lag, frequency = 0.02, 3.0
    found, _ = response(lag_compensation(lag, PERIOD, 20.0), frequency, PERIOD)
    s = 2j / PERIOD * math.tan(math.pi * frequency * PERIOD)
    assert found == pytest.approx((lag * s + 1) / (lag / 20.0 * s + 1), rel=1e-9)
    highest, _ = response(lag_compensation(lag, PERIOD, 20.0), 0.5 / PERIOD, PERIOD)
    assert abs(highest) == pytest.approx(20.0, rel=1e-9)


def test_derivatives_are_exact_for_polynomials():
    time = -np.arange(5) * 0.01
    for order in range(4):
        weights = derivative_weights(order, 5, 0.01)
        exact = np.polyder([3.0, -2.0, 1.0, 0.5, 2.0], order)[-1]
        assert weights @ np.polyval([3.0, -2.0, 1.0, 0.5, 2.0], time) == pytest.approx(exact)


def test_the_inverse_of_a_series_is_its_reciprocal():
    found = inverse_coefficients([1.0], [0.001, 0.1, 1.0], 0.02, 3)
    # (1 + 0.1 s + 0.001 s²)(1 + 0.02 s + 0.0002 s² + ...)
    exact = [1.0, 0.12, 0.001 + 0.002 + 0.0002, 0.001 * 0.02 + 0.1 * 0.0002 + 0.02**3 / 6]
    np.testing.assert_allclose(found, exact, rtol=1e-12)


def test_the_inverse_model_follows_better_the_more_derivatives_it_has():
    errors = []
    for order in (1, 2, 3):
        # The command is held for a tick, which delays it by half of one.
        coefficients = inverse_coefficients([1.0], [0.02, 1.0], 0.008 + 0.5 * PERIOD, order)
        _, follows = closed(inverse_model(coefficients, PERIOD), 0.008)
        errors.append(abs(follows - 1.0))
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]


def test_the_smith_predictor_takes_the_delay_out_of_its_loop():
    delay, lag, gain = 0.02, 0.05, 1.0
    law = smith_predictor(gain, lag, delay, 20.0, 0.0, PERIOD)
    _, follows = closed(law, delay, lag)
    whole, _ = closed(smith_predictor(gain, lag, delay, 20.0, 1.0, PERIOD), delay, lag)
    assert np.max(np.abs(np.linalg.eigvals(whole))) < 1.0
    # With the model right, what is left is the closed loop without delay, and then the delay.
    z = cmath.exp(2j * math.pi * 3.0 * PERIOD)
    decay = math.exp(-PERIOD / lag)
    plain = gain * (1.0 - decay) / (z - decay)
    exact = 20.0 * plain / (1.0 + 20.0 * plain) * z ** -round(delay / PERIOD)
    assert follows == pytest.approx(exact, rel=1e-9)
    # The same gains without the model's delay do not hold this actuator.
    plain_loop, _ = closed(smith_predictor(gain, lag, PERIOD, 20.0, 0.0, PERIOD), delay, lag)
    assert np.max(np.abs(np.linalg.eigvals(plain_loop))) > 1.0


@pytest.mark.parametrize("delay", [0.0, 0.008, 0.0125])
def test_the_kalman_inverse_follows_the_actuator_that_it_was_told_of(delay):
    law = kalman_inverse(first_order(0.02, delay), PERIOD, Weights(effort=1e-6))
    whole, follows = closed(law, delay)
    assert np.max(np.abs(np.linalg.eigvals(whole))) < 1.0
    assert abs(follows - 1.0) < 0.01
    _, without = closed(pass_through(), delay)
    assert abs(without - 1.0) > 0.3


def test_a_wrong_delay_costs_what_it_is_wrong_by():
    law = kalman_inverse(first_order(0.02, 0.008), PERIOD, Weights(sensor_noise=1.0))
    _, follows = closed(law, 0.012)
    # With a filter that trusts its model the command goes out 4 ms too late.
    assert cmath.phase(follows) == pytest.approx(-2 * math.pi * 3.0 * 0.004, rel=0.02)


@pytest.mark.parametrize("corner", [20.0, 30.0])
def test_the_filters_states_are_derivatives(corner):
    one, state = state_filter(3, corner, PERIOD), np.zeros(3)
    for tick in range(2000):
        step_filter(one, state, (tick + 0.5) * PERIOD)
    lag = 3.0 / one.corner
    assert state[0] == pytest.approx(2.0 - lag, rel=1e-4)
    assert state[1] * one.corner == pytest.approx(1.0, rel=1e-4)
    assert state[2] == pytest.approx(0.0, abs=5e-5)


@pytest.mark.parametrize("make", [adaptive_time_series, adaptive_model])
def test_an_adaptive_inverse_finds_the_lag_of_its_actuator(make):
    lag, start = 0.03, [1.0, 0.02]
    law = make(start, PERIOD)
    memory, position, decay = adaptive_memory(law), 0.0, math.exp(-PERIOD / lag)
    for tick in range(20000):
        time = tick * PERIOD
        desired = 0.005 * (math.sin(9.0 * time) + math.sin(23.0 * time))
        command = step_adaptive(law, memory, desired, position)
        position = decay * position + (1.0 - decay) * command
    found = memory[:2] / np.array([1.0, law.filter.corner])
    np.testing.assert_allclose(found, [1.0, lag], rtol=0.01)


def test_an_adaptive_inverse_stays_within_its_bounds():
    law = adaptive_time_series([1.0, 0.02, 2e-4], PERIOD, span=0.1)
    memory, random = adaptive_memory(law), np.random.default_rng(3)
    for value in random.standard_normal(3000).tolist():
        step_adaptive(law, memory, 0.01 * value, -0.02 * value)
    assert np.all(memory[:3] >= law.low - 1e-15)
    assert np.all(memory[:3] <= law.high + 1e-15)
    assert np.any(memory[:3] != law.start)


def test_a_law_that_integrates_has_no_noise_gain_of_its_own():
    with pytest.raises(ValueError, match="integrates"):
        noise_gain(inverse_model([1.0], PERIOD, 1.0, 10.0))
