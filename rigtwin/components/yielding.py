"""A plate that yields to its load: its displacement follows compliance·load at once, or through a
lag of first order.

Load and displacement depend on each other within one timestep: a plate that gives way slides
against the rod, and which way it slides decides the friction that it is loaded with. Both are
solved together, so that a cylinder of any compliance stays stable at any timestep.
"""

from __future__ import annotations

from controllers.compiled import compilable
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.sensors import Lvdt, apply_sensor
from rigtwin.numerics.arrays import Array


def yield_to_load(cylinder: Cylinder, load: Array, period: float) -> Array:
    """Compute how far a plate yields to a load that is known.

    Parameters
    ----------
    cylinder
        Its compliance c, lag and zero load z: the displacement follows c·(load − z).
    load
        Load in N, shape (ticks,).
    period
        Time between ticks in s.

    Returns
    -------
    array
        Displacement in m, shape (ticks,).
    """
    behind = Lvdt(lag=cylinder.yield_lag)
    return cylinder.compliance * apply_sensor(behind, load - cylinder.zero_load, period)


@compilable
def share_of_load(compliance: float, lag: float, timestep: float) -> float:
    """The displacement's rate for each newton of load, m/(Ns), by the implicit Euler rule: y' =
    (compliance·load − y)/(lag + timestep)."""
    return compliance / (lag + timestep)


@compilable
def yielding_rate(share: float, load: float, yielded: float, lag: float, timestep: float) -> float:
    """How fast a plate yields, m/s.

    Parameters
    ----------
    share
        Of its compliance, m/(Ns); see `share_of_load`.
    load
        N.
    yielded
        How far it has yielded already, m.
    lag, timestep
        s.
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
    """What the rod loads a yielding plate with, N, at the carriage's velocity `v`.

    The plate moves with w = free + share·load; the load is force − viscous·(w − v) − dry friction
    of w − v. Parameters as in `solve_yielding`.
    """
    apart = free - v + share * force
    if apart > share * forward:
        return force - forward - viscous * (apart - share * forward) / (1.0 + share * viscous)
    if apart < -share * backward:
        return force + backward - viscous * (apart + share * backward) / (1.0 + share * viscous)
    return (v - free) / share


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
    """The carriage's velocity v and the load of a plate that yields to it.

    Solves inertia·v + rail friction + timestep·load(v) ∋ rhs exactly: the left side grows with v
    and is linear between the points where rail or rod begin to slide.

    Parameters
    ----------
    rhs, inertia
        Momentum Ns without the rod's force, and kg.
    timestep
        s.
    rail
        Impulses, Ns, that it can bear against positive and negative v.
    free
        The plate's velocity without load, m/s.
    share
        The plate's velocity for each newton of load, m/(Ns), above 0.
    force
        Of the motor without friction, N.
    viscous
        Of the motor, Ns/m.
    forward, backward
        What the motor's dry friction can bear against positive and negative plate − v, N.

    Returns
    -------
    tuple
        v in m/s, load in N.
    """
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
        left = rhs - rail[0]
    elif still - rail[1] > 0.0:
        left = rhs + rail[1]
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
    # Below `slow` the plate runs ahead of the carriage, above `fast` behind it, and in between the
    # rod sticks.
    slow, fast = free + share * (force - forward), free + share * (force + backward)
    slope = viscous / (1.0 + share * viscous)
    if inertia * slow + timestep * (force - forward) >= left:
        v = (left - timestep * (force - forward - slope * slow)) / (inertia + timestep * slope)
    elif inertia * fast + timestep * (force + backward) <= left:
        v = (left - timestep * (force + backward - slope * fast)) / (inertia + timestep * slope)
    else:
        v = (left + timestep * free / share) / (inertia + timestep / share)
    return v, rod_load(
        v=v,
        free=free,
        share=share,
        force=force,
        viscous=viscous,
        forward=forward,
        backward=backward,
    )
