"""The equations of motion of joints that act on each other: some pushed by forces, some moved as
prescribed. Compiled.

As for one joint (`guided`): positions are taken at the steps, velocities midway between them;
viscous forces are those of the mean of two velocities; dry friction acts through a play and a
spring in series with it and is implicit. Where several coordinates rub, what each bears depends on
the others: they take turns until nothing changes (projected Gauss-Seidel; Jourdan, Alart and Jean,
Computer Methods in Applied Mechanics and Engineering 155, 1998).
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

TURNS, SAME = 200, 1e-10
"""Times that coordinates take turns at most, and share of the largest dry force by which none may
change any more."""
GUIDE, NUMBERS = len(Guide._fields), len(Friction._fields) - 1
LAW = len(Push._fields)
BACKLASH = Guide._fields.index("backlash")


class Contacts(NamedTuple):
    """Whatever resists along coordinates of its own, a row each: guides, dry: their values, shape
    (guides, ...); along: how far each goes for a unit of the machine's coordinates, shape (guides,
    coordinates), from `zero`; springs: in series with dry friction, N/m; rests: where the guide's
    own spring is slack; inertia: that it feels, kg; acts: whether there is anything of it; rubs:
    whether there is dry friction."""

    guides: Array
    dry: Array
    along: Array
    zero: Array
    springs: Array
    rests: Array
    inertia: Array
    acts: np.ndarray
    rubs: np.ndarray


class State(NamedTuple):
    """place, speed, before: of the coordinates, and their speeds a step before; slider, viscous,
    inner, within: of the guides: where dry friction's spring begins, the lagging viscous force, and
    place and speed behind a yielding mount."""

    place: Array
    speed: Array
    before: Array
    slider: Array
    viscous: Array
    inner: Array
    within: Array


class Servos(NamedTuple):
    """laws: of each servo, shape (servos, 5), the fields of a Push; levers: how they act, shape
    (servos, coordinates), from `zero`; inertia: that each feels, kg; commands: as conditioned, at
    the steps, shape (servos, steps)."""

    laws: Array
    levers: Array
    zero: Array
    inertia: Array
    commands: Array


class StepInputs(NamedTuple):
    """prescribed: positions of the coordinates at the steps, shape (coordinates, steps + 1), of
    those that are; pushes, levers: of the actuators: N at the steps, shape (actuators, steps), and
    how they act, shape (actuators, coordinates); besides: another force on each coordinate, N,
    shape (coordinates, ticks); on: another force on each guide, shape (guides, ticks); servos: what
    pushes by where it is."""

    prescribed: Array
    pushes: Array
    levers: Array
    besides: Array
    on: Array
    servos: Servos


@kernel
def guide_of(values: Array) -> Guide:
    """A guide by its values, shape (parameters,)."""
    return Guide(*to_fixed_tuple(values, GUIDE))  # type: ignore[call-arg]


@kernel
def friction_of(values: Array) -> Friction:
    """Dry friction by its values, shape (parameters,)."""
    return Friction(values[0] > 0.0, *to_fixed_tuple(values[1:], NUMBERS))  # type: ignore[call-arg]


@kernel
def law_of(values: Array) -> Push:
    """A servo's law by its values, shape (5,)."""
    return Push(*to_fixed_tuple(values, LAW))  # type: ignore[call-arg]


@kernel
def factor(matrix: Array, size: int) -> None:
    """The Cholesky factor of a positive definite matrix, in its place below the diagonal."""
    for i in range(size):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(value, 1e-300)) if i == j else value / matrix[j, j]


@kernel
def solve(factored: Array, size: int, right: Array) -> None:
    """Solves with a Cholesky factor, in place of the right side, shape (size,)."""
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
    apart: float,
    free: float,
    yields: float,
    h: float,
    half: float,
    spring: float,
    forward: float,
    backward: float,
) -> float:
    """What dry friction bears over a step.

    Parameters
    ----------
    apart
        From its slider to its coordinate, m.
    free
        The coordinate's speed without it, m/s.
    yields
        By how much a N of it slows that down, m/s.
    h
        s, of the step.
    half, spring, forward, backward
        Half the play, m, the spring's stiffness, N/m, and its limits, N.

    Returns
    -------
    float
        N.
    """
    then = apart + h * free
    if -half <= then <= half:
        return 0.0
    stretched = then - math.copysign(half, then)
    force = spring * stretched / (1.0 + h * spring * yields)
    return min(max(force, -backward), forward)


