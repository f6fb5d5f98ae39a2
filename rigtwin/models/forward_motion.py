"""Forward dynamics of coupled joints: some pushed by forces, some with prescribed motion. Compiled.

The equation of motion of the coordinates q (Featherstone, Rigid Body Dynamics Algorithms, 2008):

    M(q)·q'' + c(q, q') = τ_actuators + τ_disturbance − Σ_g a_g·f_g(a_g·q, a_g·q')

with the inertia matrix M, the bias c (gravity, Coriolis and centrifugal forces), and the guides'
forces f_g along their directions a_g.

The scheme is that of one joint (`joint_motion`): positions at the steps, velocities midway between
them. Viscous forces act at the mean of two velocities. Dry friction acts through a backlash and a
spring in series with it, and is implicit (`coupled_friction`).

`advance` takes one step after another; each of its parts is a function that stands above it, in the
order in which they run.
"""

from __future__ import annotations

import numpy as np

from rigtwin.components.dry_friction import slide
from rigtwin.components.guide_force import damping
from rigtwin.models.bodies import Bodies, find_terms
from rigtwin.models.coupled_friction import rub
from rigtwin.models.forward_arrays import GuideContacts, Pushers, State, StepInputs, WorkSpace
from rigtwin.models.forward_forces import push_coordinates, resist_explicitly
from rigtwin.models.forward_play import turn_rotors
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.cholesky import factor, solve
from rigtwin.numerics.compiling import loop_kernel, part_kernel


@part_kernel
def assemble(
    contacts: GuideContacts,
    pushers: Pushers,
    free: np.ndarray,
    held: np.ndarray,
    h: float,
    work: WorkSpace,
) -> None:
    """Add the damping of guides and actuators to the linear system of the free coordinates.

    A damper d along a, with the implicit share w, adds h·w·d·a_f·a_fᵀ to the matrix. On the right
    side it leaves −h·w·d·a_f·(a_p·v_p⁺), with the known velocities v_p⁺ of prescribed coordinates.
    """
    loose = len(free)
    for g in range(len(contacts.springs)):
        prescribed = 0.0
        for k in range(len(held)):
            prescribed += contacts.along[g, held[k]] * work.ahead_speed[held[k]]
        weight = work.implicit[g] * work.damped[g]
        for a in range(loose):
            along = contacts.along[g, free[a]]
            # Most guides act on one coordinate.
            if along == 0.0:
                continue
            work.right[a] += h * along * (work.guide_force[g] - weight * prescribed)
            for b in range(loose):
                work.system[a, b] += h * weight * along * contacts.along[g, free[b]]
        work.unrubbed[g] = prescribed
    for g in range(len(pushers.laws)):
        weight, prescribed = work.weights[g] * work.held_by[g], 0.0
        for k in range(len(held)):
            prescribed += pushers.levers[g, held[k]] * work.ahead_speed[held[k]]
        for a in range(loose):
            along = pushers.levers[g, free[a]]
            work.right[a] -= h * along * weight * prescribed
            for b in range(loose):
                work.system[a, b] += h * weight * along * pushers.levers[g, free[b]]


@part_kernel
def accelerate(
    inputs: StepInputs,
    free: np.ndarray,
    held: np.ndarray,
    state: State,
    tick: int,
    h: float,
    work: WorkSpace,
) -> None:
    """Write the undamped linear system of the free coordinates f.

    M_ff·v⁺ = M_ff·v − M_fp·(v_p⁺ − v_p) + h·(forces − bias), with the prescribed coordinates p.
    """
    loose = len(free)
    for a in range(loose):
        i = free[a]
        work.right[a] = h * (work.pushed[i] + inputs.disturbance[i, tick] - work.bias[i])
        for b in range(loose):
            work.system[a, b] = work.inertia[i, free[b]]
            work.right[a] += work.inertia[i, free[b]] * state.speed[free[b]]
        for k in range(len(held)):
            j = held[k]
            work.right[a] -= work.inertia[i, j] * (work.ahead_speed[j] - state.speed[j])


@part_kernel
def update_guides(contacts: GuideContacts, state: State, h: float, work: WorkSpace) -> None:
    """Update the internal states of the guides, and complete their forces, at the new velocity."""
    for g in range(len(contacts.springs)):
        if work.mounted[g] or not contacts.acts[g]:
            continue
        guide = contacts.guides[g]
        ahead, rate, implicit = 0.0, work.rate[g], work.implicit[g]
        for i in range(len(work.ahead_speed)):
            ahead += contacts.along[g, i] * work.ahead_speed[i]
        share = h / (guide.relaxation + h)
        between = implicit * ahead + (1.0 - implicit) * rate
        work.guide_force[g] -= implicit * work.damped[g] * ahead + work.dry[g]
        state.viscous[g] += share * (damping(guide, rate) * between - state.viscous[g])
        if contacts.rubs[g]:
            _, by = slide(
                work.place[g] + h * ahead - state.slider[g],
                0.5 * guide.backlash,
                contacts.springs[g],
                work.forward[g],
                work.backward[g],
            )
            state.slider[g] += by


