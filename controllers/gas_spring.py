"""Law of the gas spring (thesis Eq. 3.3), shared by the plant and the structure model."""

from __future__ import annotations

import math

from controllers.compiled import compilable


@compilable
def gas_force(extended: float, length: float, exponent: float, stroke: float) -> float:
    """Return the force F = P_i A_g (L/(L − x))^γ of a gas spring at a compression x, N.

    extended: force P_i A_g at full extension, N; length: L of the gas column, m; exponent: γ;
    stroke: x, m. The force is infinite if no room is left for the gas.
    """
    if stroke >= length:
        return math.inf
    return extended * (length / (length - stroke)) ** exponent
