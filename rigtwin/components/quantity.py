"""What every component's parameters share: their meaning, and the words for a value that is not
there."""

from __future__ import annotations

from controllers.quantity import Choice, Quantity, fields

UNLIMITED = 1e9
"""Of a limit: so high that it is never reached."""
NONE = "none in the nominal machine"
"""Source of a neutral value."""
MJCF = "the MJCF, unless the description says otherwise"
"""Source of what a described machine's model says."""


STRIBECK_EXPONENT = Quantity(
    "1",
    0.5,
    3.0,
    "2: Gauss' curve; 0.5 to 2 are used, Armstrong-Hélouvry et al., Automatica 30(7), 1994",
)
"""Shared by all that slide."""

__all__ = ["MJCF", "NONE", "STRIBECK_EXPONENT", "UNLIMITED", "Choice", "Quantity", "fields"]
