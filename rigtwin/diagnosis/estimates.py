"""Estimates of effects: values, standard errors and their units."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rigtwin.components import UNLIMITED, Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.explain import Explanation
from rigtwin.diagnosis.finding import Estimate
from rigtwin.diagnosis.starts import LATE_BY_TIME
from rigtwin.diagnosis.support import Support
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

WIDEST = 0.9
"""Upper bound on the half interval that a residual widens, as a share of the distance to nominal.

Widening alone therefore never makes an interval hold the nominal value."""


def is_timing(effect: Effect, values: Sequence[float], evidence: Evidence) -> bool:
    """Return whether an effect shifts a signal by no more than the tolerance of its sampling.

    Parameters
    ----------
    effect
        Effect that was fitted.
    values
        Values of its parameters, SI.
    evidence
        Recordings that were fitted.

    Returns
    -------
    bool
        True for a lag or delay that is no finding.
    """
    if effect.kind.name not in LATE_BY_TIME:
        return False
    (shift,) = effect.distances(values, evidence.plant)
    return shift <= _timing(evidence)


def _timing(evidence: Evidence) -> float:
    """Return the tolerance of the sampling time within a tick, s."""
    return max((evidence.width(t) for t in evidence.machine.tolerances if t.ticks), default=0.0)


def standard_errors(
    explanation: Explanation, support: dict[Effect, Support], thresholds: Thresholds
) -> list[tuple[float, ...]]:
    """Standard errors of all values of the best hypothesis, one tuple per effect.

    The standard error of a value is

        sqrt(max(s_cv, s_fit)^2 + s_hypotheses^2 + b^2),
        b^2 = (c^2 / d^2 + s^2) (value - nominal)^2,

    with the standard errors of cross-validation and of the final fit, the spread of the value over
    comparable hypotheses, and a bias b of two causes. The declared parameters have a scale that is
    known to the share s only (`ModelPrior.scale`). A residual is unexplained: if its amplitude is
    1/d of the effect's response, it shifts the magnitude by 1/d times the correlation of both, of
    which only the usual size c (`Thresholds.rest_correlation`) is known. The bias widens the
    interval but does not lower the confidence: `Support.mimic` covers an effect that merely
    resembles the residual.
    """
    posterior, errors = explanation.posterior, []
    scale = posterior.prior.scale
    for effect, values, scored, fitted in zip(
        explanation.fit.effects,
        explanation.fit.values,
        posterior.best.widths,
        explanation.fit.widths,
        strict=True,
    ):
        parts = zip(scored, fitted, posterior.spread(effect), strict=True)
        formal = [math.hypot(max(held_out, fit), spread) for held_out, fit, spread in parts]
        distance = _largest_change(effect, values, posterior.nominal)
        share = math.hypot(thresholds.rest_correlation / support[effect].dominance, scale)
        bias = share * distance
        widest = WIDEST * distance / thresholds.interval_half_width
        count = effect.kind.magnitudes
        # The limit applies to the bias alone: a formal error beyond it stays as it is. A residual
        # says little about shapes, so only magnitudes are widened.
        widened = [min(math.hypot(width, bias), max(width, widest)) for width in formal[:count]]
        errors.append((*widened, *formal[count:]))
    return errors


def _largest_change(effect: Effect, values: Sequence[float], nominal: Plant) -> float:
    """Return the largest distance of an effect's magnitudes from nominal.

    Several magnitudes are the coefficients of one force, which a bias shifts as a whole. A limit
    that the nominal machine lacks is compared with zero.
    """
    magnitudes = values[: effect.kind.magnitudes]
    return max(
        abs(value) if distance > 0.5 * UNLIMITED else distance
        for value, distance in zip(magnitudes, effect.distances(values, nominal), strict=True)
    )


def estimates(
    effect: Effect,
    values: Sequence[float],
    widths: Sequence[float],
    evidence: Evidence,
    wider: float = STANDARD.interval_half_width,
) -> dict[str, Estimate]:
    """Return the fitted parameters of an effect with their intervals.

    Parameters
    ----------
    effect
        Effect that was fitted.
    values, widths
        Values of its parameters and their standard errors, SI.
    evidence
        Recordings that were fitted.
    wider
        Half width of an interval in standard errors.

    Returns
    -------
    dict
        Parameter name → estimate, for the parameters that the recordings determine.
    """
    nominal = effect.nominal(evidence.plant)
    # The instant of sampling within a tick is a tolerance, so no delay is known better than that.
    # Divided here because the interval is `wider` times as wide: half of it is then at least the
    # tolerance.
    least: dict[str, float] = {name: _timing(evidence) / wider for name in LATE_BY_TIME}
    return {
        name: Estimate(
            value,
            max(value - wider * max(width, least.get(name, 0.0)), quantity.low),
            min(value + wider * max(width, least.get(name, 0.0)), quantity.high),
            nominal[name],
            evidence.machine.unit(effect.group, quantity),
        )
        for (name, quantity), value, width in zip(
            effect.quantities().items(), values, widths, strict=True
        )
        # A secondary parameter of width zero was not fitted: no recorded motion depends on it.
        if width > 0.0 or name in (effect.kind.parameters[0], *effect.kind.constants)
    }
