"""Further minima of a misfit, at other magnitudes of the fitted effects.

A free motion that sticks and slips, or whose phase drifts, ripples the misfit: on the way to the
true value it has minima in which Gauss-Newton ends. They are left by trying magnitudes farther
away, each at the cost of one prediction.
"""

from __future__ import annotations

from rigtwin.diagnosis.fit import Fit, Values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import is_sufficient

FACTORS = (0.4, 0.6, 0.8, 1.25, 1.6, 2.5)
"""Factors of a magnitude's distance from nominal that are tried."""
ROUNDS = 3
"""Largest number of times that all magnitudes are tried."""
EXPLAINS = 0.1
"""Share of the nominal misfit that a fit must explain, or its minima are not worth the time."""


def leave_minimum(fitter: Fitter, fit: Fit) -> Fit:
    """Look for a lower minimum at other magnitudes.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit about the nominal plant.

    Returns
    -------
    Fit
        Fit of the same effects, of the same misfit or less.
    """
    nominal = fitter.nominal_fit.misfit
    for _ in range(ROUNDS):
        explains = fit.misfit < (1.0 - EXPLAINS) * nominal
        if not explains or is_sufficient(fit.misfit, fitter.evidence.expected):
            return fit
        lowest, values = min(
            (_misfit(fitter, fit, values), values) for values in _list_others(fitter, fit)
        )
        if lowest >= fit.misfit:
            return fit
        fit = fitter.refine(fit.effects, values)
    return fit


def _list_others(fitter: Fitter, fit: Fit) -> list[Values]:
    """Return the values of a fit with one effect's magnitude changed."""
    others = []
    for number, effect in enumerate(fit.effects):
        for factor in FACTORS:
            scaled = fitter.scale_start(effect, fit.values[number], factor)
            others.append((*fit.values[:number], *scaled, *fit.values[number + 1 :]))
    return others


def _misfit(fitter: Fitter, fit: Fit, values: Values) -> float:
    plant = with_values(fitter.plant, fit.effects, values)
    return fitter.space.misfit(fitter.evidence.residual(plant))
