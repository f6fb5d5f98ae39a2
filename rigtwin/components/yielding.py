"""Plate that yields to its load: T·y' + y = c·(load − z), by compliance c, lag T and zero load z.

Load and displacement depend on each other within a timestep. A plate that yields slides against the
motor's rod, and the direction of sliding decides the friction that loads it. Both are solved
together, so that a cylinder of any compliance is stable at any timestep.
"""

from __future__ import annotations

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


@compilable
def yielding_rate(share: float, load: float, yielded: float, lag: float, timestep: float) -> float:
    """Return the rate at which a plate yields, m/s.

    Parameters
    ----------
    share
        Rate per newton of load, m/(Ns), by `share_of_load`.
    load
        Load, N.
    yielded
        Displacement so far, m.
    lag, timestep
        Lag of the plate and length of the step, s.
    """
    return share * load - yielded / (lag + timestep)


@compilable
def rod_load(
    v: float,
    free: float,
    share: float,
    force: float,
    viscous: float,
    forward: float,
    backward: float,
) -> float:
    """Return the rod's load on a yielding plate, N, at a velocity v of the carriage, m/s.

    The plate moves with w = free + share·load, and load = force − viscous·(w − v) − F_dry(w − v).
    Parameters are those of `solve_yielding`.
    """
    # Slide forward, slide backward, or stick with w = v.
    sliding = free - v + share * force
    if sliding > share * forward:
        return force - forward - viscous * (sliding - share * forward) / (1.0 + share * viscous)
    if sliding < -share * backward:
        return force + backward - viscous * (sliding + share * backward) / (1.0 + share * viscous)
    return (v - free) / share


@compilable
def solve_sliding(
    momentum: float,
    inertia: float,
    timestep: float,
    free: float,
    share: float,
    force: float,
    viscous: float,
    forward: float,
    backward: float,
) -> float:
    """Solve inertia·v + timestep·load(v) = momentum for the velocity of a sliding carriage, m/s.

    `momentum` contains the rail's friction impulse, Ns. The other parameters are those of
    `solve_yielding`.
    """
    # Below `slow` the plate runs ahead of the carriage, above `fast` behind it, and in between the
    # rod sticks.
    slow, fast = free + share * (force - forward), free + share * (force + backward)
    slope = viscous / (1.0 + share * viscous)
    if inertia * slow + timestep * (force - forward) >= momentum:
        return (momentum - timestep * (force - forward - slope * slow)) / (
            inertia + timestep * slope
        )
    if inertia * fast + timestep * (force + backward) <= momentum:
        return (momentum - timestep * (force + backward - slope * fast)) / (
            inertia + timestep * slope
        )
    return (momentum + timestep * free / share) / (inertia + timestep / share)


@compilable
def solve_yielding(
    rhs: float,
    inertia: float,
    timestep: float,
    rail: tuple[float, float],
    free: float,
    share: float,
    force: float,
    viscous: float,
    forward: float,
    backward: float,
) -> tuple[float, float]:
    """Solve for the carriage's velocity v and the load of a plate that yields to it.

    The inclusion inertia·v + rail friction(v) + timestep·load(v) ∋ rhs is solved exactly. Its left
    side grows with v and is linear between the points where rail or rod begin to slide.

    Parameters
    ----------
    rhs
        Momentum without the rod's force, Ns.
    inertia
        Inertia with implicit damping, kg.
    timestep
        Length of the step, s.
    rail
        Limits of the rail's friction impulse against positive and negative v, Ns.
    free
        Velocity of the plate without load, m/s.
    share
        Velocity of the plate per newton of load, m/(Ns), above 0.
    force
        Motor force without friction, N.
    viscous
        Viscous friction of the motor, Ns/m.
    forward, backward
        Limits of the motor's dry friction against positive and negative plate − v, N.

    Returns
    -------
    tuple
        Velocity v, m/s, and load, N.
    """
    # At rest, does the rail hold the carriage?
    still = (
        timestep
        * rod_load(
            v=0.0,
            free=free,
            share=share,
            force=force,
            viscous=viscous,
            forward=forward,
            backward=backward,
        )
        - rhs
    )
    if still + rail[0] < 0.0:
        momentum = rhs - rail[0]
    elif still - rail[1] > 0.0:
        momentum = rhs + rail[1]
    else:
        return 0.0, rod_load(
            v=0.0,
            free=free,
            share=share,
            force=force,
            viscous=viscous,
            forward=forward,
            backward=backward,
        )
    v = solve_sliding(
        momentum=momentum,
        inertia=inertia,
        timestep=timestep,
        free=free,
        share=share,
        force=force,
        viscous=viscous,
        forward=forward,
        backward=backward,
    )
    return v, rod_load(
        v=v,
        free=free,
        share=share,
        force=force,
        viscous=viscous,
        forward=forward,
        backward=backward,
    )
