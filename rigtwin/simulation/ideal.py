"""Ideal emulated system: the motion of a test on a perfect rig, without friction, noise and delay.

The linear part z' = A·z + B·u is sampled exactly for inputs held over each step. The forces of a
semi-active damper and of a gas spring are not linear; they are held over each of `SUBSTEPS`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from controllers import Settings, Skyhook, Structure, Travel
from controllers.beam import at_start, modes
from controllers.gas_spring import gas_force
from controllers.skyhook import semi_active_damping
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.rig_contacts import initial_deflection

SUBSTEPS = 4
"""Steps per tick with a semi-active damper or gas spring. A linear suspension is exact with one."""


@dataclass(frozen=True)
class Ideal:
    """Motion of the ideal system.

    Attributes
    ----------
    structure, velocity : Array
        Position and velocity of the sprung mass, or of the beams' centre, m and m/s, shape
        (ticks,).
    wheel : Array
        Position of the wheel, m, shape (ticks,).
    force : Array
        Force of the suspension, N, shape (ticks,).
    wing : Array or None
        Position of the wing at 0, 1, 2 and 3 beams from the centre, m, shape (ticks, 4). None for a
        rigid body.
    """

    structure: Array
    velocity: Array
    wheel: Array
    force: Array
    wing: Array | None

    def acceleration(self, period: float) -> Array:
        """Return the acceleration of the structure's centre, m/s², shape (ticks,)."""
        return np.gradient(self.velocity, period)


@dataclass(frozen=True)
class _Structure:
    """Sprung body in modal form, with mass-normalised modes."""

    squares: Array  # Squared angular frequencies, 1/s², shape (modes,).
    damping: Array  # Damping rates 2ζω, 1/s, shape (modes,).
    centre: Array  # Mode shapes at the centre, 1/√kg, shape (modes,).
    weight: Array  # Modal forces of gravity, N/√kg, shape (modes,).
    start: Array  # Modal displacements at the start, m·√kg, shape (modes,).
    wing: Array | None  # Mode shapes along the wing, shape (modes, 4), or None.


def _structure(settings: Settings) -> _Structure:
    """Return the cross of beams by its modes, or a rigid body as one mode of frequency zero."""
    if settings.structure == Structure.BEAM:
        model = modes(settings, 1e-3)
        squares = (2 * np.pi * model.frequencies) ** 2
        return _Structure(
            squares,
            settings.beam_damping * squares,
            model.centre,
            model.weight,
            np.array(at_start(settings, model)),
            model.wing,
        )
    root = np.sqrt(settings.sprung_mass)
    return _Structure(
        np.zeros(1),
        np.zeros(1),
        np.array([1 / root]),
        np.array([-settings.gravity * root]),
        np.array([settings.start * root]),
        None,
    )


def simulate_ideal(configuration: Configuration, ground: Array) -> Ideal:
    """Simulate the system that a test emulates, from the rig's initial state.

    A body or a cross of beams stands on a spring and damper with skyhook, either on the ground
    (single mass) or on a wheel with a tyre (quarter car).

    Parameters
    ----------
    configuration
        Settings of the test.
    ground
        Ground motion, m, held over each tick, shape (ticks,).

    Returns
    -------
    Ideal
        Motion and suspension force at every tick.
    """
    settings, period = configuration.controller, configuration.timing.period
    body = _structure(settings)
    system = _system(configuration, body)
    count, size = len(body.squares), len(system.a)
    # Inputs u: ground, its rate, one (for constants), and the nonlinear force: that of a
    # semi-active damper less that of a gas spring.
    rate = np.diff(ground, prepend=ground[0]) / period
    inputs = np.column_stack([ground, rate, np.ones_like(ground), np.zeros_like(ground)])
    start = np.zeros(size)
    start[:count] = body.start
    if system.on_wheel:
        start[-2] = ground[0] - initial_deflection(configuration.plant, settings.preload)
    linear = settings.skyhook != Skyhook.SEMI_ACTIVE and settings.gas_force <= 0.0
    substeps = 1 if linear else SUBSTEPS
    transition, step = _discretise(system.a, system.entry, period / substeps)
    states, nonlinear = np.empty((len(ground), size)), np.zeros(len(ground))
    position, velocity, wheel, wheel_rate = system.rows
    _simulate(
        settings=settings,
        on_wheel=system.on_wheel,
        transition=transition,
        step=step,
        inputs=inputs,
        rows=np.stack([velocity, velocity - wheel_rate, position - wheel]),
        start=start,
        substeps=substeps,
        states=states,
        nonlinear=nonlinear,
    )
    inputs[:, 3] = nonlinear
    return Ideal(
        structure=states @ position,
        velocity=states @ velocity,
        wheel=states @ wheel if system.on_wheel else ground,
        force=states @ system.force + inputs @ system.force_in,
        wing=None if body.wing is None else states[:, :count] @ body.wing,
    )


