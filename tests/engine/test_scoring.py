"""Cross-validation, standard errors and shares of effects on linear models, in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.components import Effect, RigPlant, find
from rigtwin.diagnosis.blocks import block_products
from rigtwin.diagnosis.fit import Fit, with_values
from rigtwin.diagnosis.left_out_blocks import _folds, cross_validate, standard_errors
from rigtwin.diagnosis.scoring import Scored, Scorer, _reach, _together
from tests.engine.linear import PLANT, LinearEvidence, space_of

RANDOM = np.random.default_rng(12)
BLOCKS, SAMPLES = 20, 30
COULOMB, VISCOUS = find("coulomb@rail", PLANT), find("viscous@rail", PLANT)


def rows_of(recordings: int) -> np.ndarray:
    """Return rows of two responses and a residual, shape (recordings, blocks, samples, 3)."""
    rows = RANDOM.standard_normal((recordings, BLOCKS, SAMPLES, 3))
    rows[..., 2] += 2.0 * rows[..., 0]
    return rows


def products_of(rows: np.ndarray) -> np.ndarray:
    """Return products of two signals and three bands, shape (recordings, 2, 3, blocks, 3, 3)."""
    recordings, blocks, _, columns = rows.shape
    parts = rows.reshape(recordings, blocks, 2, 3, -1, columns)
    return np.einsum("rbknsi,rbknsj->rknbij", parts, parts)


def by_band(power: np.ndarray) -> np.ndarray:
    """Sum squares, shape (recordings, blocks, samples), to (recordings, 2, 3) by signal and
    band."""
    return power.reshape(len(power), BLOCKS, 2, 3, -1).sum(axis=(1, 4))


@pytest.mark.parametrize("recordings", [1, 3])
@pytest.mark.parametrize("settled", [True, False])
@pytest.mark.parametrize("prior", [0.0, 25.0])
def test_what_is_left_out_is_predicted_by_a_fit_to_the_rest(recordings, settled, prior):
    """Least squares on the rows of the other blocks, less what all rows still ask for."""
    rows = rows_of(recordings)
    weights = np.array([0.0, prior])
    pull = np.zeros(2)
    responses, residual = rows[..., :2], rows[..., 2]
    flat, data = responses.reshape(-1, 2), residual.ravel()
    whole = flat.T @ flat + np.diag(weights)
    if settled:
        moved = -np.linalg.solve(whole, flat.T @ data)
        residual = residual + responses @ moved
        rows[..., 2] = residual
        pull = weights * moved
        data = residual.ravel()
    still = -np.linalg.solve(whole, flat.T @ data + pull)
    assert np.allclose(still, 0.0, atol=1e-9) == settled
    expected = np.full((recordings, 2, 3, BLOCKS), 1.7 * SAMPLES)
    levels, inside = cross_validate(products_of(rows), expected, weights, pull)
    blocks = np.arange(BLOCKS)[None, :] + 0 * np.arange(recordings)[:, None]
    parts = blocks % 5 if recordings == 1 else np.arange(recordings)[:, None] + 0 * blocks
    power = np.zeros((recordings, 2, 3))
    for part in np.unique(parts):
        held = parts == part
        rest, target = responses[~held].reshape(-1, 2), residual[~held].ravel()
        normal = rest.T @ rest + np.diag(weights)
        move = -np.linalg.solve(normal, rest.T @ target + pull) - still
        left = (residual + responses @ move) ** 2
        power += by_band(np.where(held[..., None], left, 0.0))
    total = 1.7 * SAMPLES * BLOCKS
    np.testing.assert_allclose(levels, power / total, rtol=1e-6)
    np.testing.assert_allclose(inside, by_band(residual**2) / total)


def test_a_fit_without_effects_leaves_out_what_it_leaves():
    rows = rows_of(1)[..., 2:]
    expected = np.full((1, 2, 3, BLOCKS), 2.0 * SAMPLES)
    levels, inside = cross_validate(products_of(rows), expected, np.zeros(0), np.zeros(0))
    assert levels == pytest.approx(inside)
    assert levels == pytest.approx(by_band(rows[..., 0] ** 2) / (2.0 * SAMPLES * BLOCKS))
    none, _ = cross_validate(products_of(rows), 0.0 * expected, np.zeros(0), np.zeros(0))
    assert not np.any(none)
    little, _ = cross_validate(products_of(rows), 1e-9 * expected, np.zeros(0), np.zeros(0))
    assert little == pytest.approx(1e9 * levels)


def test_blocks_of_one_recording_interleave_and_several_recordings_take_turns():
    single = _folds(1)
    assert len(single) == 5
    assert [np.nonzero(fold[0])[0].tolist() for fold in single[:2]] == [
        [0, 5, 10, 15],
        [1, 6, 11, 16],
    ]
    assert len(_folds(2)) == 2
    several = _folds(3)
    assert [fold.all(axis=1).tolist() for fold in several] == np.eye(3, dtype=bool).tolist()
    assert [fold.any(axis=1).tolist() for fold in several] == np.eye(3, dtype=bool).tolist()


@pytest.mark.parametrize("scale", [0.5, 3.0])
@pytest.mark.parametrize("uneven", [0.0, 4.0])
def teststandard_errors_are_the_larger_of_the_formal_and_the_sandwich_ones(scale, uneven):
    """Formal: (JᵀJ + P)⁻¹ times the excess of the residual's power; White's sandwich over
    blocks."""
    rows = rows_of(1)
    rows[..., 2] = scale * RANDOM.standard_normal((1, BLOCKS, SAMPLES))
    rows[0, :, :, 2] += uneven * np.sin(np.arange(BLOCKS))[:, None] * rows[0, :, :, 0]
    prior = np.array([0.0, 40.0])
    expected = np.full((1, 2, 3, BLOCKS), 1.0 * SAMPLES / 6.0)
    flat = rows.reshape(-1, 3)
    inverse = np.linalg.inv(flat[:, :2].T @ flat[:, :2] + np.diag(prior))
    excess = max(float(np.sum(flat[:, 2] ** 2)) / (SAMPLES * BLOCKS), 1.0)
    gradients = np.einsum("bsi,bs->bi", rows[0, :, :, :2], rows[0, :, :, 2])
    spread = gradients.T @ gradients * BLOCKS / (BLOCKS - 2)
    sandwich = np.diag(inverse @ spread @ inverse)
    variance = np.maximum(sandwich, excess * np.diag(inverse))
    found = standard_errors(products_of(rows), expected, prior, 1)
    assert found == pytest.approx(np.sqrt(variance[:1]), rel=1e-6)
    both = standard_errors(products_of(rows), expected, prior, 2)
    assert both == pytest.approx(np.sqrt(variance), rel=1e-6)
    assert bool(sandwich[0] > excess * inverse[0, 0]) or uneven == 0.0


def test_two_effects_undo_each_other_by_their_joint_response():
    """|a + b|/min(|a|, |b|) where they oppose each other, 1 otherwise."""
    first, second = np.array([3.0, 0.0, 1.0]), np.array([-2.0, 1.0, 0.0])
    third = np.array([0.0, 0.0, 2.0])
    stack = np.stack([first, second, third])
    gram = np.zeros((1, 1, 1, 1, 4, 4))
    gram[0, 0, 0, 0, :3, :3] = stack @ stack.T
    moves = np.diag([1.0, 1.5, 0.5])
    found = _together(moves, gram)
    joint = np.linalg.norm(first + 1.5 * second) / np.linalg.norm(first)
    assert joint < 1.0
    assert found[0, 1] == found[1, 0] == pytest.approx(joint)
    assert found[0, 2] == found[1, 2] == 1.0
    opposed = _together(np.diag([1.0, 1.0, -1.0]), gram)
    assert opposed[0, 2] == pytest.approx(min(np.linalg.norm(first - third) / 2.0, 1.0))
    vanishing = _together(np.diag([1.0, -1.0, 0.0]), gram)
    assert vanishing[0, 2] == 1.0


def test_reach_is_the_share_of_each_signal_in_a_response():
    products = np.zeros((1, 2, 1, 3, 3, 3))
    products[0, 0, 0, :, 0, 0] = (1.0, 2.0, 0.0)
    products[0, 1, 0, :, 0, 0] = (0.0, 0.0, 9.0)
    products[0, 1, 0, :, 1, 1] = (4.0, 0.0, 0.0)
    moves = np.array([[2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(_reach(moves, products)[:2], [[0.25, 0.75], [0.0, 1.0]])
    assert not np.any(_reach(moves, products)[2])


def test_several_magnitudes_of_one_effect_respond_together():
    """Two coefficients with the responses a and b of one signal: the power is |m₁ a + m₂ b|²."""
    first, second = np.array([3.0, 0.0, 1.0]), np.array([-2.0, 1.0, 4.0])
    stack = np.stack([first, second, np.array([0.0, 2.0, 0.0])])
    products = np.zeros((1, 2, 1, 1, 4, 4))
    products[0, 0, 0, 0, :3, :3] = stack @ stack.T
    products[0, 1, 0, 0, 2, 2] = 5.0
    moves = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(_reach(moves, products), [[1.0, 0.0], [4.0 / 9.0, 5.0 / 9.0]])
    joint = _together(moves, products)
    both, other = first + 0.5 * second, stack[2]
    sizes = [both @ both, other @ other + 5.0]
    expected = np.sqrt((sum(sizes) + 2.0 * both @ other) / min(sizes)) if both @ other < 0 else 1.0
    assert joint[0, 1] == pytest.approx(min(expected, 1.0))


TICKS = 2400
FORCE = np.stack([np.sign(np.sin(0.02 * np.arange(TICKS))), np.zeros(TICKS)])
RATE = np.stack([np.sin(0.02 * np.arange(TICKS)), 0.3 * np.cos(0.05 * np.arange(TICKS))])
NOISE = RANDOM.standard_normal((2, TICKS))
STEPS = {COULOMB: (0.5,), VISCOUS: (2.0,)}
SPACE = 0.2 * RANDOM.standard_normal((2 * 2 * (TICKS // 2 - 1), 2))


class LinearFitter:
    """Finds the least-squares values of the rail's friction."""

    def __init__(self, evidence: Any, columns: np.ndarray) -> None:
        self.evidence, self.plant, self.space = evidence, PLANT, space_of(columns)

    def starts(self, effect: Effect) -> Any:
        return SimpleNamespace(steps=np.array(STEPS[effect]))

    def bounds(self, effects: tuple[Effect, ...]) -> tuple[np.ndarray, np.ndarray]:
        return np.full(len(effects), -1e4), np.full(len(effects), 1e4)

    def is_bounded(self, fit: Fit) -> bool:
        return fit.values[0][0] > 1000.0


