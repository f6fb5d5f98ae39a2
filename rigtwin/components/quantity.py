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

__all__ = ["MJCF", "NONE", "UNLIMITED", "Choice", "Quantity", "fields"]
