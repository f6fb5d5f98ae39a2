"""Bars of a report that compare the gap before and after the correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigtwin.diagnosis.answer import Answer

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Bar:
    """Bar of the gap chart.

    Attributes
    ----------
    name
        Component, or "all sensors".
    before, after
        Gap before and after the correction, in noise floors.
    before_width, after_width, floor_width
        Widths of the bars and position of the noise floor, in percent of the chart.
    """

    name: str
    before: float
    after: float
    before_width: float
    after_width: float
    floor_width: float


def bars(answer: Answer) -> list[Bar]:
    """Return the bars of the gap chart on one scale.

    Parameters
    ----------
    answer
        Answer of a diagnosis.

    Returns
    -------
    list of Bar
        All sensors first, then each component's replay. A single replay stands alone: the bar of
        all sensors would be equal. Empty if the data cannot be diagnosed.
    """
    if answer.gap is None:
        return []
    gap = answer.gap
    levels = [("all sensors", gap.before, gap.after)]
    replays = [
        (name.replace("_", " "), level.before, level.after) for name, level in gap.replays.items()
    ]
    levels = [*levels, *replays] if len(replays) > 1 else replays or levels
    largest = max(max(before, after, 1.0) for _, before, after in levels)

    def width(value: float) -> float:
        return 100.0 * value / largest

    return [Bar(name, b, a, width(b), width(a), width(1.0)) for name, b, a in levels]
