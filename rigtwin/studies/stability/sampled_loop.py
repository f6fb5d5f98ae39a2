"""The whole rig as one linear sampled loop: the controller that runs, around a rig without dry
friction and limits.

    plant between two ticks     x[k+1] = e^{AT} x[k] + Σ e^{A(T−f)} Γ(f) u[k−n−1] + Γ(T−f) u[k−n]
                                Γ(t) = ∫₀ᵗ e^{As} ds B
    input delay                 n T + f, of the actuator and of the computer
    controller                  the derivative of `controllers.update` at rest, by differences: it
                                is affine there

What the loop cannot reach from its commands, or what its commands do not answer to, has no part in
its stability.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from scipy.sparse.csgraph import breadth_first_order

from controllers import (
    SIZE,
    Compensator,
    Demand,
    Measurements,
    PlateCompensator,
    Settings,
    Skyhook,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.closed_loop import state_space
from controllers.linear_law import LinearLaw
from rigtwin.components import RigPlant
from rigtwin.components.cylinder import closed_loop as loop_of
from rigtwin.components.gas_spring import stiffness
from rigtwin.components.tyre import tyre_force
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.converters import sensors
from rigtwin.simulation.plant import initial_deflection

PERTURBATION = 1e-6
"""In each variable's unit; far within every threshold of the controllers."""
CYLINDER, FED, FORCE, VOLTS, WHEEL, SPEED = slice(0, 4), 4, 5, 6, 7, 8
"""States of the mechanics: the cylinder's filter, what the lag lets through of its command, motor
force, what the lag lets through of the voltage, wheel position and velocity."""
DRIVEN = (0, 1, 2, 3, FORCE)
"""What both actuators move: every loop goes through them."""
MOVED = np.array([1, 3])
"""Columns of Commands that reach the plant and come back: structure and voltage."""


def decay(configuration: Configuration, plate: LinearLaw | None = None) -> float:
    """How fast the slowest motion of the loop dies away, 1/s; below zero it grows, and only dry
    friction holds it.

    plate: a delay compensator between the structure model and its cylinder, in place of the
    settings'. A semi-active damper counts as its least damping, a friction compensator that makes
    steps as none.
    """
    matrix = closed_loop(configuration, plate)
    reached = np.abs(matrix) > 0.0
    loop = np.flatnonzero(_reachable(reached.T, DRIVEN) & _reachable(reached, DRIVEN))
    largest = float(np.max(np.abs(np.linalg.eigvals(matrix[np.ix_(loop, loop)]))))
    return -math.log(largest) / configuration.timing.period if largest > 0.0 else math.inf


