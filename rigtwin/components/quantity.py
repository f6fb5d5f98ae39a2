"""Meaning of a component's parameters: unit, bounds and source, and the sources that all share."""

from __future__ import annotations

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

__all__ = ["MJCF", "NONE", "STRIBECK_EXPONENT", "UNLIMITED", "Choice", "Quantity", "fields"]
