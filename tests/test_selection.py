"""Which explanation of a rough model is named: the simplest that predicts what it was not fitted
to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigtwin.components import Guide
from rigtwin.components.guide import resists
from rigtwin.description.catalogue import find
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.held_out_judge import Judged
from rigtwin.diagnosis.selection import choose, conclude, tell_apart
from rigtwin.diagnosis.thresholds import SelectionRules
from rigtwin.models.start import find_slopes, fit_start, read_start

TIME = np.arange(400) * 5e-3


def judged(error: float, width: float = 0.0) -> Judged:
    fit = Fit((), ((2.0,),), 0.0, (), None)  # type: ignore[arg-type]
    return Judged(fit, np.full((2, 40), error**2), ((width,),))


def test_the_score_is_the_logarithm_of_the_error_whatever_the_noise():
    assert judged(0.2).score - judged(0.1).score == pytest.approx(np.log(2.0))
    quiet, loud = np.full(40, 0.01), np.full(40, 100.0)
    both = Judged(judged(1.0).fit, np.stack([quiet, loud]))
    assert both.score == pytest.approx(0.0)


def test_an_error_that_lies_in_one_block_says_little():
    one, other = np.full((1, 40), 1.0), np.full((1, 40), 1.0)
    other[0, 0] = 20.0
    spread = np.full((1, 40), float(other.mean()))
    plain = Judged(judged(1.0).fit, one)
    apart = Judged(judged(1.0).fit, other).uncertainty_against(plain)
    assert apart > 10.0 * Judged(judged(1.0).fit, spread).uncertainty_against(plain)


@pytest.mark.parametrize(("width", "stable"), [(0.1, True), (0.6, False)])
def test_a_magnitude_must_be_known(width: float, stable: bool):
    assert judged(0.1, width).is_stable([0.0], 4.0) is stable


@pytest.mark.parametrize(
    ("guide", "holds"),
    [
        (Guide(coulomb=2.0, asymmetry=3.0), True),
        (Guide(coulomb=1.0, asymmetry=-3.0), False),
        (Guide(coulomb=1.0, asymmetry=1.95), False),
        (Guide(viscous=2.0, viscous_asymmetry=-5.0), False),
    ],
)
def test_friction_resists(guide: Guide, holds: bool):
    assert resists(guide) is holds


DAMPER = find("damper-bench")
EFFECTS = {str(effect.name): effect for effect in DAMPER.effects()}


def explain(error: float, *names: str, width: float = 1e-3) -> Judged:
    """An explanation by effects whose magnitudes are known well, or as well as told."""
    effects = tuple(EFFECTS[f"{name}@damper"] for name in names)
    values = tuple((50.0, *[0.1] * (len(e.kind.parameters) - 1)) for e in effects)
    fit = Fit(effects, values, 0.0, (), DAMPER.plant)
    widths = tuple(tuple(width for _ in own) for own in values)
    return Judged(fit, np.full((2, 40), error**2), widths, 1e-12, 200.0, float(len(effects)))


def kinds(judged: Judged) -> set[str]:
    return {effect.kind.name for effect in judged.fit.effects}


def chosen(*pool: Judged) -> set[str]:
    return kinds(choose(pool, DAMPER.plant, SelectionRules()))


def test_the_simplest_of_those_that_do_as_well_is_chosen():
    none, one = explain(1.0), explain(0.1, "coulomb")
    assert chosen(none, one, explain(0.098, "coulomb", "viscous")) == {"coulomb"}
    assert chosen(none, one, explain(0.05, "coulomb", "viscous")) == {"coulomb", "viscous"}


def test_beyond_what_leaves_nothing_but_noise_nothing_is_chosen():
    none, one = explain(1.0), replace(explain(0.006, "coulomb"), complete=True)
    two = explain(0.003, "coulomb", "stiffness")
    assert chosen(none, one, two) == chosen(none, one, replace(two, complete=True)) == {"coulomb"}
    assert chosen(none, explain(0.006, "coulomb"), two) == {"coulomb", "stiffness"}


@pytest.mark.parametrize(("without", "apart"), [(0.3, True), (0.12, False)])
def test_effects_of_like_responses_are_told_apart_where_both_are_missed(
    without: float, apart: bool
):
    alike = replace(explain(0.1, "coulomb", "viscous"), collinear=True)
    pool = [explain(1.0), explain(0.4, "coulomb"), explain(without, "viscous"), alike]
    # What takes the place of one of them does not put them in doubt.
    pool.append(explain(0.11, "coulomb", "stiffness"))
    rules = SelectionRules()
    assert tell_apart(pool, DAMPER.plant, rules)[3].doubtful is not apart
    assert tell_apart([pool[0], pool[1], alike], DAMPER.plant, rules)[2].doubtful
    assert kinds(conclude(pool[:4], DAMPER.plant, rules).chosen) == (
        {"coulomb", "viscous"} if apart else {"viscous"}
    )


def test_what_few_machines_have_must_account_for_much():
    none, one = explain(1.0), explain(0.04, "coulomb")
    assert chosen(none, one, explain(0.025, "coulomb", "backlash")) == {"coulomb"}
    rough = explain(0.3, "coulomb")
    assert chosen(none, rough, explain(0.2, "coulomb", "backlash")) == {"coulomb", "backlash"}
    # What leaves nothing but noise is all there is.
    third = explain(0.014, "coulomb", "backlash")
    assert chosen(none, one, third) == {"coulomb"}
    assert chosen(none, one, replace(third, complete=True)) == {"coulomb", "backlash"}
    # A difference that is no part of the signals to speak of, but leaves a fifth.
    assert chosen(none, one, explain(0.008, "coulomb", "backlash")) == {"coulomb", "backlash"}


def test_many_parameters_that_nobody_knows_are_no_rival_of_few():
    none, two = explain(1.0), explain(0.1, "viscous", "stiffness")

    def margin(width: float) -> float:
        """Of the stiffness, beside a larger explanation whose magnitudes are known so well."""
        rival = explain(0.095, "viscous", "coulomb", "offset", width=width)
        found = conclude([none, two, rival], DAMPER.plant, SelectionRules())
        assert kinds(found.chosen) == {"viscous", "stiffness"}
        return found.support(EFFECTS["stiffness@damper"]).margin

    assert margin(1e-3) < 0.1
    assert margin(20.0) > 1.0


def test_much_is_not_given_up_for_a_doubt():
    none, two = explain(1.0), explain(0.1, "viscous", "stiffness")
    # Four that do nearly as well without one of them put it in doubt, and are in doubt themselves.
    larger = explain(0.085, "viscous", "coulomb", "offset", "viscous_asymmetry")
    assert chosen(none, two, larger) == {"viscous", "stiffness"}


def test_recordings_that_nothing_was_fitted_to_count_as_much_as_the_others():
    none, first, second = explain(1.0), explain(0.1, "coulomb"), explain(0.15, "viscous")
    more = explain(0.09, "coulomb", "stiffness")
    found = conclude([none, first, second, more], DAMPER.plant, SelectionRules())
    assert kinds(found.chosen) == {"coulomb"}

    def errors(fit: Fit) -> np.ndarray:
        left = {"viscous": 0.15, "coulomb": 0.6, "stiffness": 0.01}
        return np.full(2, left[fit.effects[-1].kind.name] if fit.effects else 1.0)

    # What has more parameters than the search asked for is no finding of other recordings.
    assert kinds(found.beside(errors).chosen) == {"viscous"}
    assert kinds(found.beside(lambda fit: np.full(2, 0.1)).chosen) == {"coulomb"}


def test_what_runs_to_a_bound_on_all_ticks_is_not_chosen():
    none, first, second = explain(1.0), explain(0.1, "coulomb"), explain(0.15, "viscous")
    found = conclude([none, first, second], DAMPER.plant, SelectionRules())
    assert kinds(found.without(found.chosen).chosen) == {"viscous"}


def swing(start: np.ndarray) -> np.ndarray:
    position, velocity = start
    return np.exp(-TIME) * (
        position * np.cos(7.0 * TIME) + (velocity + position) / 7.0 * np.sin(7.0 * TIME)
    )


def test_a_start_is_not_led_astray_by_derivatives_that_hold_nearby_only():
    # What swings over tells nothing of the way there: a step must do better to be taken.
    def turning(start: np.ndarray) -> np.ndarray:
        return np.sin(40.0 * start[1] + TIME)

    first, error = np.array((0.0, 0.0)), np.array((1e-3, 0.05))
    slopes = find_slopes(turning, first, error, turning(first))
    measured = turning(np.array((0.0, 0.09)))
    found = fit_start(turning, measured, first, error, 1e-3, slopes, turning(first))
    assert np.sum((turning(found) - measured) ** 2) <= np.sum((turning(first) - measured) ** 2)


def test_a_free_swings_start_is_found_beneath_coarse_bits():
    truth = np.array((0.6, 0.3))
    measured = np.round(swing(truth) / 1.5e-3) * 1.5e-3
    first, error = np.array(read_start(measured, 5e-3)), np.array((1.5e-3, 0.1))
    slopes = find_slopes(swing, first, error, swing(first))
    found = fit_start(swing, measured, first, error, 1e-3, slopes, swing(first))
    assert found == pytest.approx(truth, abs=2e-3)
    assert abs(found[1] - truth[1]) < abs(first[1] - truth[1])
