"""Root loci of the thesis (§5.2, appendix A): the sweeps, the claims about them, the drawings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.thesis.entry import Entry, statement
from experiments.thesis.study import Drawing, sheet
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


def drawing(name: str, covers: str, caption: str, cases: Sequence[LocusCase]) -> Drawing:
    """Return a drawing with all panels of some cases."""
    panels = [(case, panel) for case in cases for panel in case.panels]
    # Two or four panels fill a sheet of two columns; otherwise three leave least space empty.
    columns = 2 if len(panels) in (2, 4) else 3
    figure, axes = sheet(math.ceil(len(panels) / columns), columns, width=4.0 * columns, height=3.6)
    flat = [axis for row in axes for axis in row]
    for axis, (case, panel) in zip(flat, panels, strict=False):
        _draw(axis, case, panel)
    for axis in flat[len(panels) :]:
        axis.set_visible(False)
    _legend(figure, flat[0])
    return Drawing(name, covers, caption, figure)


def _draw(axis: Axes, case: LocusCase, panel: LocusFigure) -> None:
    """Draw one panel of a case."""
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.axvline(0.0, color="0.3", linewidth=0.8, zorder=0)
    _draw_ideal_poles(axis, case.locus)
    _draw_poles(axis, case.locus)
    if panel.view is not None:
        lowest, highest, height = panel.view
        axis.set_xlim(lowest, highest)
        axis.set_ylim(-height, height)
    axis.set_title(f"Figure {panel.name}: {case.title}", fontsize=8)
    _annotate(axis, case)
    axis.set_xlabel("real part, 1/s", fontsize=8)
    axis.set_ylabel("imaginary part, rad/s", fontsize=8)


def _draw_ideal_poles(axis: Axes, locus: Locus) -> None:
    """Draw the poles of the ideal system, grey."""
    ideal = locus.ideal
    # A sweep of the lag does not move the ideal poles: they are drawn as single points.
    if np.allclose(ideal, ideal[0]):
        axis.plot(
            ideal[0].real, ideal[0].imag, "+", color="0.35", markersize=10, label="ideal", zorder=5
        )
        return
    axis.plot(
        ideal.real.ravel(),
        ideal.imag.ravel(),
        ".",
        color="0.65",
        markersize=4,
        label="ideal",
        zorder=1,
    )


def _draw_poles(axis: Axes, locus: Locus) -> None:
    """Draw the poles along the sweep, its ends, and the crossings of the imaginary axis."""
    # Dark at the start, light at the end; vmax leaves out the palest colours of the map.
    colours = np.repeat(np.linspace(0.0, 1.0, len(locus.values)), locus.poles.shape[1])
    axis.scatter(
        locus.poles.real.ravel(),
        locus.poles.imag.ravel(),
        s=2.0,
        c=colours,
        cmap="viridis",
        vmax=1.1,
        label="MIL",
        zorder=2,
    )
    for row, marker, label in ((0, "o", "start of the sweep"), (-1, "s", "its end")):
        axis.plot(
            locus.poles[row].real,
            locus.poles[row].imag,
            marker,
            color="black",
            markerfacecolor="none",
            markersize=5,
            linestyle="none",
            label=label,
            zorder=3,
        )
    # Poles come in conjugate pairs, so both crossings of a pair are marked.
    heights = [sign * crossing.frequency for crossing in locus.crossings for sign in (1.0, -1.0)]
    axis.plot(
        [0.0] * len(heights),
        heights,
        "x",
        color="#d62728",
        markersize=7,
        label="crossing",
        zorder=4,
    )


def _annotate(axis: Axes, case: LocusCase) -> None:
    """Write the range of the sweep and the values of the crossings into a panel."""
    variation = case.variation
    values = ", ".join(dict.fromkeys(f"{crossing.value:.4g}" for crossing in case.locus.crossings))
    sweep = f"{variation.symbol} {variation.start:g} to {variation.end:g} {variation.unit}"
    crossing = f"\ncrossing at {values}" if values else "\nno crossing"
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5}
    axis.text(
        0.02,
        0.98,
        sweep + crossing,
        transform=axis.transAxes,
        fontsize=7,
        va="top",
        zorder=6,
        bbox=box,
    )


def _legend(figure: Figure, axis: Axes) -> None:
    """Draw one legend for all panels below the figure."""
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(labels),
        fontsize=8,
        frameon=False,
        markerscale=1.5,
    )
