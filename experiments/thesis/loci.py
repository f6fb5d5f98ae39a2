"""Root loci of the thesis (§5.2, appendix A): the sweeps and the claims about them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.thesis.entry import Entry, statement
from rigtwin.studies.stability.locus import Locus, Setting
from rigtwin.studies.stability.vehicle import QuarterCar

ARBITRARY = QuarterCar(500.0, 0.0, 50.0, 500.0, 100.0, 50.0)
"""Constant parameters of the sweeps, `chosen arbitrarily` (Tables 5.3, 5.7, A1.1 to A3.5)."""
POINTS = 500
"""Number of values in a sweep."""


@dataclass(frozen=True)
class LocusVariation:
    """A parameter swept from start to end.

    Attributes
    ----------
    symbol, unit : str
        Symbol and unit for labels.
    start, end : float
        First and last value of the sweep.
    at : callable
        Function of a value that returns the vehicle and the lag.
    """

    symbol: str
    unit: str
    start: float
    end: float
    at: Callable[[float], Setting]


def of_lag(ratio: float) -> LocusVariation:
    """Return a sweep of the lag τ from 1 ms to 1 s at a damping ratio of the sprung mass."""
    car = ARBITRARY._replace(suspension_damping=damping(ratio, ARBITRARY.suspension_stiffness))
    return LocusVariation("τ", "s", 1e-3, 1.0, lambda lag: Setting(car, lag))


def of_natural_frequency(ratio: float, lag: float, end: float) -> LocusVariation:
    """Return a sweep of the suspension stiffness from 1 N/m to `end`.

    Mass and damping ratio stay constant, so the natural frequency √(k_s/m_s) varies alone.
    """

    def at(stiffness: float) -> Setting:
        car = ARBITRARY._replace(
            suspension_stiffness=stiffness, suspension_damping=damping(ratio, stiffness)
        )
        return Setting(car, lag)

    return LocusVariation("k_s", "N/m", 1.0, end, at)


def of_damping_ratio(lag: float) -> LocusVariation:
    """Return a sweep of k_s = m_s from 1 to 100 000 (N/m, kg).

    The natural frequency stays at 1 rad/s while the damping ratio falls from 50 to 0.0005.
    """
    return LocusVariation(
        "k_s = m_s",
        "N/m, kg",
        1.0,
        1e5,
        lambda both: Setting(ARBITRARY._replace(suspension_stiffness=both, sprung_mass=both), lag),
    )


def of_tyre_stiffness(lag: float) -> LocusVariation:
    """Return a sweep of the tyre stiffness from 0.01 to 100 000 N/m at a lag, s."""
    return LocusVariation(
        "k_t",
        "N/m",
        0.01,
        1e5,
        lambda stiffness: Setting(ARBITRARY._replace(tyre_stiffness=stiffness), lag),
    )


def of_wheel_mass(lag: float) -> LocusVariation:
    """Return a sweep of the wheel's mass from 0.01 to 100 000 kg at a lag, s."""
    return LocusVariation(
        "m_u", "kg", 0.01, 1e5, lambda mass: Setting(ARBITRARY._replace(unsprung_mass=mass), lag)
    )


def damping(ratio: float, stiffness: float) -> float:
    """Return the suspension damping b = 2 ζ √(k m), Ns/m (Eq. 5.34)."""
    return 2.0 * ratio * math.sqrt(stiffness * ARBITRARY.sprung_mass)


@dataclass(frozen=True)
class Claim:
    """A statement of the thesis about a locus.

    Attributes
    ----------
    where : str
        Figure that the statement is about, such as `Figure A1.3`.
    topic : str
        Subject of the statement.
    words : str
        Statement, shortened.
    judge : callable
        Judge of the locus, see `experiments.thesis.judges`.
    note : str
        Correct one of two contradictory passages.
    """

    where: str
    topic: str
    words: str
    judge: Callable[[Locus], tuple[bool, str]]
    note: str = ""


@dataclass(frozen=True)
class LocusFigure:
    """A figure of the thesis.

    Attributes
    ----------
    name : str
        Number of the figure, such as `A1.3`.
    view : tuple of float, optional
        Shown part of the plane: left and right, 1/s, and height, rad/s. Defaults to all poles.
    """

    name: str
    view: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class LocusCase:
    """A sweep of a model, with the figures and statements of the thesis.

    Attributes
    ----------
    model : str
        Model, such as `suspension`.
    title : str
        Case and its values.
    variation : Variation
        Swept parameter.
    panels : tuple of Panel
        Figures that show the sweep.
    claims : tuple of Claim
        Statements about it.
    """

    model: str
    title: str
    variation: LocusVariation
    panels: tuple[LocusFigure, ...]
    claims: tuple[Claim, ...] = ()

    @property
    def locus(self) -> Locus:
        """Root locus of the model over the sweep."""
        return locus(self.model, self.variation)

    def entries(self) -> list[Entry]:
        """Return an entry for each claim, with the finding of its judge."""
        entries = []
        for claim in self.claims:
            holds, words = claim.judge(self.locus)
            entries.append(
                statement(
                    claim.where,
                    f"{claim.topic}, {self.title}",
                    claim.words,
                    holds,
                    words,
                    claim.note,
                )
            )
        return entries


@cache
def locus(model: str, variation: LocusVariation) -> Locus:
    """Return the root locus of a model over a variation, in steps of equal ratio.

    Loci are cached, because several judges compare a locus with others.
    """
    # Equal ratios, since a sweep spans up to seven decades.
    values = np.logspace(math.log10(variation.start), math.log10(variation.end), POINTS)
    return Locus(model, values, variation.at)
