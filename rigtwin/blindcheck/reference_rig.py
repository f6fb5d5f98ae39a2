"""The referee's rig: written from the same description as the twin, and from nothing of the twin.

Steps of 50 us; hydraulics as a chain of integrators advanced by the midpoint rule; dry friction either set-valued, solved
by projection, or as a bristle that yields before it slides; a tyre whose contact sets in over a tenth of a millimetre. Every
defect that the referee can give the rig is a number of `Truth`; its defaults are the rig without defects.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 5e-5
"""s"""
ONSET = 1e-4
"""m, over which the tyre's contact sets in."""
NEVER = 1e9


class Slider(NamedTuple):
    """Something that slides. lost: play in series with the friction, m; wave: share by which friction changes along the
    way; drag: friction with the square of the speed, N/(m/s)²."""

    coulomb: float
    viscous: float = 0.0
    peak: float = 0.0
    peak_speed: float = 0.01
    peak_shape: float = 2.0
    uneven: float = 0.0
    lost: float = 0.0
    wave: float = 0.0
    wave_length: float = 0.02
    drag: float = 0.0


class Drive(NamedTuple):
    """What happens to a command. fading: share of the gain lost over a minute; dead is a dead zone."""

    gain: float = 1.0
    lag: float = 0.0
    delay: float = 0.0
    limit: float = NEVER
    dead: float = 0.0
    rate: float = NEVER
    fading: float = 0.0


class Hydraulic(NamedTuple):
    """speed m/s; yields m/N; slower: its natural frequencies are lower by this share; creep: m/s of its own motion."""

    speed: float = 0.3
    yields: float = 0.0
    slower: float = 0.0
    creep: float = 0.0


class Sensor(NamedTuple):
    """white, mains, bit in the sensor's unit; bend: share of the full swing lost at its end; drift: unit/s; picks_up: of
    the carriage's acceleration, unit/(m/s²)."""

    white: float
    mains: float
    bit: float
    gain: float = 1.0
    zero: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    bend: float = 0.0
    full: float = 1.0
    drift: float = 0.0
    picks_up: float = 0.0


LVDT = Sensor(6e-5, 2e-4, 4.6e-6, full=0.03)
CELL = Sensor(1.5, 5.0, 0.076, full=400.0)


class Truth(NamedTuple):
    """The whole rig. bristle: N/m, 0 for set-valued friction; relaxing: share of the tyre's stiffness that relaxes, in
    `relaxing_time` s; yielding: s, a cylinder's lag behind its load; late: computation delay, s; missed: share of ticks."""

    mass: float = 34.0
    rail: Slider = Slider(50.0)
    tyre: float = 50_000.0
    tyre_damping: float = 0.0
    tyre_hardening: float = 0.0
    relaxing: float = 0.0
    relaxing_time: float = 0.05
    constant: float = 186.0
    electrical: float = 1.26e-3
    motor: Slider = Slider(14.0)
    ripple: float = 0.0
    ripple_pitch: float = 0.03
    ripple_phase: float = 0.0
    voltage: Drive = Drive()
    ground: Drive = Drive()
    structure: Drive = Drive()
    ground_hydraulic: Hydraulic = Hydraulic()
    structure_hydraulic: Hydraulic = Hydraulic()
    ground_lvdt: Sensor = LVDT
    structure_lvdt: Sensor = LVDT
    suspension_lvdt: Sensor = LVDT
    load_cell: Sensor = CELL
    late: float = 0.0
    missed: float = 0.0
    bristle: float = 0.0
    yielding: float = 4e-3


class Law(NamedTuple):
    """The controller as its operator set it."""

    imposed: bool = True
    start: float = -0.004
    sprung_mass: float = 25.0
    stiffness: float = 1000.0
    damping: float = 50.0
    preload: float = 200.0
    gravity: float = 9.81
    filter_position: float = 0.01
    filter_velocity: float = 0.01
    filter_force: float = 0.01
    kff: float = 1.0
    kp: float = 0.3
    ki: float = 10.0
    limit: float = 10.0


