"""Dry friction of whatever slides: Coulomb, Stribeck, a difference between directions, and backlash in series with it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.parameters import Motor, Rail
from rigtwin.numerics.arrays import Array

ROUNDING = 1e-12
"""m, within which a gap is taken up."""


class Friction(NamedTuple):
    """changing: whether the dry friction depends on the motion. asymmetry: friction in positive less that in negative
    direction, N."""

    changing: bool
    coulomb: float
    stribeck: float
    stribeck_velocity: float
    asymmetry: float
    backlash: float


def friction(of: Rail | Motor) -> Friction:
    """The dry friction of a rail or motor; its viscous friction is MuJoCo's damping."""
    changing = (of.stribeck, of.asymmetry, of.backlash) != (0.0, 0.0, 0.0)
    return Friction(changing, of.coulomb, of.stribeck, of.stribeck_velocity, of.asymmetry, of.backlash)


def gap_at(position: float) -> Array:
    """State of the backlash: where its element is, m; shape (1,)."""
    return np.array([position])


@compilable
def breakaway(dry: Friction, gap: Array, position: float, velocity: float) -> tuple[float, float]:
    """The forces that dry friction can bear now, N: against positive and against negative motion. Moves the backlash's
    element, whose friction is felt only where the gap is taken up, and only in the direction that pushes it on."""
    ratio = velocity / dry.stribeck_velocity
    size = dry.coulomb + dry.stribeck * math.exp(-ratio * ratio)
    forward, backward = max(size + 0.5 * dry.asymmetry, 0.0), max(size - 0.5 * dry.asymmetry, 0.0)
    half = 0.5 * dry.backlash
    if half > 0.0:
        apart = position - gap[0]
        if apart >= half - ROUNDING:
            gap[0] = position - half
            return forward, 0.0
        if apart <= ROUNDING - half:
            gap[0] = position + half
            return 0.0, backward
        return 0.0, 0.0
    return forward, backward
