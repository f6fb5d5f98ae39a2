"""Plate that yields to its load: T·y' + y = c·(load − z), by compliance c, lag T and zero load z.

Load and displacement depend on each other within a timestep. A plate that yields slides against the
motor's rod, and the direction of sliding decides the friction that loads it. Both are solved
together, so that a cylinder of any compliance is stable at any timestep.
"""

from __future__ import annotations

from typing import NamedTuple

from controllers.compiled import compilable
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.sensors import Lvdt, apply_sensor
from rigtwin.numerics.arrays import Array


def yield_to_load(cylinder: Cylinder, load: Array, period: float) -> Array:
    """Compute how far a plate yields to a known load.

    Parameters
    ----------
    cylinder
        Cylinder with its compliance, lag and zero load.
    load
        Load, N, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        Displacement, m, shape (ticks,).
    """
    # The lag is that of a sensor: the same first-order law.
    behind = Lvdt(lag=cylinder.yield_lag)
    return cylinder.compliance * apply_sensor(behind, load - cylinder.zero_load, period)


@compilable
def share_of_load(compliance: float, lag: float, timestep: float) -> float:
    """Return the yielding rate per newton of load, m/(Ns).

    The implicit Euler rule gives y' = (compliance·load − y)/(lag + timestep).
    """
    return compliance / (lag + timestep)


class Rod(NamedTuple):
    """Motor rod on a plate that yields to its load, over one step.

    The plate moves with w = free + share·load. At a velocity v of the carriage, the load is
    force − viscous·(w − v) − F_dry(w − v).
    """

    free: float  # Velocity of the plate without load, m/s.
    share: float  # Velocity of the plate per newton of load, m/(Ns), above 0.
    force: float  # Motor force without friction, N.
    viscous: float  # Viscous friction of the motor, Ns/m.
    forward: float  # Limit of the motor's dry friction against positive w − v, N.
    backward: float  # Limit of the motor's dry friction against negative w − v, N.


@compilable
def rod_load(rod: Rod, v: float) -> float:
    """Return the rod's load on a yielding plate, N, at a velocity v of the carriage, m/s."""
    # Slide forward, slide backward, or stick with w = v.
    share, force, viscous = rod.share, rod.force, rod.viscous
    sliding = rod.free - v + share * force
    if sliding > share * rod.forward:
        drag = viscous * (sliding - share * rod.forward) / (1.0 + share * viscous)
        return force - rod.forward - drag
    if sliding < -share * rod.backward:
        drag = viscous * (sliding + share * rod.backward) / (1.0 + share * viscous)
        return force + rod.backward - drag
    return (v - rod.free) / share


@compilable
def solve_sliding(rod: Rod, momentum: float, inertia: float, timestep: float) -> float:
    """Solve inertia·v + timestep·load(v) = momentum for the velocity of a sliding carriage, m/s.

    `momentum` contains the rail's friction impulse, Ns. The other parameters are those of
    `solve_yielding`.
    """
    # Below `slow` the plate runs ahead of the carriage, above `fast` behind it, and in between the
    # rod sticks.
    free, share, force = rod.free, rod.share, rod.force
    slow, fast = free + share * (force - rod.forward), free + share * (force + rod.backward)
    slope = rod.viscous / (1.0 + share * rod.viscous)
    if inertia * slow + timestep * (force - rod.forward) >= momentum:
        return (momentum - timestep * (force - rod.forward - slope * slow)) / (
            inertia + timestep * slope
        )
    if inertia * fast + timestep * (force + rod.backward) <= momentum:
        return (momentum - timestep * (force + rod.backward - slope * fast)) / (
            inertia + timestep * slope
        )
    return (momentum + timestep * free / share) / (inertia + timestep / share)


@compilable
def solve_yielding(
    rod: Rod, rhs: float, inertia: float, timestep: float, rail: tuple[float, float]
) -> tuple[float, float]:
    """Solve for the carriage's velocity v and the load of a plate that yields to it.

    The inclusion inertia·v + rail friction(v) + timestep·load(v) ∋ rhs is solved exactly. Its left
    side grows with v and is linear between the points where rail or rod begin to slide.

    Parameters
    ----------
    rod
        Rod between carriage and plate.
    rhs
        Momentum without the rod's force, Ns.
    inertia
        Inertia with implicit damping, kg.
    timestep
        Length of the step, s.
    rail
        Limits of the rail's friction impulse against positive and negative v, Ns.

    Returns
    -------
    tuple
        Velocity v, m/s, and load, N.
    """
    # At rest, does the rail hold the carriage?
    still = timestep * rod_load(rod, 0.0) - rhs
    if still + rail[0] < 0.0:
        momentum = rhs - rail[0]
    elif still - rail[1] > 0.0:
        momentum = rhs + rail[1]
    else:
        return 0.0, rod_load(rod, 0.0)
    v = solve_sliding(rod, momentum, inertia, timestep)
    return v, rod_load(rod, v)
