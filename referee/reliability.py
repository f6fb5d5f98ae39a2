"""The reliability diagram: share of correct names over the reported confidence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from referee.score_row import wilson
from rigtwin.errors import RigtwinError

BLUE, GREY = "#2a6fa8", "#6b7280"


def draw_reliability(bins: Sequence[tuple[float, float, int]], path: Path) -> Path:
    """Draw a reliability diagram: one point per bin, with its 95 % interval and its count.

    Parameters
    ----------
    bins : sequence of tuple
        Mean confidence, share of acceptable names, and number of names of every bin.
    path : Path
        File to write, PNG, SVG or PDF.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    RigtwinError
        Raised if the file cannot be written.
    """
    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    # On the diagonal the reported confidence equals the share of correct names.
    axes.plot([0.5, 1.0], [0.5, 1.0], color=GREY, linewidth=1, linestyle="--")
    axes.annotate("as sure as right", (0.56, 0.53), color=GREY, fontsize=9)
    for confidence, accepted, count in bins:
        low, high = wilson(round(accepted * count), count)
        axes.errorbar(
            confidence,
            accepted,
            yerr=np.array([[max(accepted - low, 0.0)], [max(high - accepted, 0.0)]]),
            color=BLUE,
            marker="o",
            capsize=3,
        )
        axes.annotate(
            f"{count}\nnames",
            (confidence, low),
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
