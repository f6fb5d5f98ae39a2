"""Draws how often names were right beside how sure the diagnosis said that it was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from referee.score import wilson
from rigtwin.errors import RigtwinError

BLUE, GREY = "#2a6fa8", "#6b7280"


def draw_reliability(bins: Sequence[tuple[float, float, int]], path: Path) -> Path:
    """A reliability diagram: a point a bin of confidence, with its 95 % interval and its count.

    Parameters
    ----------
    bins
        Mean confidence, share of acceptable names, and how many names, of each.
    path
        PNG, SVG or PDF.

    Raises
    ------
    RigtwinError
        If it cannot be written.
    """
    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.plot([0.5, 1.0], [0.5, 1.0], color=GREY, linewidth=1, linestyle="--")
    axes.annotate("as sure as right", (0.56, 0.53), color=GREY, fontsize=9)
    for said, true, count in bins:
        low, high = wilson(round(true * count), count)
        axes.errorbar(
            said,
            true,
            yerr=np.array([[max(true - low, 0.0)], [max(high - true, 0.0)]]),
            color=BLUE,
            marker="o",
            capsize=3,
        )
        axes.annotate(
            f"{count}\nnames",
            (said, low),
            xytext=(0, -3),
            textcoords="offset points",
            ha="center",
            va="top",
        )
    axes.set(
        xlim=(0.5, 1.01),
        ylim=(0.5, 1.01),
        xlabel="confidence said",
        ylabel="share of names that were right",
    )
    axes.spines[["top", "right"]].set_visible(False)
    try:
        figure.savefig(path, dpi=110)
    except (OSError, ValueError) as error:
        raise RigtwinError(f"cannot write {path}: {error}") from None
    return path
