"""Forces on the joints of a machine within one step."""

from __future__ import annotations

import math

from rigtwin.components import Guide
from rigtwin.components.dry_friction import dry_limits
from rigtwin.components.guide_force import damping, position_force, quick_damping
from rigtwin.components.guide_step import GuideStep
from rigtwin.components.mount import MountState, give_way
from rigtwin.components.servo import pull, push
from rigtwin.models.forward_arrays import GuideContacts, Pushers, State, StepInputs, WorkSpace
from rigtwin.models.forward_play import press
from rigtwin.models.joint_motion import SHORTEST
from rigtwin.numerics.compiling import part_kernel


@part_kernel
def push_coordinates(
    pushers: Pushers, state: State, number: int, h: float, work: WorkSpace
) -> None:
    """Add the actuators' forces over step `number`, but for the implicit share of their damping.

    The sensors at this step see the force of the command held before it; the step from here is
    driven by the mean of both commands.
    """
    size = len(work.pushed)
    for a in range(len(pushers.laws)):
        law = pushers.laws[a]
        position_at, rate_mid, rate_now = pushers.zero[a], 0.0, 0.0
        for i in range(size):
            position_at += pushers.levers[a, i] * state.place[i]
            rate_mid += pushers.levers[a, i] * work.midspeed[i]
            rate_now += pushers.levers[a, i] * state.speed[i]
        play, at, turning = pushers.plays[a], position_at, rate_now
        if play.half > 0.0:
            # The motor moves its rotor, which a play separates from the joint.
            at, rate_mid, turning = state.rotor[a], state.spin[a], state.spin[a]
        earlier = pushers.commands[a, max(number - 1, 0)]
        now = 0.5 * (earlier + pushers.commands[a, number])
        force, held_by = pull(law, now, at), law.damping_gain
        if abs(force - held_by * turning) > law.limit:
            # At its limit a servo damps nothing.
            force = math.copysign(law.limit, force - held_by * turning)
            held_by = 0.0
        before = push(law, earlier, at, rate_mid)
        # Midpoint rule, or more implicit where the damping would make that oscillate.
        weight, mass = 0.5, pushers.inertia[a]
        if play.half > 0.0:
            force, held_by = press(
                play, mass, a, position_at, rate_now, force, held_by, h, state, work
            )
            weight = 1.0
        elif held_by > 0.0:
            weight = max(0.5, 1.0 - mass / h / held_by)
        force -= (1.0 - weight) * held_by * rate_now
        work.held_by[a], work.weights[a] = held_by, weight
        whole = force - weight * held_by * rate_now
        for i in range(size):
            work.pushed[i] += pushers.levers[a, i] * force
            work.transmitted[i] += pushers.levers[a, i] * whole
            work.earlier_push[i] += pushers.levers[a, i] * before


@part_kernel
def hold_back(
    contacts: GuideContacts, g: int, guide: Guide, load: float, h: float, state: State, place: float
) -> float:
    """Move guide `g` behind its compliant mount, and return its force on the machine, N.

    The mount decouples the guide: its force follows from the position alone, and is explicit.
    """
    share, dry = h / (guide.relaxation + h), contacts.dry[g]
    guide_step = GuideStep(guide, dry, contacts.springs[g], contacts.rests[g], h, share)
    before = MountState(state.inner[g], state.within[g], state.slider[g], state.viscous[g])
    after, force = give_way(guide_step, before, load, place)
    state.inner[g], state.within[g] = after.inner, after.speed
    state.slider[g], state.viscous[g] = after.slider, after.viscous
    return force


@part_kernel
def resist_explicitly(
    contacts: GuideContacts, inputs: StepInputs, state: State, tick: int, h: float, work: WorkSpace
) -> None:
    """Find the part of the guides' forces that does not depend on the coming velocity."""
    for g in range(len(contacts.springs)):
        work.guide_force[g] = inputs.guide_disturbance[g, tick]
        work.damped[g] = work.implicit[g] = 0.0
        if not contacts.acts[g]:
            continue
        guide = contacts.guides[g]
        place, rate, load, along_squared = contacts.zero[g], 0.0, 0.0, 0.0
        for i in range(len(work.pushed)):
            along = contacts.along[g, i]
            place += along * state.place[i]
            rate += along * state.speed[i]
            load += along * work.transmitted[i]
            along_squared += along * along
        work.place[g], work.rate[g] = place, rate
        # Force per unit of the guide's own coordinate, for load-dependent friction.
        load /= along_squared
        work.mounted[g] = guide.mount_compliance * contacts.inertia[g] > SHORTEST * h * h
        if work.mounted[g]:
            work.guide_force[g] -= hold_back(contacts, g, guide, load, h, state, place)
            continue
        share = h / (guide.relaxation + h)
        damped = share * damping(guide, rate) + quick_damping(guide, place, rate)
        mass = contacts.inertia[g] / h
        implicit = max(0.5, 1.0 - mass / damped) if damped > 0.0 else 0.5
        work.damped[g], work.implicit[g] = damped, implicit
        work.guide_force[g] -= position_force(guide, place, contacts.rests[g])
        work.guide_force[g] -= (1.0 - share) * state.viscous[g]
        work.guide_force[g] -= (1.0 - implicit) * damped * rate
        friction = contacts.dry[g]
        work.forward[g], work.backward[g] = dry_limits(friction, rate, load)
