"""A tyre: a compliant contact that only pushes, whose stiffness may grow with its deflection."""

from __future__ import annotations

from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.effect import Kind, Starts, fixed_starts
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.numerics.arrays import Array

SCALE = 0.01
"""m; at this deflection a tyre hardens as much whatever the power of its law."""


class Tyre(NamedTuple):
    """Tyre: a compliant contact that only pushes, stiffness·δ·(1 + hardening·δ·(δ/10 mm)^(power −
    1)) + damping·dδ/dt."""

    stiffness: Annotated[
        float, Quantity("N/m", 1e3, 1e7, "best match of the tests, thesis §6.3")
    ] = 50_000.0
    damping: Annotated[
        float, Quantity("Ns/m", 0.0, 1e4, "0 in the ideal model, thesis Table 7.1")
    ] = 0.0
    hardening: Annotated[float, Quantity("1/m", -50.0, 500.0, NONE)] = 0.0
    hardening_power: Annotated[
        float, Quantity("1", 1.0, 3.0, "1: a quadratic law, assumed; 2: a cubic one")
    ] = 1.0


def tyre_force(tyre: Tyre, deflection: Array, rate: Array) -> Array:
    """What the tyre pushes with; it cannot pull.

    Parameters
    ----------
    tyre
        Its parameters.
    deflection, rate
        m and m/s, shape (n,).

    Returns
    -------
    Force in N, shape (n,).
    """
    squeezed = np.maximum(deflection, 0.0)
    hardening = tyre.hardening * squeezed * (squeezed / SCALE) ** (tyre.hardening_power - 1.0)
    slope = np.maximum(1.0 + hardening, 0.0)
    damping = np.where(deflection > 0.0, tyre.damping * rate, 0.0)
    return np.maximum(tyre.stiffness * slope * squeezed + damping, 0.0)


KINDS = (
    Kind(
        "damping",
        "damping",
        ("damping",),
        "damping while in contact",
        {Tyre: fixed_starts((30.0, 150.0, 600.0, 1500.0), 10.0)},
    ),
    Kind(
        "hardening",
        "hardening",
        ("hardening", "hardening_power"),
        "stiffness that grows with deflection",
        {
            Tyre: lambda _: Starts(
                tuple(product((-15.0, 5.0, 20.0, 60.0, 150.0), (1.0, 2.0))), (1.0, 0.05)
            )
        },
    ),
)
