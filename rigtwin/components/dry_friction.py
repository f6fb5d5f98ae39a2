"""Dry friction of a rail, a motor or a guide.

It is set-valued: at rest it bears any force up to the limits that `dry_limits` returns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.guide import Guide, Rail
from rigtwin.components.motor import Motor
from rigtwin.numerics.arrays import Array

ROUNDING = 1e-12
"""Distance within which a gap counts as taken up, m."""
CONSTANT = ("coulomb", "stribeck_velocity", "stribeck_exponent")
"""Parameters that do not by themselves make friction depend on the motion."""


class Friction(NamedTuple):
    """Dry friction as compiled code takes it; parameters as in `Guide`."""

    changing: bool  # Whether friction depends on the motion; otherwise it is `coulomb` alone.
    coulomb: float
    stribeck: float
    stribeck_velocity: float
    stribeck_exponent: float
    asymmetry: float
    load_coefficient: float
    backlash: float


def friction(component: Rail | Motor | Guide) -> Friction:
    """Return the dry friction of a rail, motor or guide."""
    # A rail has no load-dependent friction, and a motor none of the guide's other parameters.
    known = component._asdict()
    values = {name: float(known.get(name, 0.0)) for name in Friction._fields[1:]}
    changing = any(v for name, v in values.items() if name not in CONSTANT)
    return Friction(changing, **values)


def friction_size(dry: Friction, load: float) -> float:
    """Return the largest dry friction, N, under a typical load, N."""
    size = dry.coulomb + abs(dry.stribeck) + 0.5 * abs(dry.asymmetry)
    return size + dry.load_coefficient * abs(load)


def gap_at(position: float) -> Array:
    """Return the state of a backlash: the position of its friction element, m, shape (1,)."""
    return np.array([position])


@compilable
def dry_limits(dry: Friction, velocity: float, load: float) -> tuple[float, float]:
    """Return the limits of dry friction.

    F_max = coulomb + load_coefficient·|load| + stribeck·exp(−|v/v_s|^n) ± ½·asymmetry, not below 0.

    Parameters
    ----------
    dry
        Parameters of the friction.
    velocity
        Velocity v of the motion that friction resists, m/s.
    load
        Force that the sliding part transmits, N. The models differ in what they
        count as such a force (docs/theory.md, "Load friction").

    Returns
    -------
    tuple
        Largest forces against positive and against negative motion, N.
    """
    size = dry.coulomb + dry.load_coefficient * abs(load)
    if dry.stribeck != 0.0:
        ratio = abs(velocity / dry.stribeck_velocity)
        exponent = dry.stribeck_exponent
        # Gauss' curve is the usual case: a product is faster than a power.
        power = ratio * ratio if exponent == 2.0 else ratio**exponent
        size += dry.stribeck * math.exp(-power)
    return max(size + 0.5 * dry.asymmetry, 0.0), max(size - 0.5 * dry.asymmetry, 0.0)


@compilable
def breakaway(
    dry: Friction, gap: Array, position: float, velocity: float, load: float
) -> tuple[float, float]:
    """Return the limits of dry friction behind a backlash, and move its friction element.

    Friction acts only where the gap is taken up, and only against motion that pushes the element.

    Parameters
    ----------
    dry
        Parameters of the friction.
    gap
        State of the backlash, m, shape (1,); changed in place.
    position, velocity
        Position and velocity of the motion, m and m/s.
    load
        Force that the sliding part transmits, N.

    Returns
    -------
    tuple
        Largest forces against positive and against negative motion, N.
    """
    forward, backward = dry_limits(dry, velocity, load)
    half = 0.5 * dry.backlash
    if half > 0.0:
        displacement = position - gap[0]
        if displacement >= half - ROUNDING:
            gap[0] = position - half
            return forward, 0.0
        if displacement <= ROUNDING - half:
            gap[0] = position + half
            return 0.0, backward
        return 0.0, 0.0
    return forward, backward


@compilable
def stretch(distance: float, half: float) -> float:
    """Return the stretch of the spring behind a backlash of 2·half, m."""
    return distance - half if distance > half else (distance + half if distance < -half else 0.0)


@compilable
def slide(
    distance: float, half: float, spring: float, forward: float, backward: float
) -> tuple[float, float]:
    """Return dry friction and slip of an elastic, perfectly plastic element behind a backlash.

    F = clip(spring·stretch, −backward, forward). Where a limit is reached, the slider follows so
    that the spring holds exactly that limit.

    Parameters
    ----------
    distance
        Distance from the slider to the joint, m.
    half
        Half the backlash, m.
    spring
        Stiffness in series with the friction, N/m.
    forward, backward
        Limits against positive and negative motion, N.

    Returns
    -------
    tuple
        Dry friction, N, and motion of the slider, m.
    """
    force = spring * stretch(distance, half)
    if force > forward:
        return forward, distance - half - forward / spring
    if force < -backward:
        return -backward, distance + half + backward / spring
    return force, 0.0