def _reachable(edges: NDArray[np.bool_], start: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which nodes can be come to from any of `start`; edges[i, j]: from i to j."""
    found = np.zeros(len(edges), dtype=bool)
    for node in start:
        found[breadth_first_order(edges, node, return_predecessors=False)] = True
    return found


def closed_loop(configuration: Configuration, plate: LinearLaw | None = None) -> Array:
    """The matrix that takes the state from one tick to the next: of the mechanics, commands under
    way, sensors, controller, delay compensator of the plate."""
    period, plant = configuration.timing.period, configuration.plant
    a, b, c = mechanics(plant, configuration.controller.preload)
    (own, by_sensors), (from_state, direct) = linear_controller(configuration)
    late = [
        plant.structure_cylinder.delay + plant.computer.delay,
        plant.motor.delay + plant.computer.delay,
    ]
    registers = [max(1, math.floor(delay / period + 1e-9) + 1) for delay in late]
    transducers = [_transducer(sensor, period) for sensor in sensors(plant)[1:]]
    parts = [[each[part] for each in transducers] for part in range(3)]
    sensing_a, sensing_b, sensing_c = (np.asarray(block_diag(*part)) for part in parts)
    sensing_d = np.diag([each[3] for each in transducers])

    law = plate or set_up(configuration.controller, period).plate.law
    sizes = [len(a), sum(registers), len(sensing_a), SIZE, len(law.a)]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    x, held, memory, state, own_law = (slice(int(starts[i]), int(starts[i + 1])) for i in range(5))
    total = int(starts[-1])
    # Measurements and commands at a tick, as rows over the state.
    measured = np.zeros((3, total))
    measured[:, x], measured[:, memory] = sensing_d @ c, sensing_c
    commands = direct @ measured
    commands[:, state] += from_state
    wanted = commands[0].copy()
    commands[0] = law.d[0] * wanted + law.d[1] * measured[0]
    commands[0, own_law] += law.c
    matrix = np.zeros((total, total))
    matrix[own_law] = np.outer(law.b[:, 0], wanted) + np.outer(law.b[:, 1], measured[0])
    matrix[own_law, own_law] += law.a
    matrix[x, x] = expm(a * period)
    first = held.start
    for number, (delay, length) in enumerate(zip(late, registers, strict=True)):
        whole = math.floor(delay / period + 1e-9)
        part = max(delay - whole * period, 0.0)
        entry = b[:, number]
        now = _integrate_input(a, entry, period - part)
        before = expm(a * (period - part)) @ _integrate_input(a, entry, part)
        for change, age in ((now, whole), (before, whole + 1)):
            # Age 0 is the command of this tick, age n what was put into the register n ticks ago.
            source = commands[number] if age == 0 else _unit(total, first + age - 1)
            matrix[x] += np.outer(change, source)
        matrix[first] = commands[number]
        for place in range(1, length):
            matrix[first + place, first + place - 1] = 1.0
        first += length
    matrix[memory, x] = sensing_b @ c
    matrix[memory, memory] = sensing_a
    matrix[state] += by_sensors @ measured
    matrix[state, state] += own
    return matrix


def _unit(size: int, place: int) -> Array:
    row = np.zeros(size)
    row[place] = 1.0
    return row


def _integrate_input(a: Array, b: Array, time: float) -> Array:
    """∫₀ᵗ e^{As} ds B."""
    both = np.zeros((len(a) + 1,) * 2)
    both[:-1, :-1], both[:-1, -1] = a, b
    return expm(both * time)[:-1, -1]


def mechanics(plant: RigPlant, preload: float) -> tuple[Array, Array, Array]:
    """A, B, C of the plant between the commands that act, of plate (m) and voltage (V), and plate,
    travel (m), load cell (N).

    States: cylinder, what is left of the lags of both commands, motor force, wheel position and
    velocity.
    """
    cylinder, motor = plant.structure_cylinder, plant.motor
    inner, entry, out = state_space(loop_of(cylinder))
    a, b, c = np.zeros((9, 9)), np.zeros((9, 2)), np.zeros((3, 9))
    a[CYLINDER, CYLINDER] = inner
    for number, (lag, gain, place) in enumerate(
        ((cylinder.lag, cylinder.gain, FED), (motor.lag, motor.gain, VOLTS)),
    ):
        if lag > 0.0:
            a[place, place], b[place, number] = -1.0 / lag, gain / lag
    if cylinder.lag > 0.0:
        a[CYLINDER, FED] = entry
    else:
        b[CYLINDER, 0] = entry * cylinder.gain
    a[FORCE, FORCE] = -1.0 / motor.time_constant
    if motor.lag > 0.0:
        a[FORCE, VOLTS] = motor.constant / motor.time_constant
    else:
        b[FORCE, 1] = motor.constant / motor.time_constant * motor.gain
    plate, rate = np.zeros(9), np.zeros(9)
    plate[CYLINDER], rate[CYLINDER] = out, out @ inner
    cell = -motor.viscous * rate
    cell[FORCE], cell[SPEED] = 1.0, motor.viscous
    squeezed, step = initial_deflection(plant, preload), 1e-6
    around = tyre_force(plant.tyre, np.array([squeezed - step, squeezed + step]), np.zeros(2))
    gas = stiffness(plant.gas_spring, 0.0) if plant.gas_spring.force > 0.0 else 0.0
    a[WHEEL, SPEED] = 1.0
    a[SPEED] = -cell + gas * plate
    a[SPEED, WHEEL] -= (around[1] - around[0]) / (2.0 * step) + gas
    a[SPEED, SPEED] -= plant.tyre.damping + plant.rail.viscous
    a[SPEED] /= plant.carriage.mass
    c[0] = c[1] = plate
    c[1, WHEEL] -= 1.0
    c[2] = cell
    return a, b, c


def _transducer(sensor: object, period: float) -> tuple[Array, Array, Array, float]:
    """A sensor between its quantity and its sample: A (n, n), B (n, 1), C (1, n), D. Its delay,
    then its lag, then its gain."""
    delay, lag, gain = (float(getattr(sensor, name)) for name in ("delay", "lag", "gain"))
    whole = math.floor(delay / period + 1e-9)
    part = max(delay / period - whole, 0.0)
    length, share = whole + 1, 1.0 if lag == 0.0 else 1.0 - math.exp(-period / lag)
    a, b, late, direct = (
        np.zeros((length + 1,) * 2),
        np.zeros((length + 1, 1)),
        np.zeros(length + 1),
        0.0,
    )
    b[0, 0] = 1.0
    for place in range(1, length):
        a[place, place - 1] = 1.0
    for weight, age in ((1.0 - part, whole), (part, whole + 1)):
        if age == 0:
            direct = weight
        else:
            late[age - 1] += weight
    # The last state is the lag's output of the tick before.
    row = share * late
    row[-1] += 1.0 - share
    a[-1], b[-1, 0] = row, share * direct
    return a, b, gain * row[None, :], gain * share * direct


def linear_controller(
    configuration: Configuration,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """How the controller's next state and its two commands that act answer to its state and to
    plate, travel and load cell: ((SIZE, SIZE), (SIZE, 3)), ((2, SIZE), (2, 3))."""
    settings = _affine(configuration.controller)
    controlling = set_up(settings, configuration.timing.period)
    demand = Demand(0.0, settings.start, settings.preload)
    # At rest the structure carries its weight, so that nothing moves.
    rest = np.array([0.0, settings.start, 0.0, settings.sprung_mass * settings.gravity])
    start = initial_state(controlling)
    state, _ = update(controlling, start, Measurements(*rest.tolist()), demand)
    numbers = np.array(packed(state), dtype=float)

    def tick(state: Array, measured: Array) -> Array:
        after, commands = update(
            controlling,
            unpacked(tuple(state.tolist()), start.plate),
            Measurements(*measured.tolist()),
            demand,
        )
        return np.concatenate([np.array(packed(after), dtype=float), np.array(commands)[MOVED]])

    def slope(change: Array, of_state: bool) -> Array:
        if of_state:
            ends = [tick(numbers + sign * change, rest) for sign in (1.0, -1.0)]
        else:
            ends = [tick(numbers, rest + sign * change) for sign in (1.0, -1.0)]
        found = (ends[0] - ends[1]) / (2.0 * PERTURBATION)
        # What differences of rounded numbers leave is none.
        noise = 1e-15 * np.maximum(np.abs(ends[0]), np.abs(ends[1])) / PERTURBATION * 10.0
        return np.where(np.abs(found) > noise, found, 0.0)

    by_state = np.column_stack(
        [slope(PERTURBATION * _unit(SIZE, place), True) for place in range(SIZE)],
    )
    by_sensor = np.column_stack(
        [slope(PERTURBATION * _unit(4, place), False) for place in (1, 2, 3)],
    )
    return (by_state[:SIZE], by_sensor[:SIZE]), (by_state[SIZE:], by_sensor[SIZE:])


def _affine(settings: Settings) -> Settings:
    if settings.skyhook == Skyhook.SEMI_ACTIVE:
        least = settings.suspension_damping + settings.damping_min
        settings = settings._replace(skyhook=Skyhook.NONE, suspension_damping=least)
    if settings.compensator not in (Compensator.NONE, Compensator.OBSERVER):
        settings = settings._replace(compensator=Compensator.NONE)
    # The plate's compensator is a linear law itself, which the loop has beside the controller.
    return settings._replace(voltage_limit=math.inf, plate_compensator=PlateCompensator.NONE)