def scored(
    columns: np.ndarray,
    values: tuple[float, ...],
    used: tuple[float, ...] = (),
    beside: np.ndarray | float = 0.0,
) -> tuple[Scored, Any, LinearFitter]:
    """Score the rail's friction at values; the data were made with 53 N and 8 Ns/m."""
    data = 3.0 * FORCE + 8.0 * RATE + NOISE + beside
    evidence: Any = LinearEvidence([data], [(FORCE, RATE)])
    fitter: Any = LinearFitter(evidence, columns)
    effects = (COULOMB, VISCOUS)[: len(values)]
    each = tuple((value,) for value in values)
    plant = with_values(PLANT, effects, each)
    fit = Fit(effects, each, 0.0, each, plant, PLANT if used else None, used)
    return Scorer(fitter).score(fit), evidence, fitter


def test_the_posterior_covariance_of_a_linear_model_is_that_of_least_squares():
    """With white noise the standard error is √diag (JᵀJ)⁻¹ but for chance."""
    result, evidence, _ = scored(np.zeros((SPACE.shape[0], 0)), (53.0, 8.0))
    design = np.stack([evidence.whiten([FORCE]), evidence.whiten([RATE])], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    left = evidence.residual(result.fit.plant)
    excess = max(left @ left / (2.0 * 2.0 * (TICKS // 2 - 1)), 1.0)
    stack = np.column_stack([-design, left])
    products, _ = block_products(evidence, stack)
    gradients = products[..., :2, 2].sum(axis=(1, 2)).reshape(-1, 2)
    sandwich = inverse @ (gradients.T @ gradients * 20.0 / 18.0) @ inverse
    variance = np.maximum(np.diag(sandwich), excess * np.diag(inverse))
    assert np.ravel(result.widths) == pytest.approx(np.sqrt(variance), rel=1e-4)
    assert np.sqrt(variance) == pytest.approx(np.sqrt(np.diag(inverse)), rel=0.5)
    assert result.bounded is False
    assert result.levels[0, :, 0] == pytest.approx(1.0, abs=0.1)
    assert result.inside[0, :, 0] == pytest.approx(
        [np.sum(left.reshape(2, 2, -1)[:, n] ** 2) / (2.0 * (TICKS // 2 - 1)) for n in (0, 1)]
    )
    assert result.samples[0, :, 0] == pytest.approx(2.0 * (TICKS // 2 - 1))
    assert np.all(result.pieces <= result.samples)
    assert not np.any(result.excess)


def test_an_effect_accounts_for_what_would_be_left_without_it():
    """Amplitude |x|/√((JᵀJ)⁻¹ₓₓ) relative to that of the signals, the other value taken anew."""
    result, evidence, _ = scored(np.zeros((SPACE.shape[0], 0)), (53.0, 8.0))
    design = np.stack([evidence.whiten([FORCE]), evidence.whiten([RATE])], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    signals = evidence.lines[0].measured
    power = np.sum(evidence.whiten([signals - signals.mean(axis=1, keepdims=True)]) ** 2)
    expected = np.abs([3.0, 8.0]) / np.sqrt(np.diag(inverse) * power)
    assert result.accounts == pytest.approx(expected, rel=1e-4)
    force, rate = (evidence.whiten([part]).reshape(2, 2, -1) for part in (FORCE, RATE))
    reach = [np.sum(part[:, 0] ** 2) / np.sum(part**2) for part in (force, rate)]
    assert result.reach[:, 0] == pytest.approx(reach)
    assert np.all(result.together == 1.0)


def test_what_is_left_beyond_noise_is_a_share_of_the_signals():
    result, evidence, _ = scored(np.zeros((SPACE.shape[0], 0)), (53.0, 0.0))
    left = evidence.residual(result.fit.plant).reshape(2, 2, -1)
    signals = evidence.lines[0].measured
    power = np.sum(evidence.whiten([signals - signals.mean(axis=1, keepdims=True)]) ** 2)
    beyond = np.sum(left**2, axis=(0, 2)) - 2.0 * (TICKS // 2 - 1)
    assert result.rest == pytest.approx(np.sqrt(np.maximum(beyond, 0.0) / power), rel=1e-6)
    assert result.together[0, 1] == 1.0


def test_tolerances_are_free_beside_the_effects_within_their_prior():
    """The widths are those of the joint normal matrix [J, C] with a unit prior on C."""
    result, evidence, fitter = scored(SPACE, (53.0, 8.0))
    design = np.stack([evidence.whiten([FORCE]), evidence.whiten([RATE])], axis=1)
    joint = np.column_stack([design, SPACE])
    normal = joint.T @ joint + np.diag([0.0, 0.0, 1.0, 1.0])
    inverse = np.linalg.inv(normal)
    found = fitter.space.estimate_tolerances(evidence.residual(result.fit.plant))
    left = evidence.residual(result.fit.plant) - SPACE @ found
    excess = max(left @ left / (2.0 * 2.0 * (TICKS // 2 - 1)), 1.0)
    products, _ = block_products(evidence, np.column_stack([-design, -SPACE, left]))
    gradients = products[..., :4, 4].sum(axis=(1, 2)).reshape(-1, 4)
    sandwich = inverse @ (gradients.T @ gradients * 20.0 / 16.0) @ inverse
    variance = np.maximum(np.diag(sandwich), excess * np.diag(inverse))[:2]
    assert np.ravel(result.widths) == pytest.approx(np.sqrt(variance), rel=1e-4)
    total = 2.0 * (TICKS // 2 - 1)
    powers = np.sum(left.reshape(2, 2, -1) ** 2, axis=(0, 2)) / total
    assert result.inside[0, :, 0] == pytest.approx(powers)


@pytest.mark.parametrize("used", [(), (0.3, -0.2)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tolerance_at_its_bound_stays_there_while_the_other_is_free(used, sign):
    """What is left is the residual plus C (used − t), and t is at ±1.2 or at its optimum."""
    wave = 5.0 * np.sin(0.3 * np.arange(TICKS))
    plain: Any = LinearEvidence([FORCE], [(FORCE, RATE)])
    shape = plain.whiten([np.stack([wave, wave])])
    columns = np.stack([0.1 * shape, SPACE[:, 1], 0.0 * shape], axis=1)
    known = (*used, 0.0) if used else ()
    result, evidence, _ = scored(columns, (53.0, 8.0), known, sign * wave)
    data = evidence.residual(result.fit.plant) + columns @ np.array(known or (0.0, 0.0, 0.0))
    # The wave takes 10 half widths of the first tolerance.
    bound, second = sign * 1.2, columns[:, 1]
    free = second @ (data - bound * columns[:, 0]) / (second @ second + 1.0)
    assert abs(free) < 1.2
    left = data - bound * columns[:, 0] - free * second
    total = 2.0 * (TICKS // 2 - 1)
    powers = np.sum(left.reshape(2, 2, -1) ** 2, axis=(0, 2)) / total
    assert result.inside[0, :, 0] == pytest.approx(powers)
    joint = np.column_stack([evidence.whiten([FORCE]), evidence.whiten([RATE]), second])
    inverse = np.linalg.inv(joint.T @ joint + np.diag([0.0, 0.0, 1.0]))
    products, _ = block_products(evidence, np.column_stack([-joint, left]))
    gradients = products[..., :3, 3].sum(axis=(1, 2)).reshape(-1, 3)
    sandwich = inverse @ (gradients.T @ gradients * 20.0 / 17.0) @ inverse
    excess = max(left @ left / (2.0 * total), 1.0)
    variance = np.maximum(np.diag(sandwich), excess * np.diag(inverse))[:2]
    assert np.ravel(result.widths) == pytest.approx(np.sqrt(variance), rel=1e-4)


def test_a_band_that_a_recording_does_not_have_has_no_independent_samples():
    short = NOISE[:, :800]
    empty = [(NOISE * 0.0, NOISE * 0.0), (short * 0.0, short * 0.0)]
    evidence: Any = LinearEvidence([NOISE, short], empty, 0.0)
    size = sum(4 * lines.weight.shape[1] for lines in evidence.lines)
    fitter: Any = LinearFitter(evidence, np.zeros((size, 0)))
    result = Scorer(fitter).score(Fit((), (), 0.0, (), PLANT))
    assert not np.any(result.samples[1, :, 3])
    assert not np.any(result.pieces[1, :, 3])
    assert np.all(result.pieces[0] >= 60.0)


def test_signals_count_without_their_means_and_derivatives_with_shortened_steps():
    """The second step of a derivative is the first times √((0.05 χ² + 1e-6 p)/p), at most 1."""
    data = 3.0 * FORCE + 8.0 * RATE + NOISE + 40.0
    evidence: Any = LinearEvidence([data], [(FORCE, RATE)])
    asked: list[float] = []
    swings: list[np.ndarray] = []
    residual, whiten = evidence.residual, evidence.whiten
    evidence.residual = lambda plant: (asked.append(plant.rail.viscous), residual(plant))[1]
    evidence.whiten = lambda parts: (swings.append(parts[0]), whiten(parts))[1]
    fitter: Any = LinearFitter(evidence, np.zeros((SPACE.shape[0], 0)))
    fitter.starts = lambda effect: SimpleNamespace(steps=np.array([50.0]))
    scorer = Scorer(fitter)
    np.testing.assert_allclose(swings[0].mean(axis=1), 0.0, atol=1e-12)
    plant = with_values(PLANT, (VISCOUS,), ((8.0,),))
    scorer.score(Fit((VISCOUS,), ((8.0,),), 0.0, ((1.0,),), plant))
    left = residual(plant)
    power = 2500.0 * np.sum(whiten([RATE]) ** 2)
    share = np.sqrt((0.05 * left @ left + 1e-6 * power) / power)
    assert share < 1.0
    assert asked[:3] == pytest.approx([8.0, 58.0, 8.0 + 50.0 * share])


def test_a_score_is_worked_out_once_and_a_fit_without_effects_has_no_widths():
    data = 3.0 * FORCE + NOISE
    evidence: Any = LinearEvidence([data], [(FORCE, RATE)])
    fitter: Any = LinearFitter(evidence, np.zeros((SPACE.shape[0], 0)))
    scorer = Scorer(fitter)
    empty = Fit((), (), 0.0, (), RigPlant())
    first = scorer.score(empty)
    assert scorer.score(empty) is first
    assert first.widths == ()
    assert first.reach.shape == first.together.shape == (0, 0)
    assert first.accounts.shape == first.rest.shape == (0,)
    assert first.bounded is False
    assert first.levels == pytest.approx(first.inside)
    assert scorer.score(Fit((COULOMB,), ((1200.0,),), 0.0, ((1.0,),), PLANT)).bounded is True
