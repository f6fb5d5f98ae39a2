"""Homogeneity of several estimates of one parameter, and trends that explain their differences.

With estimates x_i, standard errors s_i, weights 1 / s_i^2 and the weighted mean m, Cochran's
statistic is Q = sum((x_i - m)^2 / s_i^2). A weighted straight line over a covariate lowers it by
slope^2 times the weighted power of the centred covariate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from rigtwin.numerics.arrays import Array

FEWEST = 4
"""Minimum number of recordings for a trend: a line through three leaves one degree of freedom."""


@dataclass(frozen=True)
class Homogeneity:
    """Result of Cochran's test.

    Attributes
    ----------
    mean
        Weighted mean of the estimates.
    statistic
        Cochran's Q.
    probability
        Probability of a Q at least as large if all estimates agree.
    """

    mean: float
    statistic: float
    probability: float


def check_homogeneity(values: Array, widths: Array, freedom: float) -> Homogeneity:
    """Test whether estimates agree.

    Parameters
    ----------
    values, widths
        Estimates and their standard errors, shape (recordings,).
    freedom
        Degrees of freedom that each standard error was estimated with.

    Returns
    -------
    Homogeneity
        Cochran's Q with its probability [W. G. Cochran, Biometrics 10 (1954) 101].
    """
    weights = 1.0 / np.maximum(widths, 1e-300) ** 2
    mean = float(weights @ values / weights.sum())
    statistic = float(weights @ (values - mean) ** 2)
    among = len(values) - 1
    # The standard errors are estimates themselves, so that Q over its degrees of freedom has an F
    # distribution and not a chi-square distribution.
    return Homogeneity(mean, statistic, float(fdtrc(among, freedom, statistic / among)))


def correct(probabilities: Sequence[float]) -> list[float]:
    """Correct probabilities for the number of tests, by Holm's method.

    Parameters
    ----------
    probabilities
        Probabilities of single tests.

    Returns
    -------
    list of float
        Corrected probabilities in the same order, at most 1 [S. Holm, Scand. J. Stat. 6 (1979) 65].
    """
    order = np.argsort(probabilities)
    corrected, least = [1.0] * len(order), 0.0
    for rank, place in enumerate(order):
        # Corrected probabilities must rise in the order of the uncorrected ones.
        least = max(least, min((len(order) - rank) * probabilities[place], 1.0))
        corrected[place] = least
    return corrected


@dataclass(frozen=True)
class Trend:
    """Weighted straight line of a parameter over a covariate.

    Attributes
    ----------
    name
        Name of the covariate.
    slope
        Slope of the parameter, in its unit per unit of the covariate.
    explains
        Share of Q that the line explains.
    remaining
        Q about the line.
    probability
        Probability of a Q at least as large about the line if the line is right.
    """

    name: str
    slope: float
    explains: float
    remaining: float
    probability: float


def fit_trends(
    values: Array,
    widths: Array,
    covariates: Mapping[str, Array],
    freedom: float,
) -> list[Trend]:
    """Fit weighted straight lines through estimates over each covariate.

    Parameters
    ----------
    values, widths
        Estimates and their standard errors, shape (recordings,).
    covariates
        Name of the covariate → its value in each recording, shape (recordings,).
    freedom
        Degrees of freedom that each standard error was estimated with.

    Returns
    -------
    list of Trend
        Trends, the best first. Covariates that hardly differ between recordings are omitted.
    """
    whole = check_homogeneity(values, widths, freedom)
    weights = 1.0 / np.maximum(widths, 1e-300) ** 2
    trends = []
    for name, covariate in covariates.items():
        centred = covariate - weights @ covariate / weights.sum()
        power = float(weights @ centred**2)
        # A slope over a covariate that hardly varies would extrapolate.
        if np.ptp(covariate) <= 0.02 * np.max(np.abs(covariate)) or power == 0.0:
            continue
        # The values need no centring: the centred covariate is orthogonal to every constant in the
        # weighted scalar product.
        slope = float(weights @ (centred * values)) / power
        # Rounding may make the difference slightly negative where the line explains everything.
        remaining = max(whole.statistic - slope**2 * power, 0.0)
        # The line uses two degrees of freedom.
        among = len(values) - 2
        probability = float(fdtrc(among, freedom, remaining / among)) if among else 1.0
        explains = 1.0 - remaining / max(whole.statistic, 1e-300)
        trends.append(Trend(name, slope, explains, remaining, probability))
    return sorted(trends, key=lambda trend: trend.remaining)


def name_trends(
    trends: Sequence[Trend], recordings: int, enough: float, clear: float
) -> tuple[tuple[Trend, ...], bool]:
    """Return the trends that may explain a difference.

    Parameters
    ----------
    trends
        Trends, the best first.
    recordings
        Number of recordings.
    enough
        Share of Q that a trend must explain.
    clear
        Factor by which every other trend must leave more than the best for the best to be named
        alone.

    Returns
    -------
    tuple
        Possible trends, and whether the first one is named.
    """
    likely = [trend for trend in trends if trend.explains >= enough]
    if not likely:
        return (), False
    # Q about the right line is about its degrees of freedom; less is chance.
    least = max(likely[0].remaining, recordings - 2.0)
    rivals = [trend for trend in likely if trend.remaining <= clear * least]
    return tuple(rivals), len(rivals) == 1 and recordings >= FEWEST
