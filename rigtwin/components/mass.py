"""Mass of a moving part, m in F = m·x'', and the effect of another mass."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.effect import Context, Kind, Starts
from rigtwin.components.quantity import MJCF, Quantity
from rigtwin.components.starts import shares_of_nominal


class Carriage(NamedTuple):
    """Carriage of the suspension rig on its rail, with wheel and tyre."""

    mass: Annotated[float, Quantity("kg", 1.0, 1e4, "34 kg with wheel and tyre; thesis ch. 3")] = (
        34.0
    )


class Mass(NamedTuple):
    """Mass, or moment of inertia, that moves with one joint of a described machine.

    Units are those of a sliding joint; for a turning joint, read kg m² for kg.
    """

    mass: Annotated[float, Quantity("kg", 0.0, 1e6, MJCF)] = 0.0


LIGHTEST = 0.1
"""Smallest mass, as a share of the nominal one. Forces that hardly show the inertia would be
explained by a part that weighs nothing."""


def _mass(context: Context) -> Starts:
    unit = nominal = context.nominal
    if nominal == 0.0:
        # F / a is the whole inertia that a measured force could move.
        unit = context.scales.force / context.scales.acceleration
    values = tuple((share * unit,) for share in (0.7, 0.9, 0.97, 1.03, 1.1, 1.4))
    return Starts(values, (0.005 * unit,), bounds=((LIGHTEST * nominal, 1e6),))


KINDS = (
    Kind(
        "mass",
        "mass",
        ("mass",),
        "mass",
        {
            Carriage: shares_of_nominal((0.85, 0.95, 1.05, 1.15, 1.4), 0.005),
            Mass: _mass,
        },
    ),
)
