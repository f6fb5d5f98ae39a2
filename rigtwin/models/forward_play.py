"""Play between a motor and a joint that is coupled to others. Compiled.

The law is that of a single joint (`joint_step`): rotor and joint are two masses whose distance is
free within ± half the play. Beyond it, by a length b, the contact's force is b/s + c·db/dt, with
the compliance s and the damping c of the contact. The rotor's equation is solved for its velocity
in terms of the joint's, so that the contact acts on the joint as a constant force and a damper.
Both are implicit, and a contact that is stiff for the step stays stable.
"""

from __future__ import annotations

import math

from rigtwin.components.servo import Play
from rigtwin.models.forward_arrays import Pushers, State, WorkSpace
from rigtwin.models.joint_step import CONTACT_DAMPING, shrink
from rigtwin.numerics.compiling import part_kernel

STIFFEST = 0.01
"""Smallest compliance of a contact, as a share of the response h²/m of its masses to a force."""


@part_kernel
def press(
    play: Play,
    mass: float,
    a: int,
    at: float,
    rate: float,
    pushed: float,
    held_by: float,
    h: float,
    state: State,
    work: WorkSpace,
) -> tuple[float, float]:
    """Return the force of a motor's rotor on its joint, and the damping of the joint by it.

    Parameters
    ----------
    play
        Play between rotor and joint.
    mass
        Inertia of joint and rotor together, kg.
    a
        Index of the actuator.
    at, rate
        Position and velocity of the joint along the actuator, m and m/s.
    pushed, held_by
        Force of the actuator on its rotor without damping, N, and its damping, Ns/m.
    h
        Integration step, s.
    state, work
        State of the machine, and its work space, in which the response of the rotor is written.

    Returns
    -------
    tuple
        Force at zero velocity of the joint, N, and damping of that velocity, Ns/m.
    """
    turning = play.rotor_share * mass
    carried = mass - turning
    place, spin = state.rotor[a], state.spin[a]
    heavy = turning + h * held_by
    freely = shrink((turning * spin + h * pushed) / heavy, h * play.rotor_friction / heavy)
    distance = place - at
    ahead = distance + h * (freely - rate)
    if abs(ahead) <= play.half:
        work.turning[a], work.dragged[a] = freely, 0.0
        return 0.0, 0.0
    reduced = turning * carried / mass
    stiffness = 1.0 / max(play.compliance, STIFFEST * h * h / reduced)
    grip = h * stiffness + 2.0 * CONTACT_DAMPING * math.sqrt(stiffness * reduced)
    pressed = stiffness * (distance - math.copysign(play.half, ahead))
    total = heavy + h * grip
    share = h * grip / total
    driven = (turning * spin + h * (pushed - pressed)) / total
    # The direction of the rotor's friction is that of its velocity if the joint's stayed the same.
    coming = driven + share * rate
    driven += shrink(coming, h * play.rotor_friction / total) - coming
    work.turning[a], work.dragged[a] = driven, share
    return pressed + grip * driven, grip * (1.0 - share)


@part_kernel
def turn_rotors(pushers: Pushers, state: State, h: float, work: WorkSpace) -> None:
    """Move the rotors behind a play, at the new velocities of the joints."""
    for a in range(len(pushers.laws)):
        ahead = 0.0
        for i in range(len(work.ahead_speed)):
            ahead += pushers.levers[a, i] * work.ahead_speed[i]
        state.spin[a] = work.turning[a] + work.dragged[a] * ahead
        state.rotor[a] += h * state.spin[a]
