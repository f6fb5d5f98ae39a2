"""Drawings of §6.3, and the ideal drop with lags in different places."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from experiments.thesis.study import Drawing, Result, sheet, trace
from rigtwin.numerics.arrays import Array
from rigtwin.render.panels import ASKED, SENSED
from rigtwin.render.style import COLOURS

IDEAL = COLOURS["other"]


def body_frequency(position: Array, period: float) -> float:
    """Return the frequency of the body after the drop, Hz, from crossings of its rest position.

    NaN stands for fewer than three crossings in the first 4 s.
    """
    early = position[: round(4 / period)]
    # The rest position is the mean of the last 2 s.
    crossings = np.flatnonzero(
        np.diff(np.sign(early - np.mean(position[-round(2 / period) :]))) != 0
    )
    # Every second crossing has the same direction, so crossings 0 and 2 are one period apart.
    return float(1.0 / (period * (crossings[2] - crossings[0]))) if len(crossings) > 2 else math.nan


def lagged_drops() -> dict[str, tuple[float, Array]]:
    """Simulate the ideal drop with first-order lags (Fig. 6.26).

    The lag is 20 ms on the force, 20 ms on the position, or 50 ms on the damping force alone.

    Returns the body frequency, Hz, and the position of the sprung mass every millisecond, m, for
    each place of the lag and for none.
    """
    # Quarter car of Table 6.2: spring, damper, sprung mass, tyre, unsprung mass.
    k, b, m, kt, mu = 1000.0, 50.0, 25.0, 50_000.0, 34.0
    time = np.arange(0.0, 5.0, 1e-3)

    def derivative_with(lag: str) -> Callable[[float, Array], list[float]]:
        def derivative(_: float, s: Array) -> list[float]:
            # All filters run side by side; `lag` selects the one whose output is used.
            body, rate, wheel, wheel_rate, force, damping, lagged_body, lagged_rate = s
            seen, seen_rate = (
                (lagged_body, lagged_rate) if lag == "lag on position" else (body, rate)
            )
            damper_force = b * (seen_rate - wheel_rate)
            used_damping = damping if lag == "lag on damping" else damper_force
            demanded = 200.0 - k * (seen - wheel) - used_damping
            applied = force if lag == "lag on force" else demanded
            return [
                rate,
                applied / m - 9.81,
                wheel_rate,
                (-kt * wheel - applied) / mu,
                (demanded - force) / 0.02,
                (damper_force - damping) / 0.05,
                (body - lagged_body) / 0.02,
                (rate - lagged_rate) / 0.02,
            ]

        return derivative

    # At rest on the tyre, which 200 N compress by 4 mm; the lagged signals start settled.
    start = np.array([-0.004, 0.0, -0.004, 0.0, 200.0, 0.0, -0.004, 0.0])
    drops = {}
    for lag in ("none", "lag on force", "lag on position", "lag on damping"):
        solution = solve_ivp(
            derivative_with(lag), (0.0, 5.0), start, t_eval=time, rtol=1e-8, atol=1e-10
        )
        drops[lag] = (body_frequency(solution.y[0], 1e-3), solution.y[0])
    return drops


def histories(name: str, result: Result, covers: str, until: float) -> Drawing:
    """Draw the time histories of a test until a time, s, and its error subspaces."""
    figure, axes = sheet(2, 3, height=2.6)
    shown = np.asarray(result["time"]) <= until
    panels = (
        ("plate", "sprung mass, mm"),
        ("travel", "suspension travel, mm"),
        ("wheel", "wheel, mm"),
        ("force", "suspension force, N"),
    )
    for axis, (kind, label) in zip([*axes[0], axes[1][0]], panels, strict=True):
        trace(axis, result, f"ideal {kind}", shown, color=IDEAL, linewidth=1.2, label="ideal")
        trace(axis, result, kind, shown, color=SENSED, linewidth=0.8, label="twin")
        axis.set(xlabel="time, s", ylabel=label)
    axes[0][0].legend(fontsize=8)
    # Twin over ideal: delay opens a loop about the diagonal, friction makes steps across it.
    for axis, kind, unit in ((axes[1][1], "force", "N"), (axes[1][2], "plate", "mm")):
        should = np.asarray(result[f"ideal {kind}"])
        axis.plot(should, np.asarray(result[kind]), color="#2f9e44", linewidth=0.5)
        axis.plot(should, should, color=SENSED, linewidth=1.0)
        axis.set(xlabel=f"ideal {kind}, {unit}", ylabel=f"twin {kind}, {unit}")
    return Drawing(
        f"test-{name}", covers, f"Test {name}: twin beside the ideal; error subspaces.", figure
    )


def lag_drawing() -> Drawing:
    """Draw the ideal drop with a lag in different places (Fig. 6.26)."""
    figure, axes = sheet(1, 1, width=7.5, height=3.2)
    axis = axes[0][0]
    for (name, (frequency, position)), colour in zip(
        lagged_drops().items(), (IDEAL, SENSED, "#2f9e44", ASKED), strict=True
    ):
        axis.plot(
            np.arange(len(position)) * 1e-3,
            1e3 * position,
            color=colour,
            label=f"{name}, {frequency:.3f} Hz",
            linewidth=1.0,
        )
    axis.set(xlabel="time, s", ylabel="sprung mass, mm")
    axis.legend(fontsize=8)
    caption = (
        "A lag on the damping alone puts it out of phase with the spring: the body swings faster."
    )
    return Drawing("figure-6.26", "Figure 6.26", caption, figure)


def spectrum_drawing(result: Result) -> Drawing:
    """Draw the amplitude spectra on the 10 Hz road (Fig. 6.48, 6.49)."""
    figure, axes = sheet(1, 2)
    for axis, kind in zip(axes[0], ("plate", "travel"), strict=True):
        for name, colour, label in (
            (f"spectrum ideal {kind}", IDEAL, "ideal"),
            (f"spectrum {kind}", SENSED, "twin"),
        ):
            axis.loglog(result["frequencies"], result[name], color=colour, label=label)
        axis.set(
            xlabel="Hz",
            ylabel="mm/√Hz",
            title={"plate": "sprung mass", "travel": "suspension travel"}[kind],
        )
    axes[0][0].legend(fontsize=8)
    return Drawing(
        "figure-6.48",
        "Figure 6.48 and 6.49",
        "10 Hz road: the wheel hop of the ideal is missing on the rig.",
        figure,
    )
