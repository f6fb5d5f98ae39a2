"""Curves under the scene of a film."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Curve:
    """One signal over time.

    Attributes
    ----------
    axis : str
        Title of the axis, unit included; curves of one title share it.
    label : str
        Text in the legend; empty for none.
    colour : str
        Colour of the line.
    values : Array
        Shape (ticks,).
    """

    axis: str
    label: str
    colour: str
    values: Array
