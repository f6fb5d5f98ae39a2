"""Rotor of a motor behind its gear: inertia without weight at a joint or a coupling of joints.

The force is F = inertia·x'' along the joint or coupling, with inertia = J_rotor·ratio² (the
armature of MuJoCo).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.effect import Kind
from rigtwin.components.quantity import MJCF, Quantity
from rigtwin.components.starts import around_nominal


class Rotor(NamedTuple):
    """Rotor with its gear, seen from the joint.

    Its inertia is that of the rotor times the square of the gear ratio. Gravity does not act on it,
    and the motion of other joints does not accelerate it. Units are those of a sliding joint; for a
    turning joint, read kg m² for kg.
    """

    inertia: Annotated[float, Quantity("kg", 0.0, 1e6, MJCF)] = 0.0


KINDS = (
    Kind(
        "armature",
        "rotor's inertia",
        ("inertia",),
        "inertia that turns with the motor alone, and that gravity does not act on",
        {Rotor: around_nominal(lambda s: s.force / s.acceleration, (-0.1, 0.02, 0.1, 0.3), 0.005)},
    ),
)