@part_kernel
def required_force(
    contacts: GuideContacts,
    inputs: StepInputs,
    state: State,
    i: int,
    tick: int,
    h: float,
    work: WorkSpace,
) -> float:
    """Return the force that the prescribed coordinate `i` requires, N, by inverse dynamics."""
    size, pushers = len(work.pushed), inputs.pushers
    force = work.bias[i] - inputs.disturbance[i, tick]
    for j in range(size):
        force += work.inertia[i, j] * (work.ahead_speed[j] - state.speed[j]) / h
    for g in range(len(contacts.springs)):
        force -= contacts.along[g, i] * work.guide_force[g]
    for g in range(len(pushers.laws)):
        ahead = 0.0
        for j in range(size):
            ahead += pushers.levers[g, j] * work.ahead_speed[j]
        force += pushers.levers[g, i] * work.weights[g] * work.held_by[g] * ahead
    return force - work.pushed[i]


@loop_kernel
def advance(
    bodies: Bodies,
    contacts: GuideContacts,
    free: np.ndarray,
    held: np.ndarray,
    state: State,
    inputs: StepInputs,
    work: WorkSpace,
    h: float,
    steps: int,
    first: int,
    last: int,
    out: Array,
) -> None:
    """Integrate the machine from one tick to another.

    Parameters
    ----------
    bodies
        Rigid bodies, which give inertia matrix and bias.
    contacts
        Guides, which resist the motion.
    free, held
        Indices of the free coordinates and of the prescribed ones.
    state
        State at the first tick; overwritten with the state at the last.
    inputs
        Prescribed motions, actuator forces and disturbances.
    work
        Work space of the machine, overwritten.
    h
        Integration step, s.
    steps
        Integration steps per tick.
    first, last
        First tick, and the tick after the last.
    out
        Positions, velocities and forces, written, shape (3, coordinates, ticks). The force is the
        one required at a prescribed coordinate, and the actuators' force at a free one.
    """
    size, loose = len(state.place), len(free)
    for tick in range(first, last):
        for step in range(steps):
            number = tick * steps + step
            # Velocities are known at midsteps and extrapolated to the step, so that Coriolis forces
            # are second order in h.
            for i in range(size):
                work.midspeed[i] = state.speed[i] + 0.5 * (state.speed[i] - state.before[i])
                work.pushed[i] = work.transmitted[i] = work.earlier_push[i] = 0.0
            # M(q) and c(q, q'), by MuJoCo where they change with the state.
            find_terms(bodies, state.place, work.midspeed, work.inertia, work.bias)
            push_coordinates(inputs.pushers, state, number, h, work)
            if step == 0:
                for i in range(size):
                    out[0, i, tick], out[1, i, tick] = state.place[i], state.speed[i]
                    out[2, i, tick] = work.earlier_push[i]
            for k in range(len(held)):
                # The velocity of a prescribed coordinate is known before the step.
                moved = inputs.prescribed[held[k], number + 1] - inputs.prescribed[held[k], number]
                work.ahead_speed[held[k]] = moved / h
            resist_explicitly(contacts, inputs, state, tick, h, work)
            accelerate(inputs, free, held, state, tick, h, work)
            assemble(contacts, inputs.pushers, free, held, h, work)
            # The matrix is symmetric and positive definite: an inertia matrix, with damping added.
            factor(work.system, loose)
            solve(work.system, loose, work.right)
            # `right` now holds the velocities without dry friction, which `rub` takes off.
            rub(contacts, free, state, h, work)
            for a in range(loose):
                work.ahead_speed[free[a]] = work.right[a]
            update_guides(contacts, state, h, work)
            turn_rotors(inputs.pushers, state, h, work)
            if step == 0:
                for k in range(len(held)):
                    # Inverse dynamics, once per tick, as sensors are read at ticks alone.
                    force = required_force(contacts, inputs, state, held[k], tick, h, work)
                    out[2, held[k], tick] = force
            for i in range(size):
                state.before[i] = state.speed[i]
                state.speed[i] = work.ahead_speed[i]
                state.place[i] += h * work.ahead_speed[i]
            # Set prescribed positions exactly, or rounding would add up over the test.
            for k in range(len(held)):
                state.place[held[k]] = inputs.prescribed[held[k], number + 1]
