"""The whole rig as one linear sampled loop.

The controller is the one that runs; the rig is linear, without dry friction and limits.

    plant between two ticks     x[k+1] = e^{AT} x[k] + Σ e^{A(T−f)} Γ(f) u[k−n−1] + Γ(T−f) u[k−n]
                                Γ(t) = ∫₀ᵗ e^{As} ds B
    input delay                 n T + f, of the actuator and of the computer
    controller                  Jacobian of `controllers.update` at rest, by central differences;
                                exact, because the controller is affine there

Only states that are both reachable from the commands and observable by them affect stability.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from scipy.sparse.csgraph import breadth_first_order

from controllers import (
    SIZE,
)
from controllers.closed_loop import state_space
from controllers.linear_law import LinearLaw
from rigtwin.components import RigPlant
from rigtwin.components.cylinder import closed_loop as loop_of
from rigtwin.components.gas_spring import stiffness
from rigtwin.components.sensors import Sensor
from rigtwin.components.tyre import tyre_force
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.converters import sensors
from rigtwin.simulation.rig_contacts import initial_deflection
from rigtwin.studies.stability.linear_controller import linear_controller, unit

CYLINDER, FED, FORCE, VOLTS, WHEEL, SPEED = slice(0, 4), 4, 5, 6, 7, 8
"""Indices of the mechanics' states: the cylinder's filter, the lagged command of the cylinder, the
motor force, the lagged voltage, the wheel's position and velocity."""
DRIVEN = (0, 1, 2, 3, FORCE)
"""States that both actuators drive. Every loop passes through them."""


def decay(configuration: Configuration, plate: LinearLaw | None = None) -> float:
    """Return the rate of decay of the loop's slowest mode, in 1/s.

    Below zero the mode grows, and only dry friction limits it. A semi-active damper counts as its
    smallest damping; a friction compensator that makes steps counts as absent.

    Parameters
    ----------
    configuration
        Settings of the test.
    plate
        Delay compensator between the structure model and its cylinder. Defaults to the settings'.
    """
    matrix = closed_loop(configuration, plate)
    # Modes outside every loop, such as an observer's integrator, would hide the loop's own.
    reached = np.abs(matrix) > 0.0
    loop = np.flatnonzero(_reachable(reached.T, DRIVEN) & _reachable(reached, DRIVEN))
    # The slowest mode of a sampled loop has the eigenvalue of largest magnitude; |λ| =
    # e^{−decay·T}.
    largest = float(np.max(np.abs(np.linalg.eigvals(matrix[np.ix_(loop, loop)]))))
    return -math.log(largest) / configuration.timing.period if largest > 0.0 else math.inf


