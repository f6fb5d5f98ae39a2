"""Tyre: a compliant contact that only pushes, and whose stiffness may grow with its deflection."""

from __future__ import annotations

from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.effect import Kind, Starts
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.components.starts import fixed_starts
from rigtwin.numerics.arrays import Array

SCALE = 0.01
"""Deflection at which the hardening is the same for all powers, m."""


class Tyre(NamedTuple):
    """Tyre with the deflection δ > 0:

    F = stiffness·δ·(1 + hardening·δ·(δ/10 mm)^(hardening_power − 1)) + damping·dδ/dt, not below 0.
    """

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
    """Return the force of a tyre; it cannot pull.

    Parameters
    ----------
    tyre
        Parameters of the tyre.
    deflection, rate
        Deflection and its rate, m and m/s, shape (n,).

    Returns
    -------
    array
        Force, N, shape (n,).
    """
    squeezed = np.maximum(deflection, 0.0)
    hardening = tyre.hardening * squeezed * (squeezed / SCALE) ** (tyre.hardening_power - 1.0)
    # A softening tyre (negative hardening) must not turn into one that pulls.
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