@kernel
def advance(
    bodies: Bodies,
    contacts: Contacts,
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
    """The machine from one tick to another.

    Parameters
    ----------
    bodies
        What moves.
    contacts
        What resists.
    free, held
        Numbers of the coordinates that are pushed, and of those that are prescribed.
    state
        At the first tick; advanced.
    inputs
        What moves the machine.
    h, steps
        s, of a step, and steps a tick.
    first, last
        Ticks.
    out
        Positions, velocities, forces, shape (3, coordinates, ticks). Forces are what moves those
        that are prescribed, and what pushes the others.
    """
    size, guides, loose = len(state.place), len(contacts.springs), len(free)
    inertia, bias = np.zeros((size, size)), np.zeros(size)
    whole, right = np.zeros((loose, loose)), np.zeros(loose)
    column = np.zeros(loose)
    here, ahead_speed = np.zeros(size), np.zeros(size)
    pushed, was = np.zeros(size), np.zeros(size)
    own, damped, implicit = np.zeros(guides), np.zeros(guides), np.zeros(guides)
    place, rate = np.zeros(guides), np.zeros(guides)
    forward, backward, dry = np.zeros(guides), np.zeros(guides), np.zeros(guides)
    without, mounted = np.zeros(guides), np.zeros(guides, np.bool_)
    shares = np.zeros((guides, guides))
    servos = len(inputs.servos.laws)
    held_by, weights = np.zeros(servos), np.zeros(servos)
    answers = np.zeros((guides, loose))
    for tick in range(first, last):
        for step in range(steps):
            number = tick * steps + step
            for i in range(size):
                here[i] = state.speed[i] + 0.5 * (state.speed[i] - state.before[i])
                pushed[i] = was[i] = 0.0
            find_terms(bodies, state.place, here, inertia, bias)
            for a in range(len(inputs.levers)):
                earlier = inputs.pushes[a, max(number - 1, 0)]
                now = 0.5 * (earlier + inputs.pushes[a, number])
                for i in range(size):
                    pushed[i] += inputs.levers[a, i] * now
                    was[i] += inputs.levers[a, i] * earlier
            for a in range(servos):
                law, at, going, gone = (
                    law_of(inputs.servos.laws[a]),
                    inputs.servos.zero[a],
                    0.0,
                    0.0,
                )
                for i in range(size):
                    at += inputs.servos.levers[a, i] * state.place[i]
                    going += inputs.servos.levers[a, i] * here[i]
                    gone += inputs.servos.levers[a, i] * state.speed[i]
                earlier = inputs.servos.commands[a, max(number - 1, 0)]
                now = 0.5 * (earlier + inputs.servos.commands[a, number])
                force, held_by[a] = pull(law, now, at), law.damping_gain
                if abs(force - held_by[a] * gone) > law.limit:
                    # At its limit a servo damps nothing.
                    force = math.copysign(law.limit, force - held_by[a] * gone)
                    held_by[a] = 0.0
                weights[a] = 0.5
                if held_by[a] > 0.0:
                    mass = inputs.servos.inertia[a] / h
                    weights[a] = max(0.5, 1.0 - mass / held_by[a])
                force -= (1.0 - weights[a]) * held_by[a] * gone
                before = push(law, earlier, at, going)
                for i in range(size):
                    pushed[i] += inputs.servos.levers[a, i] * force
                    was[i] += inputs.servos.levers[a, i] * before
            if step == 0:
                for i in range(size):
                    out[0, i, tick], out[1, i, tick] = state.place[i], state.speed[i]
                    out[2, i, tick] = was[i]
            for k in range(len(held)):
                i = held[k]
                ahead_speed[i] = (
                    inputs.prescribed[i, number + 1] - inputs.prescribed[i, number]
                ) / h
            # What every guide does whatever the coming velocity is.
            for g in range(guides):
                own[g] = inputs.on[g, tick]
                damped[g] = implicit[g] = 0.0
                if not contacts.acts[g]:
                    continue
                guide = guide_of(contacts.guides[g])
                friction = friction_of(contacts.dry[g])
                place[g], rate[g], load, among = contacts.zero[g], 0.0, 0.0, 0.0
                for i in range(size):
                    along = contacts.along[g, i]
                    place[g] += along * state.place[i]
                    rate[g] += along * state.speed[i]
                    load += along * pushed[i]
                    among += along * along
                load /= among
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
                    state.within[g] = (inner - state.inner[g]) / h
                    state.inner[g], state.slider[g], state.viscous[g] = inner, slider, viscous
                    own[g] -= force
                    continue
                damped[g] = share * damping(guide, rate[g]) + guide.drag * abs(rate[g])
                mass = contacts.inertia[g] / h
                implicit[g] = max(0.5, 1.0 - mass / damped[g]) if damped[g] > 0.0 else 0.5
                own[g] -= position_force(guide, place[g], contacts.rests[g])
                own[g] -= (1.0 - share) * state.viscous[g]
                own[g] -= (1.0 - implicit[g]) * damped[g] * rate[g]
                forward[g], backward[g] = dry_limits(friction, rate[g], load)
            # (inertia + h Σ implicit damping) v = right
            for a in range(loose):
                i = free[a]
                right[a] = h * (pushed[i] + inputs.besides[i, tick] - bias[i])
                for b in range(loose):
                    whole[a, b] = inertia[i, free[b]]
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
                    right[a] += h * along * (own[g] - weight * prescribed)
                    for b in range(loose):
                        whole[a, b] += h * weight * along * contacts.along[g, free[b]]
                without[g] = prescribed
            for g in range(servos):
                weight, prescribed = weights[g] * held_by[g], 0.0
                for k in range(len(held)):
                    prescribed += inputs.servos.levers[g, held[k]] * ahead_speed[held[k]]
                for a in range(loose):
                    along = inputs.servos.levers[g, free[a]]
                    right[a] -= h * along * weight * prescribed
                    for b in range(loose):
                        whole[a, b] += h * weight * along * inputs.servos.levers[g, free[b]]
            factor(whole, loose)
            solve(whole, loose, right)
            # Dry friction: what each bears at the speed that the others leave it.
            most = 0.0
            for g in range(guides):
                dry[g] = 0.0
                if mounted[g] or not contacts.rubs[g]:
                    continue
                most = max(most, forward[g], backward[g])
                for a in range(loose):
                    column[a] = h * contacts.along[g, free[a]]
                    without[g] += contacts.along[g, free[a]] * right[a]
                solve(whole, loose, column)
                for a in range(loose):
                    answers[g, a] = column[a]
                for other in range(guides):
                    shares[other, g] = 0.0
                    for a in range(loose):
                        shares[other, g] += contacts.along[other, free[a]] * column[a]
            for _ in range(TURNS):
                changed = 0.0
                for g in range(guides):
                    if mounted[g] or not contacts.rubs[g]:
                        continue
                    speed = without[g]
                    for other in range(guides):
                        if other != g:
                            speed -= shares[g, other] * dry[other]
                    found = bear(
                        apart=place[g] - state.slider[g],
                        free=speed,
                        yields=shares[g, g],
                        h=h,
                        half=0.5 * contacts.guides[g, BACKLASH],
                        spring=contacts.springs[g],
                        forward=forward[g],
                        backward=backward[g],
                    )
                    changed = max(changed, abs(found - dry[g]))
                    dry[g] = found
                if changed <= SAME * most:
                    break
            for g in range(guides):
                if dry[g] != 0.0:
                    for a in range(loose):
                        right[a] -= answers[g, a] * dry[g]
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
                own[g] -= implicit[g] * damped[g] * ahead + dry[g]
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
            if step == 0:
                for k in range(len(held)):
                    i = held[k]
                    force = bias[i] - inputs.besides[i, tick]
                    for j in range(size):
                        force += inertia[i, j] * (ahead_speed[j] - state.speed[j]) / h
                    for g in range(guides):
                        force -= contacts.along[g, i] * own[g]
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
            for k in range(len(held)):
                state.place[held[k]] = inputs.prescribed[held[k], number + 1]
