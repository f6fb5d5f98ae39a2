"""Dry friction of whatever slides: Coulomb, Stribeck, a difference between directions, and backlash in series with it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.arrays import Array
from rigtwin.parameters import Motor, Rail


class Friction(NamedTuple):
    """changing: whether the dry friction depends on the motion. asymmetry: friction in positive less that in negative
    direction, N; the same as a constant force of half of it against positive motion."""

    changing: bool
    coulomb: float
    stribeck: float
    stribeck_velocity: float
    asymmetry: float
    backlash: float


def friction(of: Rail | Motor) -> Friction:
    """The dry friction of a rail or motor; its viscous friction is MuJoCo's damping."""
    changing = of.stribeck != 0.0 or of.backlash != 0.0
    return Friction(changing, of.coulomb, of.stribeck, of.stribeck_velocity, of.asymmetry, of.backlash)


def gap_at(position: float) -> Array:
    """State of the backlash: where its element is, m; shape (1,)."""
    return np.array([position])


@compilable
def breakaway(dry: Friction, gap: Array, position: float, velocity: float) -> float:
    """The force that dry friction can bear now, N. Moves the backlash's element, whose friction is felt only where the
    gap is taken up."""
    half = 0.5 * dry.backlash
    if half > 0.0:
        if abs(position - gap[0]) < half:
            return 0.0
        gap[0] = position - math.copysign(half, position - gap[0])
    ratio = velocity / dry.stribeck_velocity
    return max(dry.coulomb + dry.stribeck * math.exp(-ratio * ratio), 0.0)
