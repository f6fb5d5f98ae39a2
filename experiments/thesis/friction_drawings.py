"""Figures of chapter 4: step timing, spikes, a section of the test, two-step compensation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from controllers.friction import MOTOR_LAG
from experiments.thesis.study import Drawing, Result, sheet, trace
from rigtwin.numerics.arrays import Array
from rigtwin.render.panels import ASKED, SENSED
from rigtwin.render.style import COLOURS

IN_TIME, LATE = 0.9e-3, 15e-3
"""Time from the first step to the second, s: when the error has vanished, and well after it."""
ROWS = (
    *("none", "one-step 4", "two-step 4"),
    *("calibrated one-step", "calibrated two-step", "observer"),
)
"""Compensators that are compared; `4` is the thesis' threshold in N."""


def errors_of(results: Mapping[str, Result], loop: str, row: str) -> dict[str, Array]:
    """Return the rms errors of a row and its spike, N, all of shape (seeds,).

    row: `one-step 4` for the thesis' parameters, or `calibrated one-step`.
    """
    kind, _, name = row.partition("calibrated ")
    if name:
        errors = {
            key: np.asarray(results[f"calibrated-{loop}"][f"{name}/{key}"])
            for key in ("tracking", "numerical", "spike")
        }
    else:
        # Sorted as numbers: as text, seed 10 would come before seed 2.
        seeds = sorted(
            (key for key in results if key.startswith(f"{loop}/")),
            key=lambda key: int(key.partition("/")[2]),
        )
        errors = {
            key: np.array([float(results[seed][f"{kind}/{key}"]) for seed in seeds])
            for key in ("tracking", "numerical", "spike")
        }
    return {**errors, "total": errors["tracking"] + errors["numerical"]}


def drawings(results: Mapping[str, Result]) -> list[Drawing]:
    """Return all drawings of chapter 4."""
    return [
        _timing_drawing(results),
        _envelope_drawing(results),
        _section_drawing(results),
        _two_step_drawing(),
        _bars(results),
    ]


def _timing_drawing(results: Mapping[str, Result]) -> Drawing:
    """Draw the force error with steps before, at and after the reversal."""
    figure, axes = sheet(1, 3, height=3.0)
    none = results["timing/None"]
    for axis, offsets in zip(axes[0], ((0.0, 0.005), (-0.015, -0.005), (0.015,)), strict=True):
        trace(axis, none, "error", color=COLOURS["other"], linewidth=0.8, label="no step")
        for offset, colour in zip(offsets, (SENSED, ASKED), strict=False):
            label = f"step {1e3 * offset:+.0f} ms from reversal"
            timed = results[f"timing/{offset}"]
            trace(axis, timed, "error", color=colour, linewidth=0.8, label=label)
        axis.set(xlim=(2.0, 3.2), xlabel="time, s", ylabel="force error, N")
        axis.legend(fontsize=7)
    return Drawing(
        "figure-4.6",
        "Figure 4.6",
        "Reversals known in advance, motion of 1 Hz and 20 mm, constant force.",
        figure,
    )


def _envelope_drawing(results: Mapping[str, Result]) -> Drawing:
    """Draw the mean spike with its threshold, and the error against the velocity."""
    figure, axes = sheet(1, 2, height=3.0)
    for loop, colour in (("nominal", SENSED), ("fitted", ASKED)):
        calibrated = results[f"calibrated-{loop}"]
        envelope = np.asarray(calibrated["envelope"])
        axes[0][0].plot(
            np.arange(len(envelope)), envelope, color=colour, marker=".", label=f"{loop} force loop"
        )
        axes[0][0].axhline(
            float(calibrated["setting spike_threshold"]), color=colour, linestyle=":", linewidth=1
        )
    axes[0][0].set(
        xlabel="ms after the reversal",
        ylabel="force error, N",
        title="mean spike and the calibrated threshold (dotted)",
    )
    axes[0][0].legend(fontsize=8)
    section = results["calibrated-nominal"]
    for name, colour in (("none", COLOURS["other"]), ("two-step", SENSED), ("observer", "#2f9e44")):
        error = np.asarray(section[f"{name} asked"]) - np.asarray(section[f"{name} force"])
        axes[0][1].plot(section[f"{name} velocity"], error, color=colour, linewidth=0.5, label=name)
    axes[0][1].set(
        xlabel="motor velocity, m/s", ylabel="force error, N", title="error against velocity"
    )
    axes[0][1].legend(fontsize=8)
    return Drawing(
        "figure-4.7",
        "Figure 4.4, 4.7 and 4.17",
        "Left: the mean spike of a recording, from which the threshold is calibrated.",
        figure,
    )