@numba.njit(cache=True, nogil=True)
def dry(of: Slider, speed: float, place: float) -> tuple[float, float]:
    """The bounds of dry friction at this speed and place: in positive and in negative direction, N."""
    size = of.coulomb + of.peak * math.exp(-((abs(speed) / of.peak_speed) ** of.peak_shape))
    size *= 1.0 + of.wave * math.sin(2.0 * math.pi * place / of.wave_length)
    return max(size + 0.5 * of.uneven, 0.0), max(size - 0.5 * of.uneven, 0.0)


@numba.njit(cache=True, nogil=True)
def solved(rhs: float, mass: float, rail_up: float, rail_down: float, rod_up: float, rod_down: float, plate: float) -> float:
    """The carriage's velocity by bisection on the monotone balance of impulses; rod friction acts on plate − v."""
    low = min(0.0, plate, rhs / mass) - (rail_up + rail_down + rod_up + rod_down) / mass - 1e-12
    high = max(0.0, plate, rhs / mass) + (rail_up + rail_down + rod_up + rod_down) / mass + 1e-12
    for guess in (0.0, plate):
        # A velocity at which something sticks is a solution if the bounds straddle it.
        least = mass * guess - rhs
        most = least
        least += -rail_down if guess <= 0.0 else rail_up
        most += rail_up if guess >= 0.0 else -rail_down
        least -= rod_up if guess <= plate else -rod_down
        most += rod_down if guess >= plate else -rod_up
        if least <= 0.0 <= most:
            return guess
    for _ in range(60):
        middle = 0.5 * (low + high)
        value = mass * middle - rhs + (rail_up if middle > 0.0 else -rail_down)
        value -= rod_up if plate > middle else -rod_down
        if value > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@numba.njit(cache=True, nogil=True)
def passed(
    drive: Drive, memory: Array, history: Array, count: int, command: float, centred: bool, time: float, late: float
) -> float:
    """A command through a drive, one step. memory: rate limit's, lag's and dead zone's output."""
    length = len(history)
    history[count % length] = command
    back = (drive.delay + late) / STEP
    whole = int(back)
    part = back - whole
    one, other = history[(count - whole) % length], history[(count - whole - 1) % length]
    wanted = one + part * (other - one)
    if drive.dead > 0.0:
        if centred:
            wanted = 0.0 if abs(wanted) <= drive.dead else wanted - math.copysign(drive.dead, wanted)
        else:
            if wanted > memory[2] + drive.dead:
                memory[2] = wanted - drive.dead
            elif wanted < memory[2] - drive.dead:
                memory[2] = wanted + drive.dead
            wanted = memory[2]
    wanted *= drive.gain * (1.0 - drive.fading * time / 60.0)
    wanted = max(-drive.limit, min(drive.limit, wanted))
    most = drive.rate * STEP
    memory[0] += max(-most, min(most, wanted - memory[0]))
    if drive.lag > 0.0:
        memory[1] += STEP / (drive.lag + STEP) * (memory[0] - memory[1])
    else:
        memory[1] = memory[0]
    return memory[1]


@numba.njit(cache=True, nogil=True)
def hydraulic_step(of: Hydraulic, z: Array, plate: float, command: float) -> float:
    """The identified response in cascade form, midpoint rule; returns the plate's next position, m."""
    w = 1.0 - of.slower
    a3, a2, a1, a0 = 165.9 * w, 6674.0 * w**2, 8.598e4 * w**3, 6.281e5 * w**4
    b2, b1, b0 = 1817.0 * w**2, 7.719e4 * w**3, 6.243e5 * w**4
    scale = 6.281e5 / 6.243e5
    z0, z1, z2, z3 = z[0], z[1], z[2], z[3]
    for half in range(2):
        # Observer form: the output is the first state.
        d0 = z1 - a3 * z0
        d1 = z2 - a2 * z0 + scale * b2 * command
        d2 = z3 - a1 * z0 + scale * b1 * command
        d3 = -a0 * z0 + scale * b0 * command
        share = 0.5 * STEP if half == 0 else STEP
        z0, z1, z2, z3 = z[0] + share * d0, z[1] + share * d1, z[2] + share * d2, z[3] + share * d3
    z[0], z[1], z[2], z[3] = z0, z1, z2, z3
    most = of.speed * STEP
    return plate + max(-most, min(most, z0 - plate)) + of.creep * STEP


