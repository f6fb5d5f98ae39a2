"""Gas spring: the one law that the plant obeys and the structure model counts on (thesis Eq.
3.3)."""

from __future__ import annotations

import math

from controllers.compiled import compilable


@compilable
def gas_force(extended: float, length: float, exponent: float, stroke: float) -> float:
    """F = P_i A_g (L/(L − x))^γ, N, at a compression x, m; infinite where no room is left for the
    gas. extended: force fully extended, N; length: of the gas column, m."""
    if stroke >= length:
        return math.inf
    return extended * (length / (length - stroke)) ** exponent
