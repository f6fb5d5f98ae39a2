"""Styles of figures, for a screen or for a paper with its column width and type size."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from matplotlib.style import context

from rigtwin.errors import RigtwinError

COLOURS = {"measured": "#2a6fa8", "commanded": "#d1603d", "other": "#6b7280"}


@dataclass(frozen=True)
class Style:
    """Style of a figure.

    Attributes
    ----------
    width, panel, rest
        Width of the figure, height of a panel, and height of everything else, in inches.
    text
        Type size in points.
    line
        Width of a trace in points.
    dashed
        Line pattern of commands, which distinguishes them from measurements without colour.
    titled
        Whether the figure has a title.
    dpi
        Resolution in pixels per inch.
    settings
        matplotlib's settings.
    """

    width: float = 11.0
    panel: float = 1.9
    rest: float = 0.8
    text: float = 9.0
    line: float = 0.9
    dashed: str | tuple[int, tuple[float, ...]] = "-"
    titled: bool = True
    dpi: int = 110
    settings: Mapping[str, Any] = field(default_factory=dict)

    @contextmanager
    def used(self) -> Iterator[None]:
        """Apply the style to everything that is drawn and saved inside this context."""
        # matplotlib's settings are global; the context restores them afterwards.
        with context(dict(self.settings)):
            yield


def _paper(width: float) -> Style:
    """Return the style of a journal's figure of some width in inches.

    It has sans-serif text of 8 points and thin lines. Vector files contain text as embedded
    TrueType fonts, which journals require. The title is left to the caption.
    """
    return Style(
        width=width,
        panel=1.15,
        rest=0.35,
        text=8.0,
        line=0.7,
        dashed=(0, (4.0, 1.5)),
        titled=False,
        dpi=600,
        settings={
            "font.size": 8.0,
            "axes.linewidth": 0.6,
            "xtick.major.width": 0.6,
            "ytick.major.width": 0.6,
            "xtick.labelsize": 7.0,
            "ytick.labelsize": 7.0,
            "grid.linewidth": 0.4,
            "pdf.fonttype": 42,
            # Text stays text in both vector formats.
            "svg.fonttype": "none",
        },
    )


STYLES = {"screen": Style(), "paper": _paper(3.5), "paper-wide": _paper(7.16)}
"""Styles by name. 3.5 and 7.16 inches are one and two columns of an IEEE journal."""


def find_style(name: str) -> Style:
    """Return a style by name. Raise RigtwinError, naming all styles, if it is unknown."""
    if name not in STYLES:
        raise RigtwinError(f"unknown style {name!r}; expected {', '.join(STYLES)}")
    return STYLES[name]