@numba.njit(cache=True, nogil=True)
def settled(z: Array, at: float, of: Hydraulic) -> None:
    """At rest with its output at `at`."""
    w, scale = 1.0 - of.slower, 6.281e5 / 6.243e5
    a3, a2, a1 = 165.9 * w, 6674.0 * w**2, 8.598e4 * w**3
    z[0], z[1] = at, a3 * at
    z[2] = a2 * at - scale * 1817.0 * w**2 * at
    z[3] = a1 * at - scale * 7.719e4 * w**3 * at


@numba.njit(cache=True, nogil=True)
def reading(of: Sensor, value: float, acceleration: float, history: Array, memory: Array, tick: int, noise: float) -> float:
    """A sensor's sample."""
    length = len(history)
    if tick == 0:
        history[:] = value
        memory[0] = value
    history[tick % length] = value
    back = of.delay / 1e-3
    whole = int(back)
    part = back - whole
    one, other = history[(tick - whole) % length], history[(tick - whole - 1) % length]
    late = one + part * (other - one)
    memory[0] = memory[0] + (1.0 - math.exp(-1e-3 / of.lag)) * (late - memory[0]) if of.lag > 0.0 else late
    x = memory[0]
    x = of.gain * x * (1.0 - of.bend * (x / of.full) ** 2) + of.zero + of.drift * tick * 1e-3 + of.picks_up * acceleration
    x += noise
    return round(x / of.bit) * of.bit if of.bit > 0.0 else x


