"""Covariance of fitted effects, and doubts that follow from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.effect_fit import FittedParameter
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.fit import Fit, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import take_derivatives
from rigtwin.diagnosis.scoring import Scorer
from rigtwin.numerics.arrays import Array

WIDTH = 1.96
"""Half width of a 95 % interval of a normal distribution, in standard deviations."""
CONFOUNDED = 0.05
"""Eigenvalue of the correlation matrix below which a combination counts as undetermined."""
SINGULAR = 1e-10
"""Least eigenvalue of a scaled normal matrix; what is smaller is rounding."""
TAKES_PART = 0.3
"""Share of a combination from which a parameter counts as part of it."""
TIED = 4.0
"""χ² by which two optima may differ and still explain the data equally well."""
DISTINCT = 3.0
"""Standard deviations by which two optima have to differ to count as two."""


def relative_errors_of(evidence: Evidence | None, plant: Plant) -> tuple[float, ...]:
    """Return the relative prediction error of each recording; empty without evidence."""
    return () if evidence is None else tuple(map(float, relative_errors(evidence, plant)))


def find_covariance(fitter: Fitter, fit: Fit) -> Array:
    """Return the covariance of the values: the inverse normal matrix with all tolerances free.

    Where the model leaves more than the expected noise, the rest counts as noise: the covariance
    grows by χ² over its expected value. Where neighbouring samples of the rest are correlated, it
    grows to the scatter over blocks of time (`Scored.widths`), and the correlations stay.
    """
    evidence = fitter.evidence
    base = fit.base if fit.base is not None else evidence.plant
    steps = np.concatenate([fitter.starts(effect).steps for effect in fit.effects])
    cuts = np.cumsum([len(values) for values in fit.values])[:-1]

    def residual(vector: Array) -> Array:
        values = [tuple(part.tolist()) for part in np.split(vector, cuts)]
        return evidence.residual(with_values(base, fit.effects, values))

    optimum = np.concatenate([np.asarray(values, float) for values in fit.values])
    rest = residual(optimum)
    low, high = fitter.bounds(fit.effects)
    jacobian = take_derivatives(residual, optimum, rest, steps, high)
    normal, _ = fitter.space.without_replaced(fit.effects).normal_equations(jacobian, rest)
    excess = max(fit.misfit / evidence.expected, 1.0)
    covariance = _invert(normal, steps, high - low) * excess
    formal = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    widths = np.concatenate(Scorer(fitter).score(fit).widths)
    growth = np.maximum(np.minimum(widths, high - low) / formal, 1.0)
    return np.asarray(covariance * np.outer(growth, growth))


def _invert(normal: Array, steps: Array, ranges: Array) -> Array:
    """Return the inverse of a normal matrix in units of `steps`, in SI.

    A direction that the data say nothing about gets the variance of the whole range instead of
    none, as a pseudo-inverse would give it.
    """
    # The information per squared step that corresponds to a standard deviation of the whole range.
    least = (steps / ranges) ** 2
    scale = np.sqrt(np.maximum(np.diag(normal), least))
    eigenvalues, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    inverse = (vectors / np.maximum(eigenvalues, SINGULAR)) @ vectors.T
    # The deviations are limited to the ranges, and the correlations of the inverse stay.
    widest = np.minimum(np.sqrt(np.diag(inverse)) * steps / scale, ranges)
    sizes = np.sqrt(np.diag(inverse))
    return inverse / np.outer(sizes, sizes) * np.outer(widest, widest)


def list_parameters(machine: Machine, fit: Fit, covariance: Array) -> tuple[FittedParameter, ...]:
    """Return the fitted parameters with their intervals."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    parameters: list[FittedParameter] = []
    for effect, values in zip(fit.effects, fit.values, strict=True):
        nominal = effect.nominal(machine.plant)
        quantities = effect.quantities()
        for name, value in zip(effect.kind.parameters, values, strict=True):
            # The length of the list is the index of the next value in the flat order of the
            # covariance.
            half = WIDTH * float(deviations[len(parameters)])
            quantity = quantities[name]
            parameters.append(
                FittedParameter(
                    name=effect.name if len(values) == 1 else f"{effect.name} {name}",
                    value=value,
                    low=max(value - half, quantity.low),
                    high=min(value + half, quantity.high),
                    nominal=nominal[name],
                    unit=machine.unit(effect.group, quantity),
                )
            )
    return tuple(parameters)


def find_doubts(
    fitter: Fitter,
    fit: Fit,
    parameters: Sequence[FittedParameter],
    covariance: Array,
    optima: Sequence[Fit],
) -> list[str]:
    """Return a line for everything that makes a value doubtful."""
    doubts = []
    if fitter.is_bounded(fit):
        doubts.append("a value is at the end of what is physically possible")
    doubts += [
        f"{p.name}: the data allow the nominal value too ({p.low:.4g} to {p.high:.4g} {p.unit})"
        for p in parameters
        if p.low <= p.nominal <= p.high
    ]
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    # An eigenvector of a small eigenvalue of the correlation matrix is a combination that the data
    # determine, although they determine none of its members.
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(deviations, deviations))
    for eigenvalue, vector in zip(eigenvalues, vectors.T, strict=True):
        members = [
            f"{weight / deviation:+.3g} × {p.name}"
            for weight, deviation, p in zip(vector, deviations, parameters, strict=True)
            if abs(weight) >= TAKES_PART
        ]
        if eigenvalue < CONFOUNDED and len(members) > 1:
            doubts.append(
                "confounded: the data determine "
                + " ".join(members)
                + " far better than each of them"
            )
    best = optima[0]
    flat_best = np.concatenate([np.asarray(values) for values in best.values])
    for rival in optima[1:]:
        distance = np.abs(np.concatenate([np.asarray(v) for v in rival.values]) - flat_best)
        if rival.misfit - best.misfit < TIED and np.any(distance > DISTINCT * deviations):
            values = ", ".join(f"{v:.4g}" for values in rival.values for v in values)
            doubts.append(f"several optima: {values} explains the data as well")
            break
    return doubts
