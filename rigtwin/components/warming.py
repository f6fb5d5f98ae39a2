"""Warming: friction of a guide that a cold machine has more of, and that fades as it runs.

With the time t since the log began, and the velocity v of the joint:

    F = (coulomb·s + viscous·v)·exp(−t/time).

Dry friction of unit size, s from −1 to 1, is that of a schedule (`schedule`). Grease is the stiffer
the colder it is, and a joint that works approaches a steady temperature exponentially, as a body
that loses heat in proportion to its temperature does. How the friction of a robot's joint falls
with its temperature is measured in [Bittencourt, Gunnarsson, J. Dyn. Sys., Meas., Control 134(5)
(2012) 051013]. A negative value is friction that grows.
"""

from __future__ import annotations

from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.effect import Context, Guess, Kind, Starts
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.components.schedule import Schedule
from rigtwin.numerics.arrays import Array

PARTS = (0.3, 0.1, -0.1)
"""Shares of the motion's force at which a search starts, at the beginning of the log."""
TIMES = (5.0, 20.0, 80.0)
"""Starting times within which friction fades, in characteristic times of the motion. The last one
is also the longest: friction that fades within ages does not differ from friction that stays."""
LARGEST = 100.0
"""Largest friction of a cold machine, in forces of the motion."""


class Warming(NamedTuple):
    """Friction of a guide beyond that of the warm machine.

    Units are those of a sliding joint; for a turning joint, read Nm for N.
    """

    coulomb: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    viscous: Annotated[float, Quantity("Ns/m", -1e9, 1e9, NONE)] = 0.0
    time: Annotated[float, Quantity("s", 1e-3, 1e6, "10: within seconds")] = 10.0

    @property
    def schedule(self) -> Schedule:
        """The same forces for each unit of `fade`."""
        return Schedule(coulomb=self.coulomb, viscous=self.viscous)

    def fade(self, ticks: int, period: float) -> Array:
        """Return the share of the friction that is left at each tick, shape (ticks,)."""
        return np.asarray(np.exp(-period * np.arange(ticks) / self.time))


def _cold(size: str) -> Guess:
    """Return starts of a friction that fades: `size` names the scale of the force."""

    def guess(context: Context) -> Starts:
        scales = context.scales
        force = scales.force / (scales.speed if size == "damping" else 1.0)
        values = tuple(
            (share * force, times * scales.time) for share, times in product(PARTS, TIMES)
        )
        bounds = (-LARGEST * force, LARGEST * force), (scales.period, TIMES[-1] * scales.time)
        return Starts(values, (0.005 * force, 0.1 * scales.time), bounds=bounds)

    return guess


KINDS = (
    Kind(
        "coulomb",
        "Coulomb friction while cold",
        ("coulomb", "time"),
        "dry friction that a cold machine has in addition, and that fades in the course of the log",
        {Warming: _cold("force")},
        "dry friction that a cold machine lacks, and that grows in the course of the log",
    ),
    Kind(
        "viscous",
        "viscous friction while cold",
        ("viscous", "time"),
        "viscous friction that a cold machine has in addition, and that fades in the course of the "
        "log",
        {Warming: _cold("damping")},
        "viscous friction that a cold machine lacks, and that grows in the course of the log",
    ),
)
