"""By what explanations are ranked, and which of them are needless."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

LATE = ("lag", "delay", "two_lags", "resonance")
"""Kinds that make a signal late, each in its own way."""
CONTAINED = {
    "two_lags": ("lag",),
    "mount": ("compliance", "relaxation"),
    "deadband_asymmetry": ("deadband",),
}
"""Kind → the simpler ones that it becomes at the end of its range, or where little else acts."""


def penalised_cost(fit: Fit, price: float) -> float:
    """χ² of a fit with a price on its parameters.

    Parameters
    ----------
    fit
        Of any effects.
    price
        χ² for each parameter.

    Returns
    -------
    float
        What explanations are ranked by, the least first.
    """
    return fit.misfit + price * sum(len(effect.kind.parameters) for effect in fit.effects)


def best_of_each(fits: Sequence[Fit], cost: Callable[[Fit], float]) -> list[Fit]:
    """The cheapest fit of each set of effects, the cheapest first: a search that comes to one
    explanation by two ways has not found two."""
    found: dict[frozenset[tuple[str, str]], Fit] = {}
    for fit in sorted(fits, key=cost):
        found.setdefault(frozenset((e.kind.name, e.group) for e in fit.effects), fit)
    return list(found.values())


def drop_needless(
    tried: Sequence[Fit], least: float, thresholds: Thresholds = STANDARD
) -> list[Fit]:
    """The fits less those in which a simpler effect would do as well.

    Parameters
    ----------
    tried
        Fits of any effects.
    least
        χ² by which the less simple one must do better.
    thresholds
        What figures are held against.

    Returns
    -------
    list of Fit
        Those that stay, in their order.
    """
    misfits = {frozenset((e.kind.name, e.group) for e in fit.effects): fit.misfit for fit in tried}
    most = max((fit.misfit for fit in tried), default=0.0)
    found = []
    for fit in tried:
        names = {(e.kind.name, e.group) for e in fit.effects}
        simpler = [
            frozenset((names - {(kind, group)}) | {(simpler, group)})
            for kind, group in names
            for simpler in CONTAINED.get(kind, ())
        ]
        enough = max(least, thresholds.slight * (most - fit.misfit))
        if not any(other in misfits and misfits[other] - fit.misfit < enough for other in simpler):
            found.append(fit)
    return found


def within_tolerance(fit: Fit, evidence: Evidence, thresholds: Thresholds = STANDARD) -> bool:
    """Whether one of the effects is no more than its declared tolerance.

    Parameters
    ----------
    fit
        Of any effects.
    evidence
        That it was fitted to.
    thresholds
        What figures are held against.

    Returns
    -------
    bool
        True if it explains nothing but a tolerance.
    """
    return any(
        _is_tolerated(effect, values[0], evidence, thresholds.within_tolerance)
        for effect, values in zip(fit.effects, fit.values, strict=True)
    )


def _is_tolerated(effect: Effect, value: float, evidence: Evidence, widths: float) -> bool:
    """Whether a value is off nominal by at most so many tolerances."""
    parameter = effect.kind.parameters[0]
    tolerance = evidence.machine.tolerance_of(effect.group, parameter)
    if tolerance is None:
        return False
    width = evidence.width(tolerance)
    if tolerance.relative:
        width = tolerance.half_width * abs(effect.nominal(evidence.plant)[parameter])
    return abs(value - effect.nominal(evidence.plant)[parameter]) <= widths * width
