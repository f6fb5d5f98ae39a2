"""Forward dynamics of coupled joints: some pushed by forces, some with prescribed motion. Compiled.

The equation of motion of the coordinates q (Featherstone, Rigid Body Dynamics Algorithms, 2008):

    M(q)·q'' + c(q, q') = τ_actuators + τ_disturbance − Σ_g a_g·f_g(a_g·q, a_g·q')

with the inertia matrix M, the bias c (gravity, Coriolis and centrifugal forces), and the guides'
forces f_g along their directions a_g.

The scheme is that of one joint (`joint_motion`): positions at the steps, velocities midway between
them. Viscous forces act at the mean of two velocities. Dry friction acts through a backlash and a
spring in series with it, and is implicit. Where several guides rub, their friction forces depend on
each other. They are solved by projected Gauss-Seidel (Jourdan, Alart and Jean, Computer Methods in
Applied Mechanics and Engineering 155, 1998).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from rigtwin.components import Guide
from rigtwin.components.guide import Friction, damping, dry_limits, position_force, slide
from rigtwin.components.mount import give_way
from rigtwin.components.servo import Push, pull, push
from rigtwin.models.joint_motion import SHORTEST
from rigtwin.models.multibody import Bodies, find_terms
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

SWEEPS, CONVERGED = 200, 1e-10
"""Maximum number of Gauss-Seidel sweeps. The sweeps end once no friction force changes by more than
this share of the largest friction limit."""
# Numba needs the lengths of tuples at compile time. `Friction.changing` is a flag, not a number.
GUIDE, NUMBERS = len(Guide._fields), len(Friction._fields) - 1
LAW = len(Push._fields)
BACKLASH = Guide._fields.index("backlash")


class GuideContacts(NamedTuple):
    """Guides of the machine as compiled code takes them, one row for each guide.

    A guide's position is `zero + along · q`, with the machine's coordinates q.
    """

    guides: Array  # Parameters of each `Guide`, shape (guides, parameters).
    dry: Array  # Parameters of each `Friction`, shape (guides, parameters).
    along: Array  # Direction of each guide in the coordinates, shape (guides, coordinates).
    zero: Array  # Position of each guide at zero coordinates, m, shape (guides,).
    springs: Array  # Stiffness in series with the dry friction, N/m, shape (guides,).
    rests: Array  # Position at which the guide's spring is slack, m, shape (guides,).
    inertia: Array  # Smallest inertia that the guide can feel, kg, shape (guides,).
    acts: np.ndarray  # Whether any parameter of the guide has an effect, shape (guides,).
    rubs: np.ndarray  # Whether the guide has dry friction, shape (guides,).


class State(NamedTuple):
    """State of the machine between two integration steps; `advance` overwrites the arrays."""

    place: Array  # Positions of the coordinates, m, shape (coordinates,).
    speed: Array  # Velocities of the coordinates, m/s, shape (coordinates,).
    before: Array  # Velocities one step earlier, m/s, shape (coordinates,).
    slider: Array  # Position of each guide's friction element, m, shape (guides,).
    viscous: Array  # Relaxing viscous force of each guide, N, shape (guides,).
    inner: Array  # Position of each guide behind its compliant mount, m, shape (guides,).
    within: Array  # Velocity of each guide behind its compliant mount, m/s, shape (guides,).


class Servos(NamedTuple):
    """Servos of the machine as compiled code takes them, one row for each servo."""

    laws: Array  # Fields of each `Push`, shape (servos, 5).
    levers: Array  # Direction of each servo in the coordinates, shape (servos, coordinates).
    zero: Array  # Position of each servo at zero coordinates, m, shape (servos,).
    inertia: Array  # Inertia that each servo moves, kg, shape (servos,).
    commands: Array  # Conditioned commands at the steps, shape (servos, steps).


class StepInputs(NamedTuple):
    """Inputs of the machine over one test.

    The number of steps is that of the whole test: ticks times steps per tick.
    """

    prescribed: Array  # Prescribed positions, m, shape (coordinates, steps + 1); else zero.
    pushes: Array  # Forces of the force actuators, N, shape (actuators, steps).
    levers: Array  # Direction of each force actuator, shape (actuators, coordinates).
    disturbance: Array  # Unmodelled force on each coordinate, N, shape (coordinates, ticks).
    guide_disturbance: Array  # Unmodelled force on each guide, N, shape (guides, ticks).
    servos: Servos  # Actuators whose force depends on their position.


@kernel
def guide_of(values: Array) -> Guide:
    """Return a guide from its parameters, shape (parameters,)."""
    return Guide(*to_fixed_tuple(values, GUIDE))  # type: ignore[call-arg]


@kernel
def friction_of(values: Array) -> Friction:
    """Return dry friction from its parameters, shape (parameters,)."""
    return Friction(values[0] > 0.0, *to_fixed_tuple(values[1:], NUMBERS))  # type: ignore[call-arg]


@kernel
def law_of(values: Array) -> Push:
    """Return a servo's law from its parameters, shape (5,)."""
    return Push(*to_fixed_tuple(values, LAW))  # type: ignore[call-arg]


