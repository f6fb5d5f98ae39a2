"""Tolerances as nuisances: bounded least squares with a prior, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from rigtwin.components import RigPlant, find
from tests.engine.linear import space_of, tolerance

RANDOM = np.random.default_rng(8)
COLUMNS = RANDOM.standard_normal((30, 3))
SMALL = 0.3 * RANDOM.standard_normal(30)
LARGE = 3.0 * COLUMNS[:, 0] - 0.4 * COLUMNS[:, 1] + SMALL
USED = np.array([0.2, -0.1, 0.3])


def best_tolerances(residual: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Minimise |r + C (u − t)|² + |t|² within ±1.2, by another solver."""
    stacked = np.vstack([COLUMNS, np.eye(3)])
    data = np.concatenate([residual + COLUMNS @ used, np.zeros(3)])
    return lsq_linear(stacked, data, bounds=(-1.2, 1.2), tol=1e-14).x


@pytest.mark.parametrize("residual", [SMALL, LARGE, -LARGE])
@pytest.mark.parametrize("used", [np.zeros(3), USED])
def test_tolerances_are_the_bounded_least_squares_with_a_unit_prior(residual, used):
    space = space_of(COLUMNS, used)
    expected = best_tolerances(residual, used)
    found = space.estimate_tolerances(residual)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    left = residual + COLUMNS @ (used - expected)
    np.testing.assert_allclose(space.subtract_tolerances(residual), left, atol=1e-5)
    assert space.misfit(residual) == pytest.approx(left @ left + expected @ expected)


def test_a_tolerance_at_its_bound_leaves_the_others_free():
    found = space_of(COLUMNS).estimate_tolerances(LARGE)
    assert found[0] == 1.2
    assert abs(found[1]) < 1.2
    assert space_of(COLUMNS).estimate_tolerances(-LARGE)[0] == -1.2


def test_without_used_tolerances_none_is_used():
    found = space_of(COLUMNS).estimate_tolerances(SMALL)
    expected = np.linalg.solve(COLUMNS.T @ COLUMNS + np.eye(3), COLUMNS.T @ SMALL)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_responses_are_projected_off_the_tolerances():
    """R − C (CᵀC + 1)⁻¹ CᵀR."""
    responses = RANDOM.standard_normal((30, 2))
    projector = np.eye(30) - COLUMNS @ np.linalg.inv(COLUMNS.T @ COLUMNS + np.eye(3)) @ COLUMNS.T
    found = space_of(COLUMNS).project_out(responses)
    np.testing.assert_allclose(found, projector @ responses, atol=1e-12)


@pytest.mark.parametrize(
    ("residual", "free"), [(SMALL, [0, 1, 2]), (LARGE, [1, 2]), (-LARGE, [1, 2])]
)
@pytest.mark.parametrize("used", [np.zeros(3), USED])
def test_curvature_and_slope_are_the_schur_complement_of_the_free_tolerances(residual, free, used):
    jacobian = RANDOM.standard_normal((30, 2))
    space = space_of(COLUMNS, used)
    columns = COLUMNS[:, free]
    inverse = np.linalg.inv(columns.T @ columns + np.eye(len(free)))
    expected = jacobian.T @ jacobian - jacobian.T @ columns @ inverse @ columns.T @ jacobian
    left = residual + COLUMNS @ (used - best_tolerances(residual, used))
    normal, gradient = space.normal_equations(jacobian, residual)
    np.testing.assert_allclose(normal, expected, atol=1e-10)
    np.testing.assert_allclose(gradient, jacobian.T @ left, atol=1e-4)
    power, slope = space.strengths(jacobian, residual)
    np.testing.assert_allclose(power, np.diag(expected), atol=1e-10)
    np.testing.assert_allclose(slope, jacobian.T @ left, atol=1e-4)


TOLERANCES = (
    tolerance("carriage", "mass"),
    tolerance("motor", "constant"),
    tolerance("load_cell", "delay", ticks=True),
)


@pytest.mark.parametrize(
    ("name", "replaced"),
    [
        ("mass@carriage", [True, False, False]),
        ("delay@motor", [False, False, True]),
        ("coulomb@rail", [False, False, False]),
    ],
)
def test_an_effect_takes_the_place_of_its_own_tolerance(name, replaced):
    """With a delay to be found, when samples were taken is no question of its own."""
    effect = find(name, RigPlant())
    space = space_of(COLUMNS, USED, tolerances=TOLERANCES)
    beside = space.without_replaced([effect])
    expected = np.where(replaced, 0.0, COLUMNS)
    assert np.array_equal(beside.columns, expected)
    assert np.array_equal(space.columns, COLUMNS)
    assert (beside is space) == (not any(replaced))
    built = space_of(COLUMNS, USED, [effect], TOLERANCES)
    assert np.array_equal(built.columns, expected)
    residual = SMALL + expected @ USED
    inverse = np.linalg.inv(expected.T @ expected + np.eye(3))
    np.testing.assert_allclose(
        beside.estimate_tolerances(SMALL), inverse @ expected.T @ residual, atol=1e-12
    )
