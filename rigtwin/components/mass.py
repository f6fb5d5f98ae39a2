"""What moves: its mass, and where a search for another one starts."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.effect import Kind, shares_of_nominal, shares_of_size
from rigtwin.components.quantity import MJCF, Quantity


class Carriage(NamedTuple):
    """Rail-guided carriage with wheel and tyre."""

    mass: Annotated[float, Quantity("kg", 1.0, 1e4, "34 kg with wheel and tyre; thesis ch. 3")] = (
        34.0
    )


class Mass(NamedTuple):
    """What moves."""

    mass: Annotated[float, Quantity("kg", 0.0, 1e6, MJCF)] = 0.0


KINDS = (
    Kind(
        "mass",
        "mass",
        ("mass",),
        "mass",
        {
            Carriage: shares_of_nominal((0.85, 0.95, 1.05, 1.15, 1.4), 0.005),
            Mass: shares_of_size(
                lambda s: s.force / s.acceleration, (0.7, 0.9, 0.97, 1.03, 1.1, 1.4), 0.005
            ),
        },
    ),
)
