"""The ideal emulated system: what a test would do if the rig were perfect, with no friction, no
noise and no delay."""

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
from rigtwin.simulation.plant import initial_deflection

SUBSTEPS = 4
"""Steps a tick where a semi-active damper or a gas spring's force is held over each; a linear
suspension is exact with one."""


@dataclass(frozen=True)
class Ideal:
    """Sprung position and velocity (m, m/s; of the beams' centre), wheel position (m), suspension
    force (N), and what the wing does relative to the ground (m, at 0, 1, 2 and 3 beams from the
    centre); shape (ticks,), wing (ticks, 4) or None."""

    structure: Array
    velocity: Array
    wheel: Array
    force: Array
    wing: Array | None

    def acceleration(self, period: float) -> Array:
        """Of the structure's centre, m/s²."""
        return np.gradient(self.velocity, period)


@dataclass(frozen=True)
class _Structure:
    """The sprung body in modal form: squared angular frequencies, damping rates, centre shape,
    gravity's modal force, modal displacements at the start, and the wing's shape."""

    squares: Array
    damping: Array
    centre: Array
    weight: Array
    start: Array
    wing: Array | None


def _structure(settings: Settings) -> _Structure:
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
    """The system that a test emulates, started as the rig starts: a body or a cross of beams on a
    spring and damper with skyhook, on the ground (single mass) or on a wheel and its tyre (quarter
    car). ground: m, held over each tick."""
    settings, plant, period = (
        configuration.controller,
        configuration.plant,
        configuration.timing.period,
    )
    body = _structure(settings)
    count = len(body.squares)
    on_wheel = settings.travel == Travel.WHEEL
    size = 2 * count + (2 if on_wheel else 0)
    k, b = settings.suspension_stiffness, settings.suspension_damping
    sky = settings.skyhook_damping if settings.skyhook == Skyhook.ACTIVE else 0.0
    # Rows of the state that give the sprung centre's and the wheel's position and velocity; inputs:
    # ground, its rate, one, and what is not linear: the force of a semi-active damper less that of
    # a gas spring.
    rate = np.diff(ground, prepend=ground[0]) / period
    inputs = np.column_stack([ground, rate, np.ones_like(ground), np.zeros_like(ground)])
    position, velocity, wheel, wheel_rate = (np.zeros(size) for _ in range(4))
    position[:count], velocity[count : 2 * count] = body.centre, body.centre
    force, force_in = (
        -k * position - (b + sky) * velocity,
        np.array([0.0, 0.0, settings.preload, -1.0]),
    )
    if on_wheel:
        wheel[-2], wheel_rate[-1] = 1.0, 1.0
        force += k * wheel + b * wheel_rate
    else:
        force_in[:2] = k, b
    a, entry = np.zeros((size, size)), np.zeros((size, 4))
    for mode in range(count):
        a[mode, count + mode] = 1.0
        a[count + mode, mode], a[count + mode, count + mode] = (
            -body.squares[mode],
            -body.damping[mode],
        )
        a[count + mode] += body.centre[mode] * force
        entry[count + mode] = body.centre[mode] * force_in
        entry[count + mode, 2] += body.weight[mode]
    if on_wheel:
        stiffness, damping, mass = plant.tyre.stiffness, plant.tyre.damping, plant.carriage.mass
        a[-2, -1] = 1.0
        a[-1] = (-force - stiffness * wheel - damping * wheel_rate) / mass
        entry[-1] = -force_in / mass
        entry[-1, :2] += np.array([stiffness, damping]) / mass
    start = np.zeros(size)
    start[:count] = body.start
    if on_wheel:
        start[-2] = ground[0] - initial_deflection(plant, settings.preload)
    substeps = (
        SUBSTEPS if settings.skyhook == Skyhook.SEMI_ACTIVE or settings.gas_force > 0.0 else 1
    )
    transition, step = _discretise(a, entry, period / substeps)
    states, besides = np.empty((len(ground), size)), np.zeros(len(ground))
    rows = np.stack([velocity, velocity - wheel_rate, position - wheel])
    _simulate(
        settings=settings,
        on_wheel=on_wheel,
        transition=transition,
        step=step,
        inputs=inputs,
        rows=rows,
        start=start,
        substeps=substeps,
        states=states,
        besides=besides,
    )
    inputs[:, 3] = besides
    wing = None if body.wing is None else states[:, :count] @ body.wing
    return Ideal(
        states @ position,
        states @ velocity,
        states @ wheel if on_wheel else ground,
        states @ force + inputs @ force_in,
        wing,
    )


def _discretise(a: Array, entry: Array, period: float) -> tuple[Array, Array]:
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
    besides: Array,
) -> None:
    """States at every tick under inputs held over each. rows: give of a state the sprung velocity,
    the suspension's velocity and its travel, the last two less the ground's where there is no
    wheel. besides: the force of what is not linear."""
    state = start.copy()
    given = np.zeros(inputs.shape[1])
    for tick in range(len(inputs)):
        given[:] = inputs[tick]
        for part in range(substeps):
            if substeps > 1:
                sprung, velocity, travel = (
                    np.dot(rows[0], state),
                    np.dot(rows[1], state),
                    np.dot(rows[2], state),
                )
                if not on_wheel:
                    velocity, travel = velocity - given[1], travel - given[0]
                given[3] = 0.0
                if settings.skyhook == Skyhook.SEMI_ACTIVE:
                    given[3] += semi_active_damping(settings, sprung, velocity) * velocity
                if settings.gas_force > 0.0:
                    given[3] -= gas_force(
                        settings.gas_force, settings.gas_length, settings.gas_exponent, -travel
                    )
            if part == 0:
                states[tick] = state
                besides[tick] = given[3]
            state = np.dot(transition, state) + np.dot(step, given)
