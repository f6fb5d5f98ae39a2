"""Drawings of §7.2: modes of the beams, heights along an arm, spectrum of the body."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import welch

from controllers import Settings
from controllers.beam import BEAMS, HEAVE, all_modes, modes
from experiments.thesis.ride import SHOWN_SEED
from experiments.thesis.study import Drawing, Result, sheet
from rigtwin.render.panels import SENSED
from rigtwin.render.style import COLOURS


def modes_drawing(settings: Settings) -> Drawing:
    """Draw the lowest mode shapes, and the compliance with all and with few modes."""
    figure, axes = sheet(1, 2, height=3.0)
    model = modes(settings, 1e-3)
    distance = settings.beam_length * np.arange(BEAMS + 1)
    for number in range(4):
        # Shapes have no scale of their own; the largest deflection is drawn as 1.
        shape = model.wing[number] / np.abs(model.wing[number]).max()
        label = f"{model.frequencies[number]:.2f} Hz"
        # Opposite arms move alike in a mode that the centre feels; the centre itself counts once.
        both_arms = np.concatenate([shape[::-1], shape[1:]])
        axes[0][0].plot(
            np.concatenate([-distance[::-1], distance[1:]]), both_arms, marker=".", label=label
        )
    axes[0][0].set(
        xlabel="m from the centre",
        ylabel="shape",
        title="the modes that the centre feels, of two arms",
    )
    axes[0][0].legend(fontsize=8)
    frequencies = np.geomspace(0.2, 20.0, 500)
    s = 2j * math.pi * frequencies
    for label, count, colour in (
        ("78 degrees of freedom", None, COLOURS["other"]),
        ("six modes", 6, SENSED),
        ("two modes", 2, "#2f9e44"),
    ):
        if count is None:
            angular, shapes = all_modes(settings)
            centre = shapes[HEAVE]
        else:
            angular, centre = 2 * math.pi * model.frequencies[:count], model.centre[:count]
        # The sum of modal compliances, φ² / (s² + β ω² s + ω²), at s = j 2π f.
        parts = centre[:, None] ** 2 / (
            s**2 + settings.beam_damping * angular[:, None] ** 2 * s + angular[:, None] ** 2
        )
        axes[0][1].loglog(
            frequencies,
            np.abs(np.sum(parts, axis=0)),
            color=colour,
            label=label,
            linestyle="--" if count == 6 else "-",
        )
    axes[0][1].set(xlabel="Hz", ylabel="m/N", title="compliance at the centre")
    axes[0][1].legend(fontsize=8)
    return Drawing(
        "figure-7.10", "Figure 7.10 and 7.11", "Four arms of three beams, modal reduction.", figure
    )


def wing_drawing(results: Mapping[str, Result]) -> Drawing:
    """Draw the heights of the points along an arm."""
    figure, axes = sheet(3, 1, height=2.3)
    for row, (name, label) in zip(
        axes,
        (
            ("bent passive", "passive, bent start"),
            ("semi-active", "semi-active"),
            ("active", "active"),
        ),
        strict=True,
    ):
        result = results[f"{name}/{SHOWN_SEED}"]
        for point in range(1, BEAMS + 1):
            row[0].plot(
                result["time"],
                np.asarray(result["wing"])[:, point],
                linewidth=0.9,
                label=f"{2 * point} m from the centre",
            )
        row[0].plot(
            result["time"],
            np.asarray(result["ideal wing"])[:, BEAMS],
            color="black",
            linewidth=0.5,
            label="tip, ideal",
        )
        row[0].set(ylabel=f"{label}, mm", xlim=(0, 12))
    axes[0][0].legend(fontsize=8, ncols=4)
    axes[2][0].set(xlabel="time, s")
    caption = (
        "Height of points along an arm above the centre; they settle at the sag under the weight."
    )
    return Drawing("figure-7.15", "Figure 7.15, 7.20, 7.24, B3.7, B4.7 and B5.7", caption, figure)


def spectrum(results: Mapping[str, Result]) -> Drawing:
    """Draw the spectrum of the sprung mass with its second resonance (Fig. 7.16)."""
    figure, axes = sheet(1, 1, width=7.5, height=3.2)
    axis = axes[0][0]
    for name, colour in (("semi-active", SENSED), ("bent passive", COLOURS["other"])):
        result = results[f"{name}/{SHOWN_SEED}"]
        step = float(np.asarray(result["time"])[1])
        for kind, style in (("plate", "-"), ("ideal plate", ":")):
            # A linear trend is removed, since it would leak into all lines of the spectrum.
            frequencies, power = welch(
                np.asarray(result[kind]), fs=1 / step, nperseg=512, detrend="linear"
            )
            inside = (frequencies > 0) & (frequencies < 6)
            label = f"{name}, {'twin' if kind == 'plate' else 'ideal'}"
            axis.semilogy(
                frequencies[inside], np.sqrt(power[inside]), style, color=colour, label=label
            )
    axis.set(xlabel="Hz", ylabel="mm/√Hz", title="sprung mass: a second resonance at 3 Hz")
    axis.legend(fontsize=8)
    return Drawing(
        "figure-7.16",
        "Figure 7.16",
        "The beams add a resonance that a point mass does not have.",
        figure,
    )
