"""The sweeps of the thesis' root loci (§5.2, appendix A), what it says of them, and how they are
drawn."""

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
"""The values that the thesis keeps while others are varied, `chosen arbitrarily` (Tables 5.3, 5.7,
A1.1 to A3.5)."""
POINTS = 500


@dataclass(frozen=True)
class Variation:
    """One parameter swept from start to end. symbol, unit: of it, for labels; at: what each of its
    values means."""

    symbol: str
    unit: str
    start: float
    end: float
    at: Callable[[float], Setting]


def of_lag(ratio: float) -> Variation:
    """τ from 1 ms to 1 s at a damping ratio of the sprung mass."""
    car = ARBITRARY._replace(suspension_damping=damping(ratio, ARBITRARY.suspension_stiffness))
    return Variation("τ", "s", 1e-3, 1.0, lambda lag: Setting(car, lag))


def of_natural_frequency(ratio: float, lag: float, end: float) -> Variation:
    """The suspension's stiffness from 1 N/m, mass and damping ratio kept."""

    def at(stiffness: float) -> Setting:
        car = ARBITRARY._replace(
            suspension_stiffness=stiffness, suspension_damping=damping(ratio, stiffness)
        )
        return Setting(car, lag)

    return Variation("k_s", "N/m", 1.0, end, at)


def of_damping_ratio(lag: float) -> Variation:
    """Stiffness N/m and mass kg of the suspension from 1 to 100 000 together: the damping ratio
    falls from 50 to 0.0005."""
    return Variation(
        "k_s = m_s",
        "N/m, kg",
        1.0,
        1e5,
        lambda both: Setting(ARBITRARY._replace(suspension_stiffness=both, sprung_mass=both), lag),
    )


def of_tyre_stiffness(lag: float) -> Variation:
    return Variation(
        "k_t",
        "N/m",
        0.01,
        1e5,
        lambda stiffness: Setting(ARBITRARY._replace(tyre_stiffness=stiffness), lag),
    )


def of_wheel_mass(lag: float) -> Variation:
    return Variation(
        "m_u", "kg", 0.01, 1e5, lambda mass: Setting(ARBITRARY._replace(unsprung_mass=mass), lag)
    )


def damping(ratio: float, stiffness: float) -> float:
    """Ns/m, of the sprung mass's damping ratio (Eq. 5.34)."""
    return 2.0 * ratio * math.sqrt(stiffness * ARBITRARY.sprung_mass)


@dataclass(frozen=True)
class Claim:
    """What the thesis says of a locus. where: `Figure A1.3`; says: its words, shortened; judge: of
    the locus, whether it holds and what was found; note: which of two contradicting passages is
    right."""

    where: str
    what: str
    says: str
    judge: Callable[[Locus], tuple[bool, str]]
    note: str = ""


@dataclass(frozen=True)
class Panel:
    """A figure of the thesis. name: `A1.3`; view: the part of the plane shown, 1/s and rad/s, as
    (left, right, height)."""

    name: str
    view: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Case:
    """A sweep of a model, the figures that show it, and what is said of it."""

    model: str
    title: str
    variation: Variation
    panels: tuple[Panel, ...]
    claims: tuple[Claim, ...] = ()

    @property
    def locus(self) -> Locus:
        return locus(self.model, self.variation)

    def entries(self) -> list[Entry]:
        """Each claim beside what was found."""
        found = []
        for claim in self.claims:
            holds, words = claim.judge(self.locus)
            found.append(
                statement(
                    claim.where, f"{claim.what}, {self.title}", claim.says, holds, words, claim.note
                )
            )
        return found


@cache
def locus(model: str, variation: Variation) -> Locus:
    """The root locus of a model over a variation, in equal ratios. Kept, since others are compared
    with it."""
    values = np.logspace(math.log10(variation.start), math.log10(variation.end), POINTS)
    return Locus(model, values, variation.at)


def drawing(name: str, covers: str, caption: str, cases: Sequence[Case]) -> Drawing:
    """All panels of the cases on one sheet."""
    panels = [(case, panel) for case in cases for panel in case.panels]
    columns = 2 if len(panels) in (2, 4) else 3
    figure, axes = sheet(math.ceil(len(panels) / columns), columns, width=4.0 * columns, height=3.6)
    flat = [axis for row in axes for axis in row]
    for axis, (case, panel) in zip(flat, panels, strict=False):
        _draw(axis, case, panel)
    for axis in flat[len(panels) :]:
        axis.set_visible(False)
    _legend(figure, flat[0])
    return Drawing(name, covers, caption, figure)


def _draw(axis: Axes, case: Case, panel: Panel) -> None:
    found, variation = case.locus, case.variation
    share = np.linspace(0.0, 1.0, len(found.values))
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.axvline(0.0, color="0.3", linewidth=0.8, zorder=0)
    ideal = found.ideal
    # A lag does not move the ideal poles: there they are points among the others, and are drawn as
    # such.
    if np.allclose(ideal, ideal[0]):
        axis.plot(
            ideal[0].real, ideal[0].imag, "+", color="0.35", markersize=10, label="ideal", zorder=5
        )
    else:
        axis.plot(
            ideal.real.ravel(),
            ideal.imag.ravel(),
            ".",
            color="0.65",
            markersize=4,
            label="ideal",
            zorder=1,
        )
    colours = np.repeat(share, found.poles.shape[1])
    axis.scatter(
        found.poles.real.ravel(),
        found.poles.imag.ravel(),
        s=2.0,
        c=colours,
        cmap="viridis",
        vmax=1.1,
        label="MIL",
        zorder=2,
    )
    for row, marker, label in ((0, "o", "start of the sweep"), (-1, "s", "its end")):
        axis.plot(
            found.poles[row].real,
            found.poles[row].imag,
            marker,
            color="black",
            markerfacecolor="none",
            markersize=5,
            linestyle="none",
            label=label,
            zorder=3,
        )
    heights = [sign * crossing.frequency for crossing in found.crossings for sign in (1.0, -1.0)]
    axis.plot(
        [0.0] * len(heights),
        heights,
        "x",
        color="#d62728",
        markersize=7,
        label="crossing",
        zorder=4,
    )
    if panel.view is not None:
        left, right, height = panel.view
        axis.set_xlim(left, right)
        axis.set_ylim(-height, height)
    axis.set_title(f"Figure {panel.name}: {case.title}", fontsize=8)
    values = ", ".join(dict.fromkeys(f"{crossing.value:.4g}" for crossing in found.crossings))
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
    axis.set_xlabel("real part, 1/s", fontsize=8)
    axis.set_ylabel("imaginary part, rad/s", fontsize=8)


def _legend(figure: Figure, axis: Axes) -> None:
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
