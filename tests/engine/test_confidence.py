"""What the confidence in an effect rests on, from written-out residuals and fits."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.components import find
from rigtwin.diagnosis.confidence import (
    _corrects_form,
    _share_of,
    relative_rest,
    support_of,
)
from rigtwin.diagnosis.lines import Lines
from rigtwin.diagnosis.thresholds import STANDARD
from tests.engine.linear import PLANT, lines_of

VISCOUS, COULOMB = find("viscous@rail", PLANT), find("coulomb@rail", PLANT)
ERROR, REST, MIMICRY, FORM = 0.05, 0.15, 0.17, 0.14


def logistic(ratio: float) -> float:
    """Return 1/(1 + r⁻⁴), one half at r = 1."""
    return 0.0 if ratio <= 0.0 else 1.0 / (1.0 + ratio**-4.0)


def recorded(signals: np.ndarray, noise: list[float], counted: int) -> Lines:
    """Return a recording of which only the first ticks count."""
    fade = np.zeros(signals.shape)
    fade[:, :counted] = 1.0
    fade[:, counted:] = 0.5
    return lines_of(signals, np.array(noise), fade)


SIGNALS = [
    np.array([[1.0, -1.0, 1.0, -1.0, 90.0], [2.0, 0.0, 2.0, 0.0, 90.0]]),
    np.array([[3.0, -3.0, 3.0, 50.0, 50.0], [1.0, 1.0, 4.0, 50.0, 50.0]]),
]
OFF = np.array([0.5, 0.4])
"""How far predictions are from both signals, as a share of an alternating ±1."""


def evidence_of(off: float, nominal: float = 1.0) -> Any:
    """Return evidence that is off by OFF times a share, another one at the nominal plant."""

    def predict(plant: object) -> list[np.ndarray]:
        share = nominal if plant is PLANT else off
        return [signals - share * OFF[:, None] for signals in SIGNALS]

    lines = [recorded(SIGNALS[0], [0.1, 0.0], 4), recorded(SIGNALS[1], [0.2, 0.0], 3)]
    machine = SimpleNamespace(prior=SimpleNamespace(error=ERROR, form=FORM))
    return SimpleNamespace(lines=lines, predict=predict, plant=PLANT, machine=machine)


SWING = np.array([(1.0 + 8.0) / 2.0, (1.0 + 2.0) / 2.0])
"""Mean variance of the counted parts of both signals."""
NOISE = np.array([(0.01 + 0.04) / 2.0, 0.0])


def written_rest(off: float) -> np.ndarray:
    """Return √(max(mean r² − noise², 0)/variance) of both signals."""
    return np.sqrt(np.maximum((off * OFF) ** 2 - NOISE, 0.0) / SWING)


@pytest.mark.parametrize("off", [1.0, 0.4, 0.1])
def test_the_relative_rest_is_what_exceeds_noise_in_standard_deviations(off):
    corrected: Any = PLANT._replace()
    found = relative_rest(evidence_of(off), corrected)
    np.testing.assert_allclose(found, written_rest(off), atol=1e-12)


def posterior_of(value: float, rest: float, reach: list[float]) -> Any:
    fit = SimpleNamespace(
        effects=(COULOMB, VISCOUS), values=((53.0,), (value, 0.7)), plant=PLANT._replace()
    )
    best = SimpleNamespace(
        fit=fit,
        widths=((1.0,), (2.0, 9.0)),
        reach=np.array([[1.0, 0.0], reach]),
        rest=np.array([0.02, 0.05]),
        accounts=np.array([0.9, 0.3]),
    )
    empty = SimpleNamespace(fit=SimpleNamespace(effects=()))
    return SimpleNamespace(
        best=best,
        empty=empty,
        ranking=[SimpleNamespace(scored=best), SimpleNamespace(scored=empty)],
        # Every effect explains all of the gap, so that none only corrects the form of a law.
        excess=lambda scored: np.array([1.0 if scored is empty else 0.0]),
        residual_excess=rest,
        inclusion=lambda effect: 0.87,
        margin=lambda effect: 12.0,
    )


@pytest.mark.parametrize("off", [1.0, 0.4, 0.2])
@pytest.mark.parametrize("reach", [[0.25, 0.75], [0.0, 1.0]])
@pytest.mark.parametrize("rest", [0.0, 0.1, 0.4])
def test_the_support_of_an_effect_is_written_out(off, reach, rest):
    """Steadiness |v − nominal|/width, dominance A/√(reach · rest²), mimic a product of three
    logistic functions."""
    found = support_of(VISCOUS, posterior_of(7.0, rest, reach), evidence_of(off), STANDARD)
    after, before = np.array(reach) @ written_rest(off), np.array(reach) @ written_rest(1.0)
    assert found.probability == 0.87
    assert found.margin == 12.0
    assert found.steadiness == pytest.approx(7.0 / 2.0)
    rubbing = support_of(COULOMB, posterior_of(7.0, rest, reach), evidence_of(off), STANDARD)
    assert rubbing.steadiness == pytest.approx((53.0 - 50.0) / 1.0)
    assert found.remains == pytest.approx(min(after / before, 1.0))
    amplitude = np.sqrt(np.array(reach) @ np.array([0.02, 0.05]) ** 2)
    assert found.dominance == pytest.approx(0.3 / amplitude)
    ratios = (after / ERROR, rest / REST, after / before / MIMICRY)
    mimic = math.prod(logistic(float(ratio)) for ratio in ratios)
    assert found.mimic == pytest.approx(mimic, abs=1e-9)


@pytest.mark.parametrize("share", [0.02, 0.14, 0.6])
@pytest.mark.parametrize("remains", [0.001, 0.02, 0.3])
def test_a_rare_effect_that_explains_little_may_correct_the_form_of_a_law(share, remains):
    """m = 1/(1 + (a/form)^8) · L(8 · remains/a)."""
    expected = 1.0 / (1.0 + (share / FORM) ** 8) * logistic(8.0 * remains / share)
    assert _corrects_form(share, FORM, remains, 8.0) == pytest.approx(expected)


def test_the_share_of_an_effect_is_what_returns_without_it():
    """√((excess without it − excess with it)/gap), of the signals that the effect reaches."""
    backlash = find("backlash@rail", PLANT)
    reach = np.array([[0.5, 0.5], [0.25, 0.75]])
    scored = {
        effects: SimpleNamespace(fit=SimpleNamespace(effects=effects), reach=reach)
        for effects in ((), (COULOMB,), (COULOMB, backlash))
    }
    excess = dict(zip(scored, ([60.0, 40.0], [20.0, 5.0], [8.0, 1.0]), strict=True))
    posterior: Any = SimpleNamespace(
        best=scored[COULOMB, backlash],
        empty=scored[()],
        ranking=[SimpleNamespace(scored=scored[effects]) for effects in reversed(scored)],
        excess=lambda one: np.array(excess[one.fit.effects]),
    )
    assert _share_of(backlash, posterior) == pytest.approx(math.sqrt((3.0 + 3.0) / 45.0))
    assert _share_of(COULOMB, posterior) == pytest.approx(math.sqrt((26.0 + 19.5) / 50.0))


def test_remains_stay_within_the_gap_and_are_none_without_a_gap():
    reach = [0.25, 0.75]
    worse = support_of(VISCOUS, posterior_of(7.0, 0.1, reach), evidence_of(2.0), STANDARD)
    assert worse.remains == 1.0
    none = support_of(VISCOUS, posterior_of(-3.0, 0.1, reach), evidence_of(0.5, 0.0), STANDARD)
    assert none.remains == 0.0
    assert none.mimic == pytest.approx(0.0, abs=1e-9)
    assert none.steadiness == pytest.approx(1.5)


def test_dominance_stays_between_a_thousandth_and_a_thousand():
    for accounts, expected in ((0.3, 1000.0), (0.0, 0.001)):
        posterior = posterior_of(7.0, 0.1, [0.5, 0.5])
        posterior.best.rest = np.zeros(2) if accounts else np.ones(2)
        posterior.best.accounts = np.array([1.0, accounts])
        found = support_of(VISCOUS, posterior, evidence_of(0.4), STANDARD)
        assert found.dominance == expected
