"""Gauss-Newton with shortened steps against linear models and written-out steps."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.diagnosis.gauss_newton import (
    ITERATIONS,
    Minimum,
    is_sufficient,
    minimise,
    shorten,
    take_derivatives,
)
from rigtwin.numerics.arrays import Array
from tests.engine.linear import no_tolerances, space_of

RANDOM = np.random.default_rng(4)
RESPONSES = RANDOM.standard_normal((40, 3))
DATA = 5.0 * RANDOM.standard_normal(40)
FAR = (np.full(3, -1e6), np.full(3, 1e6))


class Recorder:
    """A residual that remembers where it was asked for."""

    def __init__(self, residual) -> None:
        self._residual = residual
        self.places: list[list[float]] = []

    def __call__(self, values: Array) -> Array:
        self.places.append(values.tolist())
        return self._residual(values)


def linear(values: Array) -> Array:
    return DATA - RESPONSES @ values


def solve(
    residual, start: list[float], steps: list[float], expected: float, bounds=None
) -> Minimum:
    """Minimise without tolerances."""
    here = np.array(start)
    wide = (np.full(len(start), -1e6), np.full(len(start), 1e6)) if bounds is None else bounds
    space = no_tolerances(len(residual(here)))
    return minimise(residual, space, here, np.array(steps), wide, expected)


def test_a_quadratic_is_solved_in_one_step_with_the_covariance_of_least_squares():
    """v = (JᵀJ)⁻¹ Jᵀ y, widths √diag (JᵀJ)⁻¹, whatever the steps of the derivatives."""
    best, left, *_ = np.linalg.lstsq(RESPONSES, DATA, rcond=None)
    recorder = Recorder(linear)
    found = solve(recorder, [1.0, -2.0, 0.5], [0.1, 0.02, 0.5], float(left[0]))
    np.testing.assert_allclose(found.values, best, atol=1e-5)
    assert found.misfit == pytest.approx(float(left[0]), rel=1e-9)
    widths = np.sqrt(np.diag(np.linalg.inv(RESPONSES.T @ RESPONSES)))
    np.testing.assert_allclose(found.widths, widths, rtol=1e-9)
    # Size of the residual, start, three derivatives, one step, three derivatives that end it.
    assert len(recorder.places) == 1 + 1 + 3 + 1 + 3


def test_the_normal_matrix_is_damped_by_a_millionth():
    """One step from 0 reaches J y/(JᵀJ (1 + 1e-6) + 1e-12)."""
    column = np.full(4, 1e3)
    found = solve(lambda v: np.full(4, 2e3) - column * v[0], [0.0], [1.0], 0.0)
    assert found.misfit < 1e-4
    tried = Recorder(lambda v: np.full(4, 2e3) - column * v[0])
    solve(tried, [0.0], [1.0], 1.6e7)
    first = tried.places[3][0]
    assert first == pytest.approx(2.0 / (1.0 + 1e-6), rel=1e-9)
    weak = Recorder(lambda v: np.array([1e-4 - 1e-6 * v[0], 3.0]))
    solve(weak, [0.0], [1.0], 9.0)
    assert len(weak.places) == 3


def test_values_stay_within_their_bounds():
    bounds = (np.array([-0.1, -0.1, -0.1]), np.array([0.05, 0.05, 0.05]))
    found = solve(linear, [3.0, -3.0, 0.0], [0.01, 0.01, 0.01], 0.0, bounds)
    assert np.all(found.values >= -0.1)
    assert np.all(found.values <= 0.05)
    inside = np.linalg.lstsq(RESPONSES, DATA, rcond=None)[0]
    assert np.any(np.abs(inside) > 0.1)


def test_a_step_too_long_is_tried_at_its_half_fifth_and_twentieth():
    """Of r = atan v the whole step from 3 overshoots; r = 20 atan v so that the step gains."""
    recorder = Recorder(lambda v: 20.0 * np.arctan(v))
    solve(recorder, [3.0], [1e-3], 1e-3)
    move = -np.arctan(3.0) * (1.0 + 9.0)
    tried = [place[0] for place in recorder.places[3:6]]
    parts = [(place - 3.0) / move for place in tried]
    assert parts[0] == pytest.approx(1.0, rel=1e-2)
    assert parts[1] == pytest.approx(0.5, rel=1e-2)
    steep = Recorder(lambda v: 20.0 * np.tanh(4.0 * v))
    solve(steep, [0.9], [1e-3], 1e-3)
    move = -np.tanh(3.6) * np.cosh(3.6) ** 2 / 4.0
    parts = [(place[0] - 0.9) / move for place in steep.places[3:7]]
    assert parts == pytest.approx([1.0, 0.5, 0.2, 0.05], rel=6e-3)


@pytest.mark.parametrize(
    ("gain", "misfit", "expected", "moves"),
    [(0.1995, 5.0, 5.0, False), (0.2005, 5.0, 5.0, True), (0.996, 1001.0, 1.0, False),
     (1.004, 1001.0, 1.0, True), (0.205, 201.0, 1.0, True), (0.204, 211.0, 4.0, False)],
)  # fmt: skip
def test_a_step_must_promise_a_fifth_of_a_unit_and_a_thousandth_of_the_misfit(
    gain, misfit, expected, moves
):
    """A linear residual (a − v, b) promises a² and leaves b²."""
    a, b = np.sqrt(gain), np.sqrt(misfit - gain)
    found = solve(lambda v: np.array([a - v[0], b]), [0.0], [1e-3], expected)
    assert (found.values[0] != 0.0) == moves
    if moves:
        assert found.values[0] == pytest.approx(a, rel=1e-4)


def test_a_step_that_promises_too_little_ends_the_descent():
    """Every Newton step of r = (1, 3 exp(−v)) adds 1 to v and promises 9 exp(−2 v)."""
    places = Recorder(lambda v: np.array([1.0, 3.0 * np.exp(-v[0])]))
    found = solve(places, [0.0], [1e-3], 1.0)
    steps = np.count_nonzero(9.0 * np.exp(-2.0 * np.arange(6.0)) > 0.2)
    assert found.values[0] == pytest.approx(steps, abs=0.01)


def test_steps_of_derivatives_are_widened_fivefold_once_where_nothing_is_gained():
    """A flat misfit far above what noise leaves is looked at once more with wider steps."""
    flat = Recorder(lambda v: np.array([10.0]) + 0.0 * v)
    solve(flat, [0.0], [1e-3], 1.0)
    assert [place[0] for place in flat.places[2:]] == pytest.approx([1e-3, 5e-3])
    quiet = Recorder(lambda v: np.array([1.0]) + 0.0 * v)
    solve(quiet, [0.0], [1e-3], 1.0)
    assert [place[0] for place in quiet.places[2:]] == pytest.approx([1e-3])


def test_wide_steps_scale_back_to_the_same_step():
    """A step found with widened derivatives is the Newton step of the whole."""

    def stepped(v: Array) -> Array:
        # Below 2e-3 the residual does not answer at all.
        return np.array([10.0 - (v[0] if v[0] > 2e-3 else 0.0)])

    found = solve(stepped, [0.0], [1e-3], 1.0)
    assert found.values[0] == pytest.approx(10.0, rel=1e-4)


def test_derivatives_are_taken_sixteen_times_at_most():
    assert ITERATIONS == 16
    slow = Recorder(lambda v: 1e6 * v**9)
    solve(slow, [1.0], [1e-9], 1e-12)
    # The quotient of the steps of v⁹ is 1 − 1/9: one derivative and one trial each.
    assert len(slow.places) == 2 + 2 * 16


@pytest.mark.parametrize(
    ("misfit", "sufficient"), [(79.9, False), (80.1, True), (109.9, True), (110.1, False)]
)
def test_a_fit_is_sufficient_between_four_fifths_and_eleven_tenths_of_the_noise(misfit, sufficient):
    assert is_sufficient(misfit, 100.0) is sufficient
    assert is_sufficient(1.5 * misfit, 100.0, 2.0) is True


def test_steps_that_change_more_than_a_twentieth_of_the_misfit_are_shortened():
    """Share² = (0.05 χ² + 1e-6 p)/p of a response of power p, at most 1."""
    jacobian = np.array([[0.1, 10.0, 1e4], [0.0, 10.0, 0.0]])
    found = shorten(jacobian, 40.0)
    expected = [1.0, np.sqrt((2.0 + 2e-4) / 200.0), np.sqrt((2.0 + 100.0) / 1e8)]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_derivatives_are_taken_upwards_unless_that_is_beyond_the_bound():
    recorder = Recorder(linear)
    here, steps = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.5, 0.5])
    high = np.array([2.0, 2.5, 3.2])
    columns = take_derivatives(recorder, here, linear(here), steps, high)
    np.testing.assert_allclose(columns, -0.5 * RESPONSES, atol=1e-12)
    assert recorder.places == [[1.5, 2.0, 3.0], [1.0, 2.5, 3.0], [1.0, 2.0, 2.5]]


def test_beside_free_tolerances_the_covariance_is_that_of_the_joint_least_squares():
    """The widths are those of the joint normal matrix [J, C], with one unit of prior on C."""
    columns = 0.3 * RANDOM.standard_normal((40, 2))
    space = space_of(columns)
    joint = np.column_stack([RESPONSES, columns])
    normal = joint.T @ joint + np.diag([0.0, 0.0, 0.0, 1.0, 1.0])
    data = 0.2 * DATA
    best = np.linalg.solve(normal, joint.T @ data)
    assert np.all(np.abs(best[3:]) < 1.0)
    found = minimise(lambda v: data - RESPONSES @ v, space, np.zeros(3), np.full(3, 0.1), FAR, 10.0)
    np.testing.assert_allclose(found.values, best[:3], rtol=1e-4)
    widths = np.sqrt(np.diag(np.linalg.inv(normal))[:3])
    np.testing.assert_allclose(found.widths, widths, rtol=1e-9)
