"""Force that a prescribed motion of one joint requires. Compiled.

The equation of motion is that of `joint_motion`, with the motion given and the force sought.
Nothing is integrated but the friction elements, whose state follows from the motion alone.
"""

from __future__ import annotations

from rigtwin.components import Guide
from rigtwin.components.guide import Friction, damping, dry_limits, position_force, slide
from rigtwin.components.mount import give_way
from rigtwin.models.joint_motion import Inertia, gravity
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


@kernel
def resist(
    guide: Guide,
    dry_friction: Friction,
    spring: float,
    rest: float,
    period: float,
    motion: Array,
    out: Array,
) -> None:
    """Add a guide's forces to the load that it transmits, for a prescribed motion.

    Parameters
    ----------
    guide, dry_friction
        Guide that resists the motion, and its dry friction.
    spring
        Stiffness in series with the dry friction, N/m.
    rest
        Position at which the guide's own spring is slack, m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Transmitted load, N, shape (ticks,); overwritten with the whole force.
    """
    # At the start the friction spring is slack, as after a long rest.
    slider, viscous = motion[0, 0], 0.0
    share = period / (guide.relaxation + period)
    if guide.mount_compliance > 0.0:
        inner = motion[0, 0]
        speed = 0.0
        for tick in range(motion.shape[1]):
            place, slider, viscous, force = give_way(
                guide=guide,
                dry_friction=dry_friction,
                spring=spring,
                rest=rest,
                share=share,
                period=period,
                inner=inner,
                speed=speed,
                slider=slider,
                viscous=viscous,
                load=out[tick],
                outer=motion[0, tick],
            )
            speed, inner = (place - inner) / period, place
            out[tick] += force
        return
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        # Load-dependent friction sees inertia, gravity and spring, but not friction itself.
        transmitted = out[tick] + position_force(guide, x, rest)
        forward, backward = dry_limits(dry_friction, v, transmitted)
        dry, by = slide(x - slider, 0.5 * guide.backlash, spring, forward, backward)
        slider += by
        viscous += share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + guide.drag * v * abs(v)


@kernel
def resist_at_once(
    guide: Guide, dry_friction: Friction, rest: float, period: float, motion: Array, out: Array
) -> None:
    """Add a guide's forces to its load where dry friction has neither backlash nor spring.

    The velocity is known, so dry friction follows its sign and reverses in the same tick.

    Parameters
    ----------
    guide, dry_friction
        Guide that resists the motion, and its dry friction.
    rest
        Position at which the guide's own spring is slack, m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Transmitted load, N, shape (ticks,); overwritten with the whole force.
    """
    viscous, share = 0.0, period / (guide.relaxation + period)
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        transmitted = out[tick] + position_force(guide, x, rest)
        forward, backward = dry_limits(dry_friction, v, transmitted)
        dry = forward if v > 0.0 else (-backward if v < 0.0 else 0.0)
        viscous += share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + guide.drag * v * abs(v)


@kernel
def inverse_dynamics(
    guide: Guide,
    dry_friction: Friction,
    inertia: Inertia,
    spring: float,
    period: float,
    motion: Array,
    out: Array,
) -> None:
    """Compute the force that moves the joint as prescribed: m·x'' + g(x) + guide's forces.

    Parameters
    ----------
    guide, dry_friction, inertia
        Guide with its dry friction, and inertia of the joint.
    spring
        Stiffness in series with the dry friction, N/m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Force, written, N, shape (ticks,).
    """
    for tick in range(motion.shape[1]):
        x, a = motion[0, tick], motion[2, tick]
        out[tick] = inertia.mass * a + gravity(inertia, x)
    resist(
        guide=guide,
        dry_friction=dry_friction,
        spring=spring,
        rest=inertia.rest,
        period=period,
        motion=motion,
        out=out,
    )
