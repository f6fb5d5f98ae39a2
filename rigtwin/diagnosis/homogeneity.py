"""Whether several estimates of one parameter agree, and what their differences go with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from rigtwin.numerics.arrays import Array

FEWEST = 4
"""Recordings from which a trend can be named: of three, one in common with every line is left."""


@dataclass(frozen=True)
class Homogeneity:
    """Cochran's test. mean: weighted; statistic: Q = Σ (value − mean)² / width²; probability: of
    one as large if nothing differs."""

    mean: float
    statistic: float
    probability: float


def check_homogeneity(values: Array, widths: Array, freedom: float) -> Homogeneity:
    """Whether estimates agree.

    Parameters
    ----------
    values, widths
        Estimates and their standard errors, shape (recordings,).
    freedom
        Degrees of freedom that each standard error was estimated with.

    Returns
    -------
    Homogeneity
        Cochran's Q over its degrees of freedom, held against an F distribution as the standard
        errors are themselves estimates [W. G. Cochran, Biometrics 10 (1954) 101].
    """
    weights = 1.0 / np.maximum(widths, 1e-300) ** 2
    mean = float(weights @ values / weights.sum())
    statistic = float(weights @ (values - mean) ** 2)
    among = len(values) - 1
    return Homogeneity(mean, statistic, float(fdtrc(among, freedom, statistic / among)))


def correct(probabilities: Sequence[float]) -> list[float]:
    """Probabilities corrected for how many there are, after Holm.

    Parameters
    ----------
    probabilities
        Of single tests.

    Returns
    -------
    list of float
        In the same order, 1 at most [S. Holm, Scand. J. Stat. 6 (1979) 65].
    """
    order = np.argsort(probabilities)
    found, least = [1.0] * len(order), 0.0
    for rank, place in enumerate(order):
        least = max(least, min((len(order) - rank) * probabilities[place], 1.0))
        found[place] = least
    return found


@dataclass(frozen=True)
class Trend:
    """What differences between recordings go with. name: the quantity; slope: of the parameter
    with it, in its unit by the quantity's; explains: share of Q; left: Q beside it; probability:
    of so much left if that is all."""

    name: str
    slope: float
    explains: float
    left: float
    probability: float


def fit_trends(
    values: Array,
    widths: Array,
    covariates: Mapping[str, Array],
    freedom: float,
) -> list[Trend]:
    """Weighted straight lines through estimates, over each quantity.

    Parameters
    ----------
    values, widths
        Estimates and their standard errors, shape (recordings,).
    covariates
        Quantity → its value in each recording.
    freedom
        Degrees of freedom of each standard error.

    Returns
    -------
    list of Trend
        What explains most first; none of a quantity that does not differ.
    """
    whole = check_homogeneity(values, widths, freedom)
    weights = 1.0 / np.maximum(widths, 1e-300) ** 2
    found = []
    for name, covariate in covariates.items():
        centred = covariate - weights @ covariate / weights.sum()
        power = float(weights @ centred**2)
        if np.ptp(covariate) <= 0.02 * np.max(np.abs(covariate)) or power == 0.0:
            continue
        slope = float(weights @ (centred * values)) / power
        left = max(whole.statistic - slope**2 * power, 0.0)
        remaining = len(values) - 2
        probability = float(fdtrc(remaining, freedom, left / remaining)) if remaining else 1.0
        explains = 1.0 - left / max(whole.statistic, 1e-300)
        found.append(Trend(name, slope, explains, left, probability))
    return sorted(found, key=lambda each: each.left)


def name_trends(
    trends: Sequence[Trend], recordings: int, enough: float, clear: float
) -> tuple[tuple[Trend, ...], bool]:
    """The quantities that a difference may go with.

    Parameters
    ----------
    trends
        What explains most first.
    recordings
        Their number.
    enough
        Share of Q that one must explain.
    clear
        Times what the best leaves that every other must leave for the best to be named alone.

    Returns
    -------
    tuple
        Those that may be it, and whether the first is named.
    """
    likely = [each for each in trends if each.explains >= enough]
    if not likely:
        return (), False
    least = max(likely[0].left, recordings - 2.0)
    rivals = [each for each in likely if each.left <= clear * least]
    return tuple(rivals), len(rivals) == 1 and recordings >= FEWEST
