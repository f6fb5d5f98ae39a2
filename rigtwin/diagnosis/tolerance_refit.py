"""Fits of effects with the tolerances moved to where the recordings have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.effect_starts import LIMITS
from rigtwin.diagnosis.fit import Fit, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import is_sufficient
from rigtwin.diagnosis.space import Space

PERTURBATIONS = (0.88, 0.95, 1.05, 1.12)
"""Factors of a fitted value from which the fit is repeated."""
TOLERANCE_PASSES = 2
"""Number of times that the tolerances are estimated at a fit."""
TOLERANCE_CHANGE = 0.05
"""Change of every tolerance, in half widths, below which they are not estimated again."""
SUFFICIENT_RATIO = 0.95
"""Ratio of the misfit to that of noise and declared error below which no perturbed start is
tried."""


def refit_with_tolerances(
    fitter: Fitter, fit: Fit, restarts: Sequence[float] = PERTURBATIONS
) -> Fit:
    """Refit effects with the responses to the tolerances taken at the fit.

    Estimate and refit alternate. Mechanical tolerances act nonlinearly beside dry friction, so
    they are moved in the plant itself; the others stay linear.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit about the nominal plant.
    restarts
        Factors of a fitted value from which the fit is repeated.

    Returns
    -------
    Fit
        Fit of the same effects, with `base` and `used`.
    """
    tolerances = fitter.evidence.machine.tolerances
    mechanical = np.array([tolerance.mechanical for tolerance in tolerances], bool)
    # The responses at the nominal plant are precise enough for the first estimate.
    space = fitter.space.without_replaced(fit.effects)
    used = np.zeros(len(tolerances))
    residual = fitter.evidence.residual(fit.plant)
    for number in range(TOLERANCE_PASSES):
        estimate = np.where(mechanical, space.estimate_tolerances(residual), 0.0)
        if number and np.max(np.abs(estimate - used), initial=0.0) < TOLERANCE_CHANGE:
            break
        used = estimate
        base = fitter.evidence.shift(fitter.plant, used.tolist())
        # `used` tells the space how far the plant has moved already, so that the prior still
        # pulls towards nominal and not towards the last estimate.
        space = Space(
            fitter.evidence, with_values(base, fit.effects, fit.values), used, fit.effects
        )
        refined = fitter.refine(fit.effects, fit.values, space, base)
        fit = _perturb(fitter, refined, space, base, restarts)
        residual = fitter.evidence.residual(with_values(base, fit.effects, fit.values))
        fit = replace(fit, base=base, used=tuple(used.tolist()))
    return fit


def _perturb(fitter: Fitter, fit: Fit, space: Space, base: Plant, restarts: Sequence[float]) -> Fit:
    """Restart nearby: stick-slip makes the misfit discontinuous.

    Each value is changed in turn by a few per cent, and refined again where that alone already
    lowers the misfit.
    """
    if is_sufficient(fit.misfit, fitter.evidence.expected, SUFFICIENT_RATIO):
        return fit
    for number, effect in enumerate(fit.effects):
        fitted = len(effect.kind.parameters) - len(effect.kind.constants)
        for place, share in product(range(fitted), restarts):
            perturbed = list(fit.values[number])
            # Magnitudes are scaled about their nominal value, shapes and limits about 0.
            # A limit's nominal value is practically infinite (`UNLIMITED`), so its distance
            # from there has no meaning.
            from_zero = place > 0 or effect.kind.name in LIMITS
            nominal = 0.0 if from_zero else effect.nominal(fitter.plant)[effect.kind.parameters[0]]
            perturbed[place] = nominal + share * (perturbed[place] - nominal)
            values = (*fit.values[:number], tuple(perturbed), *fit.values[number + 1 :])
            if (
                space.misfit(fitter.evidence.residual(with_values(base, fit.effects, values)))
                < fit.misfit
            ):
                fit = min(
                    fit,
                    fitter.refine(fit.effects, values, space, base),
                    key=lambda candidate: candidate.misfit,
                )
    return fit
