"""What turns with a joint behind its gear, or with a coupling of joints: a motor's rotor."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.effect import Kind, around_nominal
from rigtwin.components.quantity import MJCF, Quantity


class Rotor(NamedTuple):
    """A motor's rotor and its gear, at the joint. inertia: times the gear's ratio squared; it has
    no weight and takes no part in the other joints' motion."""

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
