"""Force of a guide beside its dry friction: damping, and what depends on the position.

`Guide` states the equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.effect import Points
from rigtwin.components.guide import Guide

TOLD = 7
"""Number of positions at which a curve is reported."""


@compilable
def damping(guide: Guide, velocity: float) -> float:
    """Return the viscous coefficient in the direction of a velocity, m/s: Ns/m."""
    more = 0.5 * guide.viscous_asymmetry
    return guide.viscous + (more if velocity > 0.0 else -more)


@compilable
def has_curve(guide: Guide) -> bool:
    """Return whether the guide exerts a force that is a curve over the stroke."""
    low = guide.curve_2 != 0.0 or guide.curve_3 != 0.0
    return low or guide.curve_4 != 0.0 or guide.curve_5 != 0.0


@compilable
def curve(guide: Guide, position: float) -> float:
    """Return the smooth force over the stroke, N.

    F = Σ_n curve_n·T_n(ξ), n = 2 … 5, with Chebyshev's polynomials T_n of the position ξ relative
    to the range, which is held within ±1. A constant and a linear part are `offset` and
    `stiffness`.
    """
    first = min(max((position - guide.curve_middle) / guide.curve_half_range, -1.0), 1.0)
    # Chebyshev's recurrence: T_{n+1} = 2·ξ·T_n − T_{n−1}.
    second = 2.0 * first * first - 1.0
    third = 2.0 * first * second - first
    fourth = 2.0 * first * third - second
    fifth = 2.0 * first * fourth - third
    even = guide.curve_2 * second + guide.curve_4 * fourth
    return even + guide.curve_3 * third + guide.curve_5 * fifth


@compilable
def curve_size(guide: Guide) -> float:
    """Return an upper bound of the magnitude of the curve's force, N."""
    return abs(guide.curve_2) + abs(guide.curve_3) + abs(guide.curve_4) + abs(guide.curve_5)


@compilable
def beyond_stop(guide: Guide, position: float) -> float:
    """Return how far a position lies beyond an end stop, m; 0 between the stops."""
    return max(position - guide.stop_high, 0.0) + min(position - guide.stop_low, 0.0)


@compilable
def beyond_slack(guide: Guide, deflection: float) -> float:
    """Return how far a spring is stretched once its gap is crossed, m."""
    half = 0.5 * guide.slack
    return deflection - min(max(deflection, -half), half)


@compilable
def quick_damping(guide: Guide, position: float, velocity: float) -> float:
    """Return the coefficient of the damping that follows the velocity at once, Ns/m.

    It is drag·|v|, and that of an end stop where the position is beyond it.
    """
    coefficient = guide.drag * abs(velocity)
    if guide.stop_damping != 0.0 and beyond_stop(guide, position) != 0.0:
        coefficient += guide.stop_damping
    return coefficient


@compilable
def position_force(guide: Guide, position: float, rest: float) -> float:
    """Return spring, constant force, cogging, curve and end stops at a position, N.

    F = stiffness·t(x − rest) + cubic_stiffness·t(x − rest)³ + offset
    + cogging·sin(2π·x/cogging_pitch + cogging_phase) + curve + stop_stiffness·s(x), with the way
    s(x) beyond an end stop, and the way t(d) beyond the slack.
    """
    deflection = beyond_slack(guide, position - rest)
    stiffness = guide.stiffness + guide.cubic_stiffness * deflection * deflection
    force = stiffness * deflection + guide.offset
    if has_curve(guide):
        force += curve(guide, position)
    if guide.cogging != 0.0:
        force += guide.cogging * math.sin(
            2.0 * math.pi * position / guide.cogging_pitch + guide.cogging_phase
        )
    if guide.stop_stiffness != 0.0:
        force += guide.stop_stiffness * beyond_stop(guide, position)
    return force


def curve_points(values: Mapping[str, float]) -> Points:
    """Return positions and forces along the curve of a position-dependent force, m and N."""
    guide = Guide(**values)
    places = guide.curve_middle + guide.curve_half_range * np.linspace(-1.0, 1.0, TOLD)
    return tuple((float(place), curve(guide, float(place))) for place in places)