@dataclass(frozen=True)
class _System:
    """Linear part z' = A·z + B·u of the ideal system.

    State z: modal displacements, modal velocities, and with a wheel its position and velocity.
    """

    on_wheel: bool  # Whether the suspension stands on a wheel with a tyre.
    a: Array  # A, shape (states, states).
    entry: Array  # B, shape (states, 4).
    rows: tuple[Array, Array, Array, Array]
    """Rows that select position and velocity of the sprung centre and of the wheel."""
    force: Array  # Suspension force by the states, shape (states,).
    force_in: Array  # Suspension force by the inputs, shape (4,).


def _system(configuration: Configuration, body: _Structure) -> _System:
    """Return the equations of a body on its suspension, on the ground or on a wheel."""
    settings, plant = configuration.controller, configuration.plant
    on_wheel, count = settings.travel == Travel.WHEEL, len(body.squares)
    size = 2 * count + (2 if on_wheel else 0)
    k, b = settings.suspension_stiffness, settings.suspension_damping
    sky = settings.skyhook_damping if settings.skyhook == Skyhook.ACTIVE else 0.0
    position, velocity, wheel, wheel_rate = (np.zeros(size) for _ in range(4))
    position[:count], velocity[count : 2 * count] = body.centre, body.centre
    # Suspension force = force · z + force_in · u, downwards on the body by −1.
    force = -k * position - (b + sky) * velocity
    force_in = np.array([0.0, 0.0, settings.preload, -1.0])
    if on_wheel:
        wheel[-2], wheel_rate[-1] = 1.0, 1.0
        force += k * wheel + b * wheel_rate
    else:
        force_in[:2] = k, b
    a, entry = _body_equations(body, force, force_in, size)
    if on_wheel:
        stiffness, damping, mass = plant.tyre.stiffness, plant.tyre.damping, plant.carriage.mass
        a[-2, -1] = 1.0
        a[-1] = (-force - stiffness * wheel - damping * wheel_rate) / mass
        entry[-1] = -force_in / mass
        entry[-1, :2] += np.array([stiffness, damping]) / mass
    return _System(on_wheel, a, entry, (position, velocity, wheel, wheel_rate), force, force_in)


def _body_equations(
    body: _Structure, force: Array, force_in: Array, size: int
) -> tuple[Array, Array]:
    """Return A and B with the modal equations q'' + d·q' + ω²·q = centre·F + weight filled in."""
    count = len(body.squares)
    a, entry = np.zeros((size, size)), np.zeros((size, 4))
    for mode in range(count):
        a[mode, count + mode] = 1.0
        a[count + mode, mode] = -body.squares[mode]
        a[count + mode, count + mode] = -body.damping[mode]
        a[count + mode] += body.centre[mode] * force
        entry[count + mode] = body.centre[mode] * force_in
        entry[count + mode, 2] += body.weight[mode]
    return a, entry


def _discretise(a: Array, entry: Array, period: float) -> tuple[Array, Array]:
    """Return transition and input matrix of z' = A·z + B·u with u held over a period, s."""
    count = len(a)
    both = np.zeros((count + entry.shape[1],) * 2)
    both[:count, :count], both[:count, count:] = a, entry
    sampled = expm(both * period)
    return np.ascontiguousarray(sampled[:count, :count]), np.ascontiguousarray(
        sampled[:count, count:]
    )


@kernel
def _simulate(
    settings: Settings,
    on_wheel: bool,
    transition: Array,
    step: Array,
    inputs: Array,
    rows: Array,
    start: Array,
    substeps: int,
    states: Array,
    nonlinear: Array,
) -> None:
    """Compute the states at every tick.

    `rows` @ state gives the sprung velocity and the suspension's velocity and travel; without a
    wheel, the ground's motion is still to be subtracted from the last two. The nonlinear force is
    written to `nonlinear`, N, shape (ticks,).
    """
    state = start.copy()
    held = np.zeros(inputs.shape[1])
    for tick in range(len(inputs)):
        held[:] = inputs[tick]
        for part in range(substeps):
            if substeps > 1:
                sprung = np.dot(rows[0], state)
                velocity = np.dot(rows[1], state)
                travel = np.dot(rows[2], state)
                if not on_wheel:
                    velocity, travel = velocity - held[1], travel - held[0]
                held[3] = 0.0
                if settings.skyhook == Skyhook.SEMI_ACTIVE:
                    held[3] += semi_active_damping(settings, sprung, velocity) * velocity
                if settings.gas_force > 0.0:
                    held[3] -= gas_force(
                        settings.gas_force, settings.gas_length, settings.gas_exponent, -travel
                    )
            if part == 0:
                states[tick] = state
                nonlinear[tick] = held[3]
            state = np.dot(transition, state) + np.dot(step, held)
