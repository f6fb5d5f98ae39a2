"""How figures look: on a screen, or in a paper with its columns and its type size."""

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
    """A way to draw. width: of a figure, panel: height of a panel and rest: of what is not panel,
    inches; text: points; line: of a trace, points; dashed: of what was commanded, a pattern that
    tells it from what was measured without colour; titled: whether the figure says what it is of;
    dpi: of pixels; settings: matplotlib's."""

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
        """As what is drawn and saved meanwhile looks."""
        with context(dict(self.settings)):
            yield


def _paper(width: float) -> Style:
    """Of a journal: sans serif text of 8 points, thin lines, type that stays type in vector files
    (journals ask for embedded TrueType fonts), and no title, which is the caption's."""
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
            "svg.fonttype": "none",
        },
    )


STYLES = {"screen": Style(), "paper": _paper(3.5), "paper-wide": _paper(7.16)}
"""By name: 3.5 and 7.16 inches are one and two columns of an IEEE journal."""


def find_style(name: str) -> Style:
    """The style of a name. Raises RigtwinError naming all there are."""
    if name not in STYLES:
        raise RigtwinError(f"unknown style {name!r}; there are {', '.join(STYLES)}")
    return STYLES[name]
