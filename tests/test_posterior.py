"""Weights of hypotheses and confidences: continuous, monotone, and blind to what is doubled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigtwin.components import candidates
from rigtwin.diagnosis.blocks import count_independent, find_bands, split_transforms
from rigtwin.diagnosis.deviance import deviance
from rigtwin.diagnosis.explain import explain
from rigtwin.diagnosis.posterior import HypothesisPosterior
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import STANDARD
from tests.helpers.twin import evidence_of, recorded

PIECES, SAMPLES = np.array([[[100.0]]]), np.array([[[400.0]]])


@pytest.fixture(scope="module")
def damped():
    return explain(evidence_of(recorded("imposed", ("viscous@rail=300",), 3.0)))


def density(level: float) -> float:
    return deviance(np.array([[[level]]]), PIECES, SAMPLES, STANDARD.within_noise_weight)


def test_the_density_falls_with_the_residual_and_has_no_step_at_the_noise():
    levels = np.geomspace(0.01, 1e6, 200)
    values = [density(level) for level in levels]
    assert np.all(np.diff(values) > 0.0)
    assert density(1.0 + 1e-9) == pytest.approx(density(1.0), abs=1e-5)


def test_a_discrepancy_of_unknown_scale_counts_by_its_logarithm():
    # n ln(1 + (q - 1) N / n) for n = 100 of N = 400 samples.
    expected = 100.0 * np.log((1.0 + 99.0 * 4.0) / (1.0 + 9.0 * 4.0))
    assert density(100.0) - density(10.0) == pytest.approx(expected)


def test_bands_cover_all_lines_once():
    for lines in (30, 100, 333, 3001):
        bands = find_bands(lines, 0.0)
        assert [n for band in bands for n in range(lines)[band]] == list(range(lines))
    assert find_bands(500, 1.0) == [slice(0, 500)]


def test_a_whitened_vector_is_split_into_what_it_was_made_of(damped):
    evidence = evidence_of(recorded("imposed", (), 3.0))
    differences = evidence.differences(evidence.plant)
    (expected,) = list(evidence.transforms(differences))
    (found,) = split_transforms(evidence, evidence.whiten(differences))
    assert np.allclose(found, expected)
    counted = count_independent(evidence, evidence.whiten(differences))
    assert np.all(counted >= 1.0)


def test_the_effect_that_is_there_has_nearly_all_weight(damped):
    (effect,) = damped.fit.effects
    assert effect.name == "viscous@rail"
    assert damped.posterior.inclusion(effect) > 0.99
    assert damped.posterior.closes(damped.posterior.best) > 0.9


def test_what_remains_of_each_signals_gap_is_a_share_of_its_amplitude(damped):
    posterior = damped.posterior
    whole, best = posterior.remaining(posterior.empty), posterior.remaining(posterior.best)
    gapped = posterior.excess(posterior.empty) > 0.0
    assert gapped.any()
    assert whole[gapped] == pytest.approx(1.0)
    assert np.min(best[gapped]) < 0.2


def test_weights_sum_to_one_and_follow_the_costs(damped):
    ranking = damped.posterior.ranking
    assert sum(each.weight for each in ranking) == pytest.approx(1.0)
    assert [each.cost for each in ranking] == sorted(each.cost for each in ranking)
    weights = [each.weight for each in ranking]
    assert weights == sorted(weights, reverse=True)


def test_a_rival_that_does_worse_takes_no_more_weight(damped):
    posterior = damped.posterior
    (effect,) = damped.fit.effects
    others = [each.scored for each in posterior.ranking if effect not in each.scored.fit.effects]
    before = posterior.inclusion(effect)
    for factor in (1.0 + 1e-9, 1.01, 2.0):
        worse = [replace(each, levels=factor * each.levels) for each in others]
        pool = [posterior.best, *worse]
        again = HypothesisPosterior(pool, posterior._fitter, 59, STANDARD)
        assert again.inclusion(effect) >= before - 1e-6


def test_noise_that_a_hypothesis_smooths_is_no_evidence_for_it(damped):
    posterior = damped.posterior
    best = posterior.best
    # A filter takes half the noise out of a prediction, and out of its residual.
    smooths = replace(best, levels=0.5 * best.levels, relief=np.full_like(best.levels, -0.5))
    noisy = replace(best, relief=np.full_like(best.levels, 0.5))
    halved = replace(best, levels=0.5 * best.levels)
    relieved = replace(posterior.empty, relief=np.zeros_like(posterior.empty.levels))
    posterior = HypothesisPosterior(
        [relieved, best], posterior._fitter, len(posterior._pool), STANDARD
    )
    np.testing.assert_allclose(posterior.levels(noisy), posterior.levels(best))
    np.testing.assert_allclose(
        posterior.levels(smooths) * (posterior._noise - 0.5),
        posterior.levels(halved) * posterior._noise,
    )
    assert posterior.loss(smooths) > posterior.loss(halved)


def support(**changes: float) -> Support:
    values = {
        "probability": 0.9,
        "margin": 10.0,
        "steadiness": 9.0,
        "remains": 0.0,
        "dominance": 9.0,
        "mimic": 0.0,
    }
    return Support(**{**values, **changes})


def test_confidence_grows_with_the_probability_and_is_never_certain():
    said = [support(probability=float(p)).confidence for p in np.linspace(0.0, 1.0, 50)]
    assert said == sorted(said)
    assert said[0] == 0.0
    assert said[-1] < 1.0


def test_confidence_falls_with_the_chance_of_a_mimic():
    said = [support(mimic=float(m)).confidence for m in np.linspace(0.0, 1.0, 50)]
    assert said == sorted(said, reverse=True)


@pytest.mark.parametrize(
    ("delay", "lag", "is_doubtful"),
    [
        (-0.014, 0.015, True),
        (0.014, -0.015, True),
        (0.014, 0.015, False),
        (-0.014, -0.015, False),
        (-1e-12, 0.015, False),
    ],
)
def test_a_sensor_that_is_ahead_and_lags_at_once_is_prohibitive(damped, delay, lag, is_doubtful):
    best, prices = damped.posterior.best, damped.posterior.prices
    effects = {effect.name: effect for effect in candidates(damped.fit.plant)}
    pair = (effects["delay@load_cell"], effects["lag@load_cell"])
    fit = replace(best.fit, effects=pair, values=((delay,), (lag,)))
    # Neither opposes the other, and both account for the whole signal.
    scored = replace(
        best, fit=fit, together=np.ones((2, 2)), accounts=np.ones(2), widths=((1e-4,), (1e-4,))
    )
    doubt = prices.price_values(scored) - prices.price_values(
        replace(scored, fit=replace(fit, values=((abs(delay),), (abs(lag),))))
    )
    assert doubt == pytest.approx(STANDARD.prohibitive_price if is_doubtful else 0.0, abs=1e-6)
