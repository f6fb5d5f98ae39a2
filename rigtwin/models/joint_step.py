"""One step of a joint that a force pushes, with its dry friction implicit. Compiled.

Between motor and joint there may be a play. The motor's rotor and the joint then are two masses
whose distance, rotor minus joint, is free within ± half the play. Beyond it, by a length b, the
gear is a spring and damper that can only push [Nordin, Gutman, Automatica 38 (2002) 1633]:

    λ = max(b/s + c·db/dt, 0),  c = 2·ζ·√(m/s),  1/m = 1/rotor + 1/joint

with the compliance s. Without compliance a contact is rigid and inelastic.
"""

from __future__ import annotations

import math

from controllers.compiled import compilable
from rigtwin.components.dry_friction import dry_limits, slide
from rigtwin.components.guide_force import damping, position_force, quick_damping
from rigtwin.components.guide_step import GuideStep
from rigtwin.components.servo import Play
from rigtwin.numerics.compiling import part_kernel

CORRECTIONS = 4
"""Number of times that a contact force is corrected. One suffices without dry friction: only what
sticks moves less than its inertia says."""


CONTACT_DAMPING = 0.25
"""Damping ratio ζ of a compliant contact: gears and belts that hit a stop rebound little."""


@part_kernel
def step_joint(
    guide_step: GuideStep,
    mass: float,
    state: tuple[float, float, float, float],
    pushed: float,
    held_by: float,
    outer: float,
) -> tuple[float, float, float, float]:
    """Advance a joint whose guide has a rigid mount by one step.

    Parameters
    ----------
    guide_step
        Guide of the joint, for the integration step.
    mass
        Inertia of the joint, kg.
    state
        Position, m, velocity, m/s, position of the friction element, m, and viscous force, N.
    pushed, held_by
        Actuator's force without damping, N, and its damping, Ns/m.
    outer
        All forces but the guide's and the damping's: actuator, disturbance and gravity, N.

    Returns
    -------
    tuple
        State after the step.
    """
    guide, spring, (x, v, slider, viscous) = guide_step.guide, guide_step.spring, state
    h, share, half = guide_step.step, guide_step.share, 0.5 * guide.backlash
    coefficient = damping(guide, v)
    load = outer - position_force(guide, x, guide_step.rest) - (1.0 - share) * viscous
    damped = h * (share * coefficient + quick_damping(guide, x, v) + held_by)
    # Implicit share of the damping: the midpoint rule's ½ until d·h = 2m, where it would start to
    # oscillate, and more beyond.
    ahead = 1.0 - mass / damped if damped > 2.0 * mass else 0.5
    total = mass + ahead * damped
    rhs = (mass - (1.0 - ahead) * damped) * v + h * load
    forward, backward = dry_limits(guide_step.dry_friction, v, pushed - held_by * v)
    # Without dry friction; then with a stretched spring; then with a slider that slides.
    velocity = rhs / total
    stretch_length = x + h * velocity - slider
    if stretch_length > half or stretch_length < -half:
        edge = math.copysign(half, stretch_length)
        velocity = (rhs - h * spring * (x - slider - edge)) / (total + h * h * spring)
        dry, by = slide(x + h * velocity - slider, half, spring, forward, backward)
        if by != 0.0:
            velocity = (rhs - h * dry) / total
            slider = x + h * velocity - edge - dry / spring
    between = ahead * velocity + (1.0 - ahead) * v
    viscous += share * (coefficient * between - viscous)
    return x + h * velocity, velocity, slider, viscous


@compilable
def shrink(speed: float, most: float) -> float:
    """Return a speed reduced by dry friction by at most `most`, never beyond zero."""
    return math.copysign(max(abs(speed) - most, 0.0), speed)


@compilable
def step_behind_play(
    guide_step: GuideStep,
    play: Play,
    mass: float,
    rotor: tuple[float, float],
    state: tuple[float, float, float, float],
    forces: tuple[float, float, float],
) -> tuple[tuple[float, float], tuple[float, float, float, float]]:
    """Advance a joint whose motor acts through a play by one step.

    Parameters
    ----------
    guide_step
        Guide that resists the motion of the joint.
    play
        Play between motor and joint.
    mass
        Inertia of joint and rotor together, kg.
    rotor
        Position and velocity of the rotor, seen from the joint, m and m/s.
    state
        State of the joint, as in `step_joint`.
    forces
        Actuator's force without damping, N, its damping, Ns/m, and all other forces on the joint
        but the guide's, N.

    Returns
    -------
    tuple
        Position and velocity of the rotor, and state of the joint, after the step.
    """
    h, (pushed, held_by, outer) = guide_step.step, forces
    turning = play.rotor_share * mass
    carried = mass - turning
    # The damping of the servo is implicit, as if it added to the rotor's inertia.
    heavy = turning + h * held_by
    freely = (turning * rotor[1] + h * pushed) / heavy
    rubbing = h * play.rotor_friction / heavy
    driven = pushed - held_by * rotor[1]
    moved = step_joint(guide_step, carried, state, driven, 0.0, outer)
    speed, contact = shrink(freely, rubbing), 0.0
    distance = rotor[0] + h * speed - moved[0]
    if abs(distance) > play.half:
        side = math.copysign(1.0, distance)
        before = side * (rotor[0] - state[0]) - play.half
        # Both masses give way to the contact's force in inverse proportion to their inertia.
        yielding = h * h * (1.0 / heavy + 1.0 / carried)
        # The contact's law times s, which is also defined for s = 0: s·λ = b + s·c·db/dt.
        soft = play.compliance
        relaxed = 2.0 * CONTACT_DAMPING * math.sqrt(soft * turning * carried / mass) / h
        for _ in range(CORRECTIONS):
            beyond = side * distance - play.half
            excess = beyond + relaxed * (beyond - before) - soft * contact
            contact = max(contact + excess / (soft + (1.0 + relaxed) * yielding), 0.0)
            speed = shrink(freely - h * side * contact / heavy, rubbing)
            moved = step_joint(guide_step, carried, state, driven, 0.0, outer + side * contact)
            distance = rotor[0] + h * speed - moved[0]
    return (rotor[0] + h * speed, speed), moved
