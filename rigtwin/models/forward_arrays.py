"""Arrays of the forward dynamics of coupled joints, as compiled code takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigtwin.numerics.arrays import Array


class GuideContacts(NamedTuple):
    """Guides of the machine as compiled code takes them, one row for each guide.

    A guide's position is `zero + along · q`, with the machine's coordinates q.
    """

    guides: np.ndarray  # Each `Guide`, as records, shape (guides,).
    dry: np.ndarray  # Each `Friction`, as records, shape (guides,).
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
    rotor: Array  # Position of each motor's rotor behind its play, m, shape (pushers,).
    spin: Array  # Velocity of each motor's rotor behind its play, m/s, shape (pushers,).


class Pushers(NamedTuple):
    """Force actuators and servos of the machine as compiled code takes them."""

    laws: np.ndarray  # Each `Push`, as records, shape (pushers,).
    plays: np.ndarray  # Each `Play`, as records, shape (pushers,).
    levers: Array  # Direction of each actuator in the coordinates, shape (pushers, coordinates).
    zero: Array  # Position of each actuator at zero coordinates, m, shape (pushers,).
    inertia: Array  # Inertia that each actuator moves, kg, shape (pushers,).
    commands: Array  # Conditioned commands at the steps, shape (pushers, steps).


class StepInputs(NamedTuple):
    """Inputs of the machine over one test.

    The number of steps is that of the whole test: ticks times steps per tick.
    """

    prescribed: Array  # Prescribed positions, m, shape (coordinates, steps + 1); else zero.
    disturbance: Array  # Unmodelled force on each coordinate, N, shape (coordinates, ticks).
    guide_disturbance: Array  # Unmodelled force on each guide, N, shape (guides, ticks).
    pushers: Pushers  # Force actuators and servos.


class WorkSpace(NamedTuple):
    """Arrays that every step overwrites, allocated once for all steps.

    Coordinates are all of the machine's, free ones those that no motion is prescribed for.
    """

    # Equation of motion.
    inertia: Array  # Inertia matrix, kg, shape (coordinates, coordinates).
    bias: Array  # Gravity, Coriolis and centrifugal forces, N, shape (coordinates,).
    midspeed: Array  # Velocities extrapolated to the step, m/s, shape (coordinates,).
    ahead_speed: Array  # Velocities after the step, m/s, shape (coordinates,).
    pushed: Array  # Actuators' forces over the step, N, shape (coordinates,).
    transmitted: Array  # Actuators' forces with all damping, N, shape (coordinates,).
    earlier_push: Array  # Actuators' forces up to the step, N, shape (coordinates,).
    system: Array  # Matrix of the free coordinates' equation, then its Cholesky factor, kg.
    right: Array  # Right side, Ns, then the free velocities without dry friction, m/s.
    # Actuators, shape (pushers,).
    held_by: Array  # Damping, Ns/m.
    weights: Array  # Implicit share of the damping.
    turning: Array  # Velocity of the rotor where the joint stands still, m/s.
    dragged: Array  # Share of the joint's velocity that adds to the rotor's.
    # Guides, shape (guides,).
    place: Array  # Position along each guide, m.
    rate: Array  # Velocity along each guide before the step, m/s.
    guide_force: Array  # Force on the machine that does not depend on the coming velocity, N.
    damped: Array  # Damping, Ns/m.
    implicit: Array  # Implicit share of the damping.
    mounted: np.ndarray  # Whether the guide yields on its mount, which makes its force explicit.
    forward: Array  # Limit of the dry friction against positive motion, N.
    backward: Array  # Limit of the dry friction against negative motion, N.
    dry: Array  # Dry friction, N.
    unrubbed: Array  # Velocity along each guide without any dry friction, m/s.
    # Response to dry friction.
    coupling: Array  # Velocity of guide i by 1 N at guide j over the step, shape (guides, guides).
    response: (
        Array  # Velocities of the free coordinates by 1 N at each guide, shape (guides, free).
    )
    column: Array  # One of these responses while it is solved for, shape (free,).


def allocate(size: int, loose: int, guides: int, pushers: int) -> WorkSpace:
    """Return the work space of a machine.

    Parameters
    ----------
    size, loose
        Numbers of all coordinates and of the free ones.
    guides, pushers
        Numbers of guides and actuators.
    """
    return WorkSpace(
        inertia=np.zeros((size, size)),
        bias=np.zeros(size),
        midspeed=np.zeros(size),
        ahead_speed=np.zeros(size),
        pushed=np.zeros(size),
        transmitted=np.zeros(size),
        earlier_push=np.zeros(size),
        system=np.zeros((loose, loose)),
        right=np.zeros(loose),
        held_by=np.zeros(pushers),
        weights=np.zeros(pushers),
        turning=np.zeros(pushers),
        dragged=np.zeros(pushers),
        place=np.zeros(guides),
        rate=np.zeros(guides),
        guide_force=np.zeros(guides),
        damped=np.zeros(guides),
        implicit=np.zeros(guides),
        mounted=np.zeros(guides, np.bool_),
        forward=np.zeros(guides),
        backward=np.zeros(guides),
        dry=np.zeros(guides),
        unrubbed=np.zeros(guides),
        coupling=np.zeros((guides, guides)),
        response=np.zeros((guides, loose)),
        column=np.zeros(loose),
    )
