"""Meaning of a component's parameters: unit, bounds and source, and the sources that all share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from controllers.quantity import Choice, Quantity, fields

UNLIMITED = 1e9
"""Value of a limit that is never reached. Finite, so that compiled code can calculate with it."""
NONE = "none in the nominal machine"
"""Source of a neutral value."""
MJCF = "the MJCF, unless the description says otherwise"
"""Source of a value that a described machine takes from its MJCF."""


STRIBECK_EXPONENT = Quantity(
    "1",
    0.5,
    3.0,
    "2: Gauss' curve; 0.5 to 2 are used, Armstrong-Hélouvry et al., Automatica 30(7), 1994",
)
"""Exponent of the Stribeck curve, a parameter of motor, rail and guide."""

ORDERED = (("command_low", "command_high"), ("stop_low", "stop_high"))
"""Pairs of parameters of one component of which the first is the smaller one."""


def describe_disorder(values: Mapping[str, Any]) -> str | None:
    """Describe the first pair of parameters whose values are in the wrong order.

    Parameters
    ----------
    values
        Parameters of a component, by name.

    Returns
    -------
    str or None
        Description of the wrong order and the right one; None if no pair is wrong.
    """
    for low, high in ORDERED:
        if low in values and not values[low] < values[high]:
            return f"{low} {values[low]:g}: expected less than {high} {values[high]:g}"
    return None


__all__ = [
    "MJCF",
    "NONE",
    "STRIBECK_EXPONENT",
    "UNLIMITED",
    "Choice",
    "Quantity",
    "describe_disorder",
    "fields",
]