def _section_drawing(results: Mapping[str, Result]) -> Drawing:
    """Draw a section of the test without and with compensation."""
    figure, axes = sheet(3, 1, height=2.3)
    section = results["calibrated-nominal"]
    time = np.asarray(section["time"])
    trace(axes[0][0], section, "none force", color=SENSED, linewidth=0.8, label="felt")
    trace(axes[0][0], section, "none asked", color=ASKED, linewidth=0.9, label="demanded")
    axes[0][0].set(ylabel="force, N", title="no compensation")
    pairs = (
        (("none", COLOURS["other"]), ("one-step", SENSED), ("two-step", ASKED)),
        (("two-step", ASKED), ("observer", "#2f9e44")),
    )
    for axis, names in zip((axes[1][0], axes[2][0]), pairs, strict=True):
        for name, colour in names:
            error = np.asarray(section[f"{name} asked"]) - np.asarray(section[f"{name} force"])
            axis.plot(time, error, color=colour, linewidth=0.8, label=name)
        axis.set(ylabel="force error, N")
    axes[2][0].set(xlabel="time, s")
    for row in axes:
        row[0].legend(fontsize=8, ncols=3, loc="upper right")
    caption = "Nominal force loop, compensator calibrated on another recording."
    return Drawing("figure-4.10", "Figure 4.10 to 4.12 and 4.16", caption, figure)


def two_step(first: float, wait: float | None) -> tuple[Array, Array, Array]:
    """Simulate a two-step compensation with an integral force loop alone (Fig. 4.14).

    Friction reverses at t = 0. The first step, `first` times the jump, comes at 4 ms. The second
    one, back to the jump, follows `wait` seconds later, or never if None.

    Returns time, s, force error, N, and motor force, N, all of shape (900,).
    """
    period, gain, jump = 1e-4, 40.0, 28.0
    motor, integral = 0.0, 0.0
    # 0.1 ms apart, from 5 ms before the reversal to 85 ms after it.
    time = (np.arange(900) - 50) * period
    error, force = np.empty(900), np.empty(900)
    for tick, now in enumerate(time):
        # Coulomb friction jumps from one sign to the other; only the change by `jump` matters
        # here.
        force_at_mass = motor - (jump if now >= 0 else 0.0)
        error[tick], force[tick] = -force_at_mass, motor
        step = 0.0 if now < 0.004 else jump * (first if wait is None or now < 0.004 + wait else 1.0)
        # Explicit Euler with 0.1 ms: the motor's lag and the loop are far slower.
        integral -= gain * force_at_mass * period
        motor += (integral + step - motor) * period / MOTOR_LAG
    return time, error, force


def _two_step_drawing() -> Drawing:
    """Draw the effect of the second step's time and of the first step's size."""
    figure, axes = sheet(1, 3, height=3.0)
    cases = (
        ("step two after 1 ms", 2.0, IN_TIME, SENSED),
        ("late, after 15 ms", 2.0, LATE, ASKED),
        ("never: 0.3 V for good", 2.0, None, COLOURS["other"]),
    )
    for label, first, second, colour in cases:
        time, error, force = two_step(first, second)
        axes[0][0].plot(1e3 * time, error, color=colour, label=label)
        axes[0][1].plot(1e3 * time, force, color=colour)
    for first, colour in ((1.0, COLOURS["other"]), (2.0, SENSED), (3.0, ASKED)):
        # A first step of n times the jump removes the error in 1/(n − 1) of the time that twice
        # the jump takes.
        time, error, _ = two_step(first, IN_TIME / (first - 1.0) if first > 1 else None)
        axes[0][2].plot(1e3 * time, error, color=colour, label=f"{first:g} times the jump at first")
    axes[0][0].set(xlabel="ms", ylabel="force error, N")
    axes[0][1].set(xlabel="ms", ylabel="motor force, N")
    axes[0][2].set(xlabel="ms", ylabel="force error, N")
    axes[0][0].legend(fontsize=7)
    axes[0][2].legend(fontsize=7)
    caption = (
        "Simulated with an integral loop alone: a late second "
        "step overshoots, larger steps settle sooner."
    )
    return Drawing("figure-4.14", "Figure 4.13 to 4.15", caption, figure)


def _bars(results: Mapping[str, Result]) -> Drawing:
    """Draw the errors of the compensators as bars, for both force loops."""
    figure, axes = sheet(1, 2, height=3.4)
    for axis, loop in zip(axes[0], ("nominal", "fitted"), strict=True):
        for number, name in enumerate(ROWS):
            errors = errors_of(results, loop, name)
            tracking, numerical = (
                float(np.median(errors[key])) for key in ("tracking", "numerical")
            )
            axis.barh(number, tracking, color=SENSED, label="tracking e2" if number == 0 else None)
            axis.barh(
                number,
                numerical,
                left=tracking,
                color=ASKED,
                label="numerical e1" if number == 0 else None,
            )
        axis.set(
            title=f"{loop} force loop",
            xlabel="rms error, N",
            yticks=range(len(ROWS)),
            yticklabels=ROWS,
        )
        axis.invert_yaxis()
        axis.legend(fontsize=8)
    return Drawing(
        "table-4.2",
        "Table 4.1 and 4.2",
        "Median over the seeds; `4`: with the thesis' parameters.",
        figure,
    )