def _reachable(edges: NDArray[np.bool_], start: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which nodes can be reached from any of `start`; edges[i, j] leads from i to j."""
    reached = np.zeros(len(edges), dtype=bool)
    for node in start:
        reached[breadth_first_order(edges, node, return_predecessors=False)] = True
    return reached


def closed_loop(configuration: Configuration, plate: LinearLaw | None = None) -> Array:
    """Return the matrix that advances the loop's state by one tick.

    The state comprises the mechanics, commands in transit, sensors, controller, and the plate's
    delay compensator.
    """
    period, plant = configuration.timing.period, configuration.plant
    a, b, c = mechanics(plant, configuration.controller.preload)
    (by_state, by_sensors), (from_state, direct) = linear_controller(configuration)
    late = [
        plant.structure_cylinder.delay + plant.computer.delay,
        plant.motor.delay + plant.computer.delay,
    ]
    # A command in transit waits in a shift register, one place for each tick of delay.
    registers = [max(1, math.floor(delay / period + 1e-9) + 1) for delay in late]
    transducers = [_transducer(sensor, period) for sensor in sensors(plant)[1:]]
    parts = [[transducer[part] for transducer in transducers] for part in range(3)]
    sensing_a, sensing_b, sensing_c = (np.asarray(block_diag(*part)) for part in parts)
    sensing_d = np.diag([transducer[3] for transducer in transducers])

    # The plate's compensator takes the model's demand and the measured plate.
    law = plate or set_up(configuration.controller, period).plate.law
    sizes = [len(a), sum(registers), len(sensing_a), SIZE, len(law.a)]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    x, held, memory, state, law_state = (
        slice(int(starts[i]), int(starts[i + 1])) for i in range(5)
    )
    total = int(starts[-1])
    # Measurements and commands at a tick are rows over the loop's state.
    measured = np.zeros((3, total))
    measured[:, x], measured[:, memory] = sensing_d @ c, sensing_c
    commands = direct @ measured
    commands[:, state] += from_state
    wanted = commands[0].copy()
    commands[0] = law.d[0] * wanted + law.d[1] * measured[0]
    commands[0, law_state] += law.c
    matrix = np.zeros((total, total))
    matrix[law_state] = np.outer(law.b[:, 0], wanted) + np.outer(law.b[:, 1], measured[0])
    matrix[law_state, law_state] += law.a
    # Exact step of the linear plant over one tick.
    matrix[x, x] = expm(a * period)
    first = held.start
    for number, (delay, length) in enumerate(zip(late, registers, strict=True)):
        for change, age in _delayed_input(a, b[:, number], delay, period):
            # Age 0 is the command of this tick; age n entered the register n ticks ago.
            source = commands[number] if age == 0 else unit(total, first + age - 1)
            matrix[x] += np.outer(change, source)
        matrix[first] = commands[number]
        for place in range(1, length):
            matrix[first + place, first + place - 1] = 1.0
        first += length
    matrix[memory, x] = sensing_b @ c
    matrix[memory, memory] = sensing_a
    matrix[state] += by_sensors @ measured
    matrix[state, state] += by_state
    return matrix


def _delayed_input(
    a: Array, entry: Array, delay: float, period: float
) -> tuple[tuple[Array, int], tuple[Array, int]]:
    """Return the changes of the state over a tick by two delayed commands, and their ages in ticks.

    A delay n T + f, in s, lets the command of age n + 1 act for the first f of a tick, and the
    command of age n for the rest.
    """
    # The tolerance keeps a delay of whole ticks from losing one to rounding.
    whole = math.floor(delay / period + 1e-9)
    part = max(delay - whole * period, 0.0)
    now = _integrate_input(a, entry, period - part)
    before = expm(a * (period - part)) @ _integrate_input(a, entry, part)
    return (now, whole), (before, whole + 1)


def _integrate_input(a: Array, b: Array, time: float) -> Array:
    """Return ∫₀ᵗ e^{As} ds B, from the exponential of one augmented matrix (Van Loan, 1978)."""
    augmented = np.zeros((len(a) + 1,) * 2)
    augmented[:-1, :-1], augmented[:-1, -1] = a, b
    return expm(augmented * time)[:-1, -1]


def mechanics(plant: RigPlant, preload: float) -> tuple[Array, Array, Array]:
    """Return A, B and C of the plant.

    Inputs are the acting commands of plate (m) and voltage (V); outputs are plate (m), travel (m)
    and load cell (N). The states are the cylinder's filter, the lagged commands, the motor force,
    and the wheel's position and velocity.
    """
    cylinder, motor = plant.structure_cylinder, plant.motor
    inner, entry, out = state_space(loop_of(cylinder))
    # Nine states; see the constants above for their order.
    a, b, c = np.zeros((9, 9)), np.zeros((9, 2)), np.zeros((3, 9))
    a[CYLINDER, CYLINDER] = inner
    for number, (lag, gain, place) in enumerate(
        ((cylinder.lag, cylinder.gain, FED), (motor.lag, motor.gain, VOLTS))
    ):
        if lag > 0.0:
            a[place, place], b[place, number] = -1.0 / lag, gain / lag
    if cylinder.lag > 0.0:
        a[CYLINDER, FED] = entry
    else:
        b[CYLINDER, 0] = entry * cylinder.gain
    # The motor's force follows the voltage as a first-order lag.
    a[FORCE, FORCE] = -1.0 / motor.time_constant
    if motor.lag > 0.0:
        a[FORCE, VOLTS] = motor.constant / motor.time_constant
    else:
        b[FORCE, 1] = motor.constant / motor.time_constant * motor.gain
    # Outputs: the plate's position and velocity, and the load cell, which feels the motor's force
    # and its viscous friction.
    plate, rate = np.zeros(9), np.zeros(9)
    plate[CYLINDER], rate[CYLINDER] = out, out @ inner
    cell = -motor.viscous * rate
    cell[FORCE], cell[SPEED] = 1.0, motor.viscous
    # The tyre is linearised where it carries the preload.
    squeezed, step = initial_deflection(plant, preload), 1e-6
    # A central difference: the tyre's law may be nonlinear.
    around = tyre_force(plant.tyre, np.array([squeezed - step, squeezed + step]), np.zeros(2))
    # A gas spring acts between plate and wheel, linearised at rest.
    gas = stiffness(plant.gas_spring, 0.0) if plant.gas_spring.force > 0.0 else 0.0
    a[WHEEL, SPEED] = 1.0
    # Newton's law of the wheel: the suspension pushes it down, the tyre up, the rail brakes it.
    a[SPEED] = -cell + gas * plate
    a[SPEED, WHEEL] -= (around[1] - around[0]) / (2.0 * step) + gas
    a[SPEED, SPEED] -= plant.tyre.damping + plant.rail.viscous
    a[SPEED] /= plant.carriage.mass
    c[0] = c[1] = plate
    # Travel = plate − wheel.
    c[1, WHEEL] -= 1.0
    c[2] = cell
    return a, b, c


def _transducer(sensor: Sensor, period: float) -> tuple[Array, Array, Array, float]:
    """Return A (n, n), B (n, 1), C (1, n) and D of a sensor from its quantity to its sample.

    The delay acts first, then the lag, then the gain.
    """
    delay, lag, gain = float(sensor.delay), float(sensor.lag), float(sensor.gain)
    whole = math.floor(delay / period + 1e-9)
    part = max(delay / period - whole, 0.0)
    # A lag's discrete filter: y[k] = y[k-1] + share (x[k] - y[k-1]).
    length, share = whole + 1, 1.0 if lag == 0.0 else 1.0 - math.exp(-period / lag)
    a = np.zeros((length + 1,) * 2)
    b = np.zeros((length + 1, 1))
    late = np.zeros(length + 1)
    direct = 0.0
    b[0, 0] = 1.0
    for place in range(1, length):
        a[place, place - 1] = 1.0
    # A delay between two ticks is interpolated linearly.
    for weight, age in ((1.0 - part, whole), (part, whole + 1)):
        if age == 0:
            direct = weight
        else:
            late[age - 1] += weight
    # The last state is the lag's output at the previous tick.
    row = share * late
    row[-1] += 1.0 - share
    a[-1], b[-1, 0] = row, share * direct
    return a, b, gain * row[None, :], gain * share * direct