@kernel
def factor(matrix: Array, size: int) -> None:
    """Replace a positive definite matrix by its Cholesky factor, below the diagonal."""
    # Written out, because `np.linalg.cholesky` would allocate its result in every step.
    for i in range(size):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            # Rounding can make the pivot of a nearly massless coordinate negative.
            matrix[i, j] = math.sqrt(max(value, 1e-300)) if i == j else value / matrix[j, j]


@kernel
def solve(factored: Array, size: int, right: Array) -> None:
    """Solve L·Lᵀ·x = right with a Cholesky factor L; x overwrites `right`, shape (size,)."""
    # Forward substitution with L, then backward substitution with Lᵀ.
    for i in range(size):
        for k in range(i):
            right[i] -= factored[i, k] * right[k]
        right[i] /= factored[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= factored[k, i] * right[k]
        right[i] /= factored[i, i]


@kernel
def bear(
    stretch: float,
    free: float,
    compliance: float,
    h: float,
    half: float,
    spring: float,
    forward: float,
    backward: float,
) -> float:
    """Return the dry friction of one guide over a step, with the friction of the others fixed.

    The friction is a spring of stiffness k behind a backlash b, limited to what the contact bears:
    F = k·(x⁺ − x_slider ∓ b/2) with x⁺ = x + h·(v_free − w·F), clipped to [−backward, forward].

    Parameters
    ----------
    stretch
        Distance from the friction element to the guide, m.
    free
        Velocity of the guide without this friction, m/s.
    compliance
        Velocity that 1 N of friction takes from the guide over the step (w), m/(s N).
    h
        Step, s.
    half
        Half the backlash, m.
    spring
        Stiffness in series with the friction, N/m.
    forward, backward
        Limits of the friction against positive and negative motion, N.

    Returns
    -------
    float
        Friction force, N.
    """
    unopposed = stretch + h * free
    if -half <= unopposed <= half:
        return 0.0
    stretched = unopposed - math.copysign(half, unopposed)
    # The friction shortens the spring that it stretches, hence the denominator.
    force = spring * stretched / (1.0 + h * spring * compliance)
    return min(max(force, -backward), forward)


@kernel
def advance(
    bodies: Bodies,
    contacts: GuideContacts,
    free: np.ndarray,
    held: np.ndarray,
    state: State,
    inputs: StepInputs,
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
    # One kernel on purpose: parts of their own would pass two dozen work arrays in every step,
    # which costs speed even in compiled code. The stages of a step are numbered instead.
    size, guides, loose = len(state.place), len(contacts.springs), len(free)
    inertia, bias = np.zeros((size, size)), np.zeros(size)
    system, right = np.zeros((loose, loose)), np.zeros(loose)
    column = np.zeros(loose)
    midspeed, ahead_speed = np.zeros(size), np.zeros(size)
    pushed, earlier_push = np.zeros(size), np.zeros(size)
    guide_force, damped, implicit = np.zeros(guides), np.zeros(guides), np.zeros(guides)
    place, rate = np.zeros(guides), np.zeros(guides)
    forward, backward, dry = np.zeros(guides), np.zeros(guides), np.zeros(guides)
    unrubbed, mounted = np.zeros(guides), np.zeros(guides, np.bool_)
    coupling = np.zeros((guides, guides))
    servos = len(inputs.servos.laws)
    held_by, weights = np.zeros(servos), np.zeros(servos)
    response = np.zeros((guides, loose))
    for tick in range(first, last):
        for step in range(steps):
            number = tick * steps + step
            # 1. Inertia and bias. Velocities are known at midsteps and extrapolated to the step, so
            # that Coriolis forces are second order in h.
            for i in range(size):
                midspeed[i] = state.speed[i] + 0.5 * (state.speed[i] - state.before[i])
                pushed[i] = earlier_push[i] = 0.0
            find_terms(bodies, state.place, midspeed, inertia, bias)
            # 2. Actuators. The sensors at this tick see the force of the command held before it;
            # the step from here is driven by the mean of both.
            for a in range(len(inputs.levers)):
                earlier = inputs.pushes[a, max(number - 1, 0)]
                now = 0.5 * (earlier + inputs.pushes[a, number])
                for i in range(size):
                    pushed[i] += inputs.levers[a, i] * now
                    earlier_push[i] += inputs.levers[a, i] * earlier
            for a in range(servos):
                law, position_at, rate_mid, rate_now = (
                    law_of(inputs.servos.laws[a]),
                    inputs.servos.zero[a],
                    0.0,
                    0.0,
                )
                for i in range(size):
                    position_at += inputs.servos.levers[a, i] * state.place[i]
                    rate_mid += inputs.servos.levers[a, i] * midspeed[i]
                    rate_now += inputs.servos.levers[a, i] * state.speed[i]
                earlier = inputs.servos.commands[a, max(number - 1, 0)]
                now = 0.5 * (earlier + inputs.servos.commands[a, number])
                force, held_by[a] = pull(law, now, position_at), law.damping_gain
                if abs(force - held_by[a] * rate_now) > law.limit:
                    # At its limit a servo damps nothing.
                    force = math.copysign(law.limit, force - held_by[a] * rate_now)
                    held_by[a] = 0.0
                # Midpoint rule, or more implicit where the damping would make that oscillate.
                weights[a] = 0.5
                if held_by[a] > 0.0:
                    mass = inputs.servos.inertia[a] / h
                    weights[a] = max(0.5, 1.0 - mass / held_by[a])
                force -= (1.0 - weights[a]) * held_by[a] * rate_now
                before = push(law, earlier, position_at, rate_mid)
                for i in range(size):
                    pushed[i] += inputs.servos.levers[a, i] * force
                    earlier_push[i] += inputs.servos.levers[a, i] * before
            if step == 0:
                for i in range(size):
                    out[0, i, tick], out[1, i, tick] = state.place[i], state.speed[i]
                    out[2, i, tick] = earlier_push[i]
            # 3. Prescribed coordinates have a known velocity.
            for k in range(len(held)):
                i = held[k]
                ahead_speed[i] = (
                    inputs.prescribed[i, number + 1] - inputs.prescribed[i, number]
                ) / h
            # 4. Guides: the part of their force that does not depend on the coming velocity.
            for g in range(guides):
                guide_force[g] = inputs.guide_disturbance[g, tick]
                damped[g] = implicit[g] = 0.0
                if not contacts.acts[g]:
                    continue
                guide = guide_of(contacts.guides[g])
                friction = friction_of(contacts.dry[g])
                place[g], rate[g], load, along_squared = contacts.zero[g], 0.0, 0.0, 0.0
                for i in range(size):
                    along = contacts.along[g, i]
                    place[g] += along * state.place[i]
                    rate[g] += along * state.speed[i]
                    load += along * pushed[i]
                    along_squared += along * along
                # Force per unit of the guide's own coordinate, for load-dependent friction.
                load /= along_squared
                share = h / (guide.relaxation + h)
                mounted[g] = guide.mount_compliance * contacts.inertia[g] > SHORTEST * h * h
                if mounted[g]:
                    inner, slider, viscous, force = give_way(
                        guide=guide,
                        dry_friction=friction,
                        spring=contacts.springs[g],
                        rest=contacts.rests[g],
                        share=share,
                        period=h,
                        inner=state.inner[g],
                        speed=state.within[g],
                        slider=state.slider[g],
                        viscous=state.viscous[g],
                        load=load,
                        outer=place[g],
                    )
                    # A compliant mount decouples the guide: its force follows from the position
                    # alone, and is explicit.
                    state.within[g] = (inner - state.inner[g]) / h
                    state.inner[g], state.slider[g], state.viscous[g] = inner, slider, viscous
                    guide_force[g] -= force
                    continue
                damped[g] = share * damping(guide, rate[g]) + guide.drag * abs(rate[g])
                mass = contacts.inertia[g] / h
                implicit[g] = max(0.5, 1.0 - mass / damped[g]) if damped[g] > 0.0 else 0.5
                guide_force[g] -= position_force(guide, place[g], contacts.rests[g])
                guide_force[g] -= (1.0 - share) * state.viscous[g]
                guide_force[g] -= (1.0 - implicit[g]) * damped[g] * rate[g]
                forward[g], backward[g] = dry_limits(friction, rate[g], load)
            # 5. Linear system of the free coordinates:
            # (M_ff + h Σ_g w_g d_g a_g a_gᵀ)·v⁺ = M_ff·v − M_fp·(v_p⁺ − v_p) + h·(forces − bias),
            # with damping d_g and its implicit share w_g.
            for a in range(loose):
                i = free[a]
                right[a] = h * (pushed[i] + inputs.disturbance[i, tick] - bias[i])
                for b in range(loose):
                    system[a, b] = inertia[i, free[b]]
                    right[a] += inertia[i, free[b]] * state.speed[free[b]]
                for k in range(len(held)):
                    j = held[k]
                    right[a] -= inertia[i, j] * (ahead_speed[j] - state.speed[j])
            for g in range(guides):
                prescribed = 0.0
                for k in range(len(held)):
                    prescribed += contacts.along[g, held[k]] * ahead_speed[held[k]]
                weight = implicit[g] * damped[g]
                for a in range(loose):
                    along = contacts.along[g, free[a]]
                    if along == 0.0:
                        continue
                    right[a] += h * along * (guide_force[g] - weight * prescribed)
                    for b in range(loose):
                        system[a, b] += h * weight * along * contacts.along[g, free[b]]
                unrubbed[g] = prescribed
            for g in range(servos):
                weight, prescribed = weights[g] * held_by[g], 0.0
                for k in range(len(held)):
                    prescribed += inputs.servos.levers[g, held[k]] * ahead_speed[held[k]]
                for a in range(loose):
                    along = inputs.servos.levers[g, free[a]]
                    right[a] -= h * along * weight * prescribed
                    for b in range(loose):
                        system[a, b] += h * weight * along * inputs.servos.levers[g, free[b]]
            factor(system, loose)
            solve(system, loose, right)
            # 6. Dry friction by projected Gauss-Seidel: coupling[i, j] is the velocity of guide i
            # caused by 1 N of friction at guide j over the step.
            largest = 0.0
            for g in range(guides):
                dry[g] = 0.0
                if mounted[g] or not contacts.rubs[g]:
                    continue
                largest = max(largest, forward[g], backward[g])
                for a in range(loose):
                    column[a] = h * contacts.along[g, free[a]]
                    unrubbed[g] += contacts.along[g, free[a]] * right[a]
                solve(system, loose, column)
                for a in range(loose):
                    response[g, a] = column[a]
                for second in range(guides):
                    coupling[second, g] = 0.0
                    for a in range(loose):
                        coupling[second, g] += contacts.along[second, free[a]] * column[a]
            for _ in range(SWEEPS):
                changed = 0.0
                for g in range(guides):
                    if mounted[g] or not contacts.rubs[g]:
                        continue
                    speed = unrubbed[g]
                    for second in range(guides):
                        if second != g:
                            speed -= coupling[g, second] * dry[second]
                    friction_force = bear(
                        stretch=place[g] - state.slider[g],
                        free=speed,
                        compliance=coupling[g, g],
                        h=h,
                        half=0.5 * contacts.guides[g, BACKLASH],
                        spring=contacts.springs[g],
                        forward=forward[g],
                        backward=backward[g],
                    )
                    changed = max(changed, abs(friction_force - dry[g]))
                    dry[g] = friction_force
                if changed <= CONVERGED * largest:
                    break
            for g in range(guides):
                if dry[g] != 0.0:
                    for a in range(loose):
                        right[a] -= response[g, a] * dry[g]
            # 7. Internal states of the guides at the new velocity.
            for a in range(loose):
                ahead_speed[free[a]] = right[a]
            for g in range(guides):
                if mounted[g] or not contacts.acts[g]:
                    continue
                guide = guide_of(contacts.guides[g])
                ahead = 0.0
                for i in range(size):
                    ahead += contacts.along[g, i] * ahead_speed[i]
                share = h / (guide.relaxation + h)
                between = implicit[g] * ahead + (1.0 - implicit[g]) * rate[g]
                guide_force[g] -= implicit[g] * damped[g] * ahead + dry[g]
                state.viscous[g] += share * (damping(guide, rate[g]) * between - state.viscous[g])
                if contacts.rubs[g]:
                    _, by = slide(
                        place[g] + h * ahead - state.slider[g],
                        0.5 * guide.backlash,
                        contacts.springs[g],
                        forward[g],
                        backward[g],
                    )
                    state.slider[g] += by
            # 8. Inverse dynamics of the prescribed coordinates, once per tick.
            if step == 0:
                for k in range(len(held)):
                    i = held[k]
                    force = bias[i] - inputs.disturbance[i, tick]
                    for j in range(size):
                        force += inertia[i, j] * (ahead_speed[j] - state.speed[j]) / h
                    for g in range(guides):
                        force -= contacts.along[g, i] * guide_force[g]
                    for g in range(servos):
                        ahead = 0.0
                        for j in range(size):
                            ahead += inputs.servos.levers[g, j] * ahead_speed[j]
                        force += inputs.servos.levers[g, i] * weights[g] * held_by[g] * ahead
                    out[2, i, tick] = force - pushed[i]
            for i in range(size):
                state.before[i] = state.speed[i]
                state.speed[i] = ahead_speed[i]
                state.place[i] += h * ahead_speed[i]
            # Set prescribed positions exactly, or rounding would add up over the test.
            for k in range(len(held)):
                state.place[held[k]] = inputs.prescribed[held[k], number + 1]
