"""Panels of a plot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rigtwin.numerics.arrays import Array
from rigtwin.render.style import COLOURS

RIG_SENSORS = ("structure_lvdt", "load_cell")
"""Sensors by which a recording of the suspension rig is recognised."""


@dataclass(frozen=True)
class Trace:
    """Line of a panel.

    Attributes
    ----------
    label, colour
        Legend and colour.
    needs
        Channels that the line needs.
    value
        Function of these channels that returns the line in the panel's unit.
    """

    label: str
    colour: str
    needs: tuple[tuple[str, str], ...]
    value: Callable[..., Array]


@dataclass(frozen=True)
class Panel:
    """Panel: lines that share an axis."""

    title: str
    traces: tuple[Trace, ...]


def _millimetres(position: Array) -> Array:
    """Return a position in mm."""
    return 1e3 * position


def _wheel(structure: Array, travel: Array) -> Array:
    """Return the wheel's position in mm: plate minus travel."""
    return 1e3 * (structure - travel)


def plain(signal: Array) -> Array:
    """Return a signal unchanged."""
    return signal


SENSED, ASKED = COLOURS["measured"], COLOURS["commanded"]
PANELS = (
    Panel(
        "ground, mm",
        (
            Trace("measured", SENSED, (("/sensor", "ground_lvdt"),), _millimetres),
            Trace("commanded", ASKED, (("/command", "ground"),), _millimetres),
        ),
    ),
    Panel(
        "plate (sprung mass), mm",
        (
            Trace("measured", SENSED, (("/sensor", "structure_lvdt"),), _millimetres),
            Trace("commanded", ASKED, (("/command", "structure"),), _millimetres),
        ),
    ),
    Panel(
        "suspension travel, mm",
        (Trace("measured", SENSED, (("/sensor", "suspension_lvdt"),), _millimetres),),
    ),
    Panel(
        "wheel, mm",
        (
            Trace(
                "plate − travel",
                SENSED,
                (("/sensor", "structure_lvdt"), ("/sensor", "suspension_lvdt")),
                _wheel,
            ),
        ),
    ),
    Panel(
        "suspension force, N",
        (
            Trace("measured", SENSED, (("/sensor", "load_cell"),), plain),
            Trace("demanded", ASKED, (("/command", "force"),), plain),
        ),
    ),
    Panel("motor voltage, V", (Trace("commanded", ASKED, (("/command", "voltage"),), plain),)),
)
"""Panels of the suspension rig from top to bottom. Panels without data are left out."""