@numba.njit(cache=True, nogil=True)
def simulate(
    truth: Truth, law: Law, demands: Array, voltages: Array, noise: Array, missed: Array, commands: Array, sensors: Array
) -> int:
    """Runs a test. demands: ground m, structure m, force N, shape (ticks, 3); voltages: V, in place of the controller's, or
    empty; noise: of the sensors, shape (ticks, 4); missed: 1 where a tick is missed, shape (ticks,); commands, sensors: what
    is recorded, shape (ticks, 4). Returns ticks."""
    inner = round(1e-3 / STEP)
    size = 2048
    histories = np.empty((3, size))
    memories = np.zeros((3, 3))
    sensed, lags = np.zeros((4, 64)), np.zeros((4, 1))
    ground_z, structure_z = np.zeros(4), np.zeros(4)

    ground = demands[0, 0] * truth.ground.gain
    x = ground - law.preload / truth.tyre
    structure = x
    settled(ground_z, ground, truth.ground_hydraulic)
    settled(structure_z, structure, truth.structure_hydraulic)
    first = (law.preload / truth.constant, demands[0, 0], law.start)
    for number in range(3):
        histories[number, :] = first[number]
    memories[0, 0] = memories[0, 1] = first[0] * truth.voltage.gain
    memories[1, 0] = memories[1, 1] = first[1] * truth.ground.gain
    memories[2, 0] = memories[2, 1] = first[2] * truth.structure.gain
    memories[1, 2], memories[2, 2] = first[1], first[2]
    v, force, relaxed = 0.0, law.preload, 0.0
    bristle_rail = bristle_rod = 0.0
    rail_end, rod_end = x, structure - x
    ground_yield = structure_yield = ground_before = structure_before = 0.0
    acceleration = cell = 0.0
    cell = law.preload

    last = travel = speed = filtered = integral = 0.0
    plate_model, plate_speed = law.start, 0.0
    held = np.array([demands[0, 0], law.start, law.preload, law.preload / 186.0])
    count = 0
    for tick in range(len(demands)):
        time = tick * 1e-3
        values = (ground + ground_yield, structure + structure_yield, structure + structure_yield - x, cell)
        of = (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
        for number in range(4):
            sensors[tick, number] = reading(
                of[number], values[number], acceleration, sensed[number], lags[number], tick, noise[tick, number]
            )
        if missed[tick] == 0.0:
            sample, measured = sensors[tick, 2], sensors[tick, 3]
            if tick == 0:
                last, travel, filtered = sample, sample, measured
            travel += 1e-3 / (law.filter_position + 1e-3) * (sample - travel)
            speed += 1e-3 / (law.filter_velocity + 1e-3) * ((sample - last) / 1e-3 - speed)
            filtered += 1e-3 / (law.filter_force + 1e-3) * (measured - filtered)
            last = sample
            if law.imposed:
                wanted, position = demands[tick, 2], demands[tick, 1]
            else:
                wanted = law.preload - law.stiffness * travel - law.damping * speed
                plate_speed += (filtered / law.sprung_mass - law.gravity) * 1e-3
                plate_model += plate_speed * 1e-3
                position = plate_model
            error = wanted - filtered
            grown = integral + law.ki * error * 1e-3
            voltage = (law.kff * wanted + law.kp * error + grown) / 186.0
            if abs(voltage) >= law.limit:
                voltage = max(-law.limit, min(law.limit, voltage))
            else:
                integral = grown
            if len(voltages):
                position, voltage = demands[tick, 1], voltages[tick]
            held[0], held[1], held[2], held[3] = demands[tick, 0], position, wanted, voltage
        for number in range(4):
            commands[tick, number] = held[number]
        if len(voltages) == 0 and (abs(sensors[tick, 1]) > 0.15 or abs(sensors[tick, 3]) > 1500.0):
            return tick + 1

        for _ in range(inner):
            asked = passed(truth.voltage, memories[0], histories[0], count, held[3], True, time, truth.late)
            asked = max(-1860.0 / truth.constant, min(1860.0 / truth.constant, max(-10.0, min(10.0, asked))))
            asked_ground = passed(truth.ground, memories[1], histories[1], count, held[0], False, time, truth.late)
            asked_structure = passed(truth.structure, memories[2], histories[2], count, held[1], False, time, truth.late)
            count += 1
            next_ground = hydraulic_step(truth.ground_hydraulic, ground_z, ground, asked_ground)
            next_structure = hydraulic_step(truth.structure_hydraulic, structure_z, structure, asked_structure)

            deflection = ground + ground_yield - x
            squeeze = (next_ground - ground + ground_yield - ground_before) / STEP - v
            contact = 0.5 * (deflection + math.sqrt(deflection * deflection + ONSET * ONSET)) - 0.25 * ONSET**2 / 0.004
            relaxed += STEP / truth.relaxing_time * (contact - relaxed)
            tyre = truth.tyre * (contact * (1.0 + truth.tyre_hardening * contact))
            tyre += truth.relaxing * truth.tyre * (contact - relaxed)
            tyre += truth.tyre_damping * squeeze if deflection > 0.0 else 0.0
            tyre = max(tyre, 0.0) if contact > 0.0 else 0.0

            plate = (next_structure - structure + structure_yield - structure_before) / STEP
            way = structure + structure_yield - x
            sliding = plate - v
            ripple = truth.ripple * math.sin(2.0 * math.pi * way / truth.ripple_pitch + truth.ripple_phase)
            rail_up, rail_down = dry(truth.rail, v, x)
            rod_up, rod_down = dry(truth.motor, sliding, way)
            if truth.rail.lost > 0.0:
                rail_end = max(min(rail_end, x + 0.5 * truth.rail.lost), x - 0.5 * truth.rail.lost)
                rail_up *= 1.0 if x - rail_end >= 0.5 * truth.rail.lost - 1e-12 else 0.0
                rail_down *= 1.0 if rail_end - x >= 0.5 * truth.rail.lost - 1e-12 else 0.0
            if truth.motor.lost > 0.0:
                rod_end = max(min(rod_end, way + 0.5 * truth.motor.lost), way - 0.5 * truth.motor.lost)
                rod_up *= 1.0 if way - rod_end >= 0.5 * truth.motor.lost - 1e-12 else 0.0
                rod_down *= 1.0 if rod_end - way >= 0.5 * truth.motor.lost - 1e-12 else 0.0
            smooth_rail = truth.rail.viscous * v + truth.rail.drag * v * abs(v)
            smooth_rod = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
            push = tyre - force - ripple - smooth_rail + smooth_rod
            before = v
            if truth.bristle > 0.0:
                bound = rail_up if v > 0.0 else rail_down
                bent = (bristle_rail + STEP * v) / (1.0 + STEP * abs(v) * truth.bristle / max(bound, 1e-3))
                rate, bristle_rail = (bent - bristle_rail) / STEP, bent
                rail_force = truth.bristle * bristle_rail + 2.0 * math.sqrt(truth.bristle * truth.mass) * 0.3 * rate
                bound = rod_up if sliding > 0.0 else rod_down
                bent = (bristle_rod + STEP * sliding) / (1.0 + STEP * abs(sliding) * truth.bristle / max(bound, 1e-3))
                rate, bristle_rod = (bent - bristle_rod) / STEP, bent
                rod_force = truth.bristle * bristle_rod + 2.0 * math.sqrt(truth.bristle * truth.mass) * 0.3 * rate
                v += STEP / truth.mass * (push - rail_force + rod_force)
            else:
                v = solved(
                    truth.mass * v + STEP * push,
                    truth.mass,
                    STEP * rail_up,
                    STEP * rail_down,
                    STEP * rod_up,
                    STEP * rod_down,
                    plate,
                )
                if v > plate:
                    rod_force = -rod_down
                elif v < plate:
                    rod_force = rod_up
                else:
                    rail_force = rail_up if v > 0.0 else (-rail_down if v < 0.0 else 0.0)
                    rod_force = truth.mass * (v - before) / STEP - push + rail_force
                    if v == 0.0:
                        # Both stick: what the rail can bear, it bears.
                        rod_force = rod_force - max(-rail_up, min(rail_down, rod_force))
                    rod_force = max(-rod_down, min(rod_up, rod_force))
            acceleration = (v - before) / STEP
            x += STEP * v
            force += (1.0 - math.exp(-STEP / truth.electrical)) * (truth.constant * asked - force)
            cell = force + ripple - smooth_rod - rod_force
            ground_before, structure_before = ground_yield, structure_yield
            ground_yield += STEP / truth.yielding * (-truth.ground_hydraulic.yields * tyre - ground_yield)
            structure_yield += STEP / truth.yielding * (truth.structure_hydraulic.yields * cell - structure_yield)
            ground, structure = next_ground, next_structure
    return len(demands)


def run(truth: Truth, law: Law, demands: Array, random: np.random.Generator) -> tuple[Array, Array]:
    """A whole test: the commands and sensors as recorded, shape (ticks, 4) each."""
    ticks = len(demands)
    time = np.arange(ticks) * 1e-3
    noise = np.empty((ticks, 4))
    for number, sensor in enumerate((truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)):
        mains = sensor.mains * np.sin(2 * np.pi * 50.0 * time + random.uniform(0.0, 2.0 * np.pi))
        noise[:, number] = sensor.white * random.standard_normal(ticks) + mains
    absent = (random.random(ticks) < truth.missed).astype(float)
    absent[0] = 0.0
    commands, sensors = np.empty((ticks, 4)), np.empty((ticks, 4))
    done = simulate(truth, law, np.ascontiguousarray(demands), np.empty(0), noise, absent, commands, sensors)
    return commands[:done], sensors[:done]


def quiet(truth: Truth, law: Law, commands: Array) -> Array:
    """The sensors without noise under given commands, shape (ticks, 4) both."""
    ticks = len(commands)
    out, sensors = np.empty((ticks, 4)), np.empty((ticks, 4))
    demands, voltages = np.ascontiguousarray(commands[:, :3]), np.ascontiguousarray(commands[:, 3])
    simulate(truth, law, demands, voltages, np.zeros((ticks, 4)), np.zeros(ticks), out, sensors)
    return sensors
