"""Force that a prescribed motion of one joint requires. Compiled.

The equation of motion is that of `joint_motion`, with the motion given and the force sought.
Nothing is integrated but the friction elements, whose state follows from the motion alone.
"""

from __future__ import annotations

from rigtwin.components.dry_friction import dry_limits, slide
from rigtwin.components.guide import Guide
from rigtwin.components.guide_force import damping, position_force, quick_damping
from rigtwin.components.guide_step import GuideStep
from rigtwin.components.mount import MountState, give_way
from rigtwin.models.joint_motion import Inertia, gravity
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


@kernel
def soften(guide: Guide, v: float, acceleration: float, forward: float, backward: float) -> float:
    """Return the dry friction that MuJoCo simulates, which is soft and reverses early.

    Parameters
    ----------
    guide
        Guide with `soft_time` T and `soft_speed` RT, with R the constraint's regularisation.
    v, acceleration
        Velocity and acceleration, m/s and m/s².
    forward, backward
        Limits of dry friction for positive and negative velocity, N.

    Returns
    -------
    float
        Friction (v + T·v')/(R·T) within its limits, N.
    """
    force = (v + guide.soft_time * acceleration) / guide.soft_speed
    return min(max(force, -backward), forward)


@kernel
def resist(guide_step: GuideStep, motion: Array, out: Array) -> None:
    """Add a guide's forces to the load that it transmits, for a prescribed motion.

    Parameters
    ----------
    guide_step
        Guide that resists the motion, for steps of one tick.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Transmitted load, N, shape (ticks,); overwritten with the whole force.
    """
    guide = guide_step.guide
    # At the start the friction spring is slack, as after a long rest.
    slider, viscous = motion[0, 0], 0.0
    if guide.mount_compliance > 0.0:
        state = MountState(slider, 0.0, slider, viscous)
        for tick in range(motion.shape[1]):
            state, force = give_way(guide_step, state, out[tick], motion[0, tick])
            out[tick] += force
        return
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        # Load-dependent friction sees inertia, gravity and spring, but not friction itself.
        transmitted = out[tick] + position_force(guide, x, guide_step.rest)
        forward, backward = dry_limits(guide_step.dry_friction, v, transmitted)
        half = 0.5 * guide.backlash
        dry, by = slide(x - slider, half, guide_step.spring, forward, backward)
        slider += by
        if guide.softness != 0.0 and guide.soft_speed > 0.0:
            dry += guide.softness * (soften(guide, v, motion[2, tick], forward, backward) - dry)
        viscous += guide_step.share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + quick_damping(guide, x, v) * v


@kernel
def resist_at_once(guide_step: GuideStep, motion: Array, out: Array) -> None:
    """Add a guide's forces to its load where dry friction has neither backlash nor spring.

    The velocity is known, so dry friction follows its sign and reverses in the same tick.
    Parameters are those of `resist`.
    """
    guide, viscous = guide_step.guide, 0.0
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        transmitted = out[tick] + position_force(guide, x, guide_step.rest)
        forward, backward = dry_limits(guide_step.dry_friction, v, transmitted)
        dry = forward if v > 0.0 else (-backward if v < 0.0 else 0.0)
        if guide.softness != 0.0 and guide.soft_speed > 0.0:
            dry += guide.softness * (soften(guide, v, motion[2, tick], forward, backward) - dry)
        viscous += guide_step.share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + quick_damping(guide, x, v) * v


@kernel
def inverse_dynamics(guide_step: GuideStep, inertia: Inertia, motion: Array, out: Array) -> None:
    """Compute the force that moves the joint as prescribed: m·x'' + g(x) + guide's forces.

    Parameters
    ----------
    guide_step, inertia
        Guide of the joint, for steps of one tick, and inertia of the joint.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Force, written, N, shape (ticks,).
    """
    for tick in range(motion.shape[1]):
        x, a = motion[0, tick], motion[2, tick]
        out[tick] = inertia.mass * a + gravity(inertia, x)
    resist(guide_step, motion, out)
