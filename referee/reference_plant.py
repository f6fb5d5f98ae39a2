"""The referee's rig: written from the same description as the twin, and from nothing of the twin.

Steps of 50 us; hydraulics as a chain of integrators advanced by the midpoint rule; dry friction
either set-valued, solved by projection, or as a bristle that yields before it slides; a tyre whose
contact sets in over a tenth of a millimetre. Every defect that the referee can give the rig is a
number of `Truth`; its defaults are the rig without defects.
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
    """Something that slides. lost: play in series with the friction, m; wave: share by which
    friction changes along the way; drag: friction with the square of the speed, N/(m/s)²."""

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
    """What happens to a command. fading: share of the gain lost over a minute; dead is a dead
    zone."""

    gain: float = 1.0
    lag: float = 0.0
    delay: float = 0.0
    limit: float = NEVER
    dead: float = 0.0
    rate: float = NEVER
    fading: float = 0.0


class Hydraulic(NamedTuple):
    """speed m/s; yields m/N; lost: play between piston and plate, m; slower: its natural
    frequencies are lower by this share; creep: m/s of its own motion."""

    speed: float = 0.3
    yields: float = 0.0
    lost: float = 0.0
    slower: float = 0.0
    creep: float = 0.0


class Sensor(NamedTuple):
    """white, mains, bit in the sensor's unit; bend: share of the full swing lost at its end; drift:
    unit/s; picks_up: of the carriage's acceleration, unit/(m/s²)."""

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
    """The whole rig. bristle: N/m, 0 for set-valued friction; relaxing: share of the tyre's
    stiffness that relaxes, in `relaxing_time` s; yielding: s, a cylinder's lag behind its load, 0
    for none;
    late: computation delay, s; missed: share of ticks."""

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


@numba.njit(cache=True, nogil=True)
def dry(of: Slider, speed: float, place: float) -> tuple[float, float]:
    """The bounds of dry friction at this speed and place: in positive and in negative direction,
    N."""
    size = of.coulomb + of.peak * math.exp(-((abs(speed) / of.peak_speed) ** of.peak_shape))
    size *= 1.0 + of.wave * math.sin(2.0 * math.pi * place / of.wave_length)
    return max(size + 0.5 * of.uneven, 0.0), max(size - 0.5 * of.uneven, 0.0)


@numba.njit(cache=True, nogil=True)
def solve(
    rhs: float,
    mass: float,
    rail_up: float,
    rail_down: float,
    rod_up: float,
    rod_down: float,
    plate: float,
) -> float:
    """The carriage's velocity by bisection on the monotone balance of impulses; rod friction acts
    on plate − v."""
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
def slide(
    truth: Truth,
    v: float,
    plate: float,
    push: float,
    rail_up: float,
    rail_down: float,
    rod_up: float,
    rod_down: float,
) -> tuple[float, float, float]:
    """The carriage's next velocity, and the rod's smooth and dry friction on it, for a velocity of
    the plate; push: all other forces on the carriage."""
    sliding = plate - v
    smooth = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
    after = solve(
        truth.mass * v + STEP * (push + smooth),
        truth.mass,
        STEP * rail_up,
        STEP * rail_down,
        STEP * rod_up,
        STEP * rod_down,
        plate,
    )
    if after > plate:
        return after, smooth, -rod_down
    if after < plate:
        return after, smooth, rod_up
    rail = rail_up if after > 0.0 else (-rail_down if after < 0.0 else 0.0)
    dry_force = truth.mass * (after - v) / STEP - push - smooth + rail
    if after == 0.0:
        # Both stick: what the rail can bear, it bears.
        dry_force = dry_force - max(-rail_up, min(rail_down, dry_force))
    return after, smooth, max(-rod_down, min(rod_up, dry_force))


@numba.njit(cache=True, nogil=True)
def plate_under_load(
    truth: Truth,
    v: float,
    unloaded: float,
    yielded: float,
    pull: float,
    push: float,
    rail_up: float,
    rail_down: float,
    rod_up: float,
    rod_down: float,
) -> float:
    """The load of a structure plate that yields to it, N, by bisection: a greater one lets the
    plate run ahead, which makes it smaller. pull: of the motor, N."""
    slack = truth.yielding + STEP
    wide = rod_up + rod_down + 1.0 + abs(pull)
    low, high = pull - wide, pull + wide
    for _ in range(45):
        load = 0.5 * (low + high)
        plate = unloaded + (truth.structure_hydraulic.yields * load - yielded) / slack
        _, smooth, dry_force = slide(truth, v, plate, push, rail_up, rail_down, rod_up, rod_down)
        if load > pull - smooth - dry_force:
            high = load
        else:
            low = load
    return 0.5 * (low + high)


@numba.njit(cache=True, nogil=True)
def pass_command(
    drive: Drive,
    memory: Array,
    history: Array,
    count: int,
    command: float,
    centred: bool,
    time: float,
    late: float,
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
            wanted = (
                0.0 if abs(wanted) <= drive.dead else wanted - math.copysign(drive.dead, wanted)
            )
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
    """The identified response in cascade form, midpoint rule; returns the plate's next position,
    m."""
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
def take_up(of: Hydraulic, plate: float, piston: float) -> float:
    """Where a piston with play leaves the plate, m."""
    if piston - plate > 0.5 * of.lost:
        return piston - 0.5 * of.lost
    if plate - piston > 0.5 * of.lost:
        return piston + 0.5 * of.lost
    return plate


@numba.njit(cache=True, nogil=True)
def settle(z: Array, at: float, of: Hydraulic) -> None:
    """At rest with its output at `at`."""
    w, scale = 1.0 - of.slower, 6.281e5 / 6.243e5
    a3, a2, a1 = 165.9 * w, 6674.0 * w**2, 8.598e4 * w**3
    z[0], z[1] = at, a3 * at
    z[2] = a2 * at - scale * 1817.0 * w**2 * at
    z[3] = a1 * at - scale * 7.719e4 * w**3 * at


@numba.njit(cache=True, nogil=True)
def reading(
    of: Sensor,
    value: float,
    acceleration: float,
    history: Array,
    memory: Array,
    tick: int,
    noise: float,
) -> float:
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
    memory[0] = (
        memory[0] + (1.0 - math.exp(-1e-3 / of.lag)) * (late - memory[0]) if of.lag > 0.0 else late
    )
    x = memory[0]
    x = (
        of.gain * x * (1.0 - of.bend * (x / of.full) ** 2)
        + of.zero
        + of.drift * tick * 1e-3
        + of.picks_up * acceleration
    )
    x += noise
    return round(x / of.bit) * of.bit if of.bit > 0.0 else x


class Body(NamedTuple):
    """What the rig is at a moment, changed in place. motion: see ENTRIES, shape (19,); histories:
    of the three commands under way, shape (3, 2048); memories: of their rate limit, lag and dead
    zone, shape (3, 3); sensed: past values of the sensors, shape (4, 64); lags: of the sensors,
    shape (4, 1); ground_z, structure_z: of the hydraulics, shape (4,)."""

    motion: Array
    histories: Array
    memories: Array
    sensed: Array
    lags: Array
    ground_z: Array
    structure_z: Array


ENTRIES = (
    *(
        "ground",
        "structure",
        "position",
        "velocity",
        "force",
        "relaxed",
        "bristle_rail",
        "bristle_rod",
        "rail_end",
        "rod_end",
    ),
    *(
        "ground_yield",
        "structure_yield",
        "ground_before",
        "structure_before",
        "acceleration",
        "cell",
        "steps",
        "ground_piston",
        "structure_piston",
    ),
)
"""Of `Body.motion`: plates, carriage, motor, tyre's relaxed part, bristles, ends of the play,
yielding now and a step ago, carriage's acceleration, load cell, steps made, pistons; m, N, s."""


@numba.njit(cache=True, nogil=True)
def at_rest(truth: Truth, ground_command: float, structure_command: float, preload: float) -> Body:
    """Before the first tick: all at rest, tyre and motor carrying the preload, N; commands, m, held
    for long."""
    body = Body(
        np.zeros(19),
        np.empty((3, 2048)),
        np.zeros((3, 3)),
        np.empty((4, 64)),
        np.zeros((4, 1)),
        np.zeros(4),
        np.zeros(4),
    )
    ground = ground_command * truth.ground.gain
    x = ground - preload / truth.tyre
    settle(body.ground_z, ground, truth.ground_hydraulic)
    settle(body.structure_z, x, truth.structure_hydraulic)
    first = (preload / truth.constant, ground_command, structure_command)
    for number in range(3):
        body.histories[number, :] = first[number]
    body.memories[0, 0] = body.memories[0, 1] = first[0] * truth.voltage.gain
    body.memories[1, 0] = body.memories[1, 1] = first[1] * truth.ground.gain
    body.memories[2, 0] = body.memories[2, 1] = first[2] * truth.structure.gain
    body.memories[1, 2], body.memories[2, 2] = first[1], first[2]
    body.motion[0], body.motion[1], body.motion[2], body.motion[8] = ground, x, x, x
    body.motion[4] = body.motion[15] = preload
    body.motion[17], body.motion[18] = ground, x
    return body


@numba.njit(cache=True, nogil=True)
def true_values(body: Body) -> tuple[float, float, float, float]:
    """What ideal sensors read: ground, structure, travel in m, load cell in N."""
    motion = body.motion
    ground, structure = motion[0] + motion[10], motion[1] + motion[11]
    return ground, structure, structure - motion[2], motion[15]


@numba.njit(cache=True, nogil=True)
def sample(truth: Truth, body: Body, tick: int, noise: Array, out: Array) -> None:
    """All sensors at a tick into `out`, shape (4,), as noise."""
    values = true_values(body)
    of = (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
    for number in range(4):
        out[number] = reading(
            of[number],
            values[number],
            body.motion[14],
            body.sensed[number],
            body.lags[number],
            tick,
            noise[number],
        )


@numba.njit(cache=True, nogil=True)
def advance(truth: Truth, body: Body, commands: Array, time: float) -> None:
    """One tick under commands, shape (4,): ground m, structure m, force N (not looked at), voltage
    V."""
    motion, histories, memories = body.motion, body.histories, body.memories
    ground_z, structure_z, held = body.ground_z, body.structure_z, commands
    ground, structure, x, v, force, relaxed = (
        motion[0],
        motion[1],
        motion[2],
        motion[3],
        motion[4],
        motion[5],
    )
    bristle_rail, bristle_rod, rail_end, rod_end = motion[6], motion[7], motion[8], motion[9]
    ground_yield, structure_yield, ground_before, structure_before = (
        motion[10],
        motion[11],
        motion[12],
        motion[13],
    )
    acceleration, cell, count = motion[14], motion[15], int(motion[16])
    for _ in range(round(1e-3 / STEP)):
        asked = pass_command(
            truth.voltage, memories[0], histories[0], count, held[3], True, time, truth.late
        )
        asked = max(
            -1860.0 / truth.constant, min(1860.0 / truth.constant, max(-10.0, min(10.0, asked)))
        )
        asked_ground = pass_command(
            truth.ground, memories[1], histories[1], count, held[0], False, time, truth.late
        )
        asked_structure = pass_command(
            truth.structure, memories[2], histories[2], count, held[1], False, time, truth.late
        )
        count += 1
        motion[17] = hydraulic_step(truth.ground_hydraulic, ground_z, motion[17], asked_ground)
        motion[18] = hydraulic_step(
            truth.structure_hydraulic, structure_z, motion[18], asked_structure
        )
        next_ground = take_up(truth.ground_hydraulic, ground, motion[17])
        next_structure = take_up(truth.structure_hydraulic, structure, motion[18])

        deflection = ground + ground_yield - x
        squeeze = (next_ground - ground + ground_yield - ground_before) / STEP - v
        contact = (
            0.5 * (deflection + math.sqrt(deflection * deflection + ONSET * ONSET))
            - 0.25 * ONSET**2 / 0.004
        )
        relaxed += STEP / truth.relaxing_time * (contact - relaxed)
        tyre = truth.tyre * (contact * (1.0 + truth.tyre_hardening * contact))
        tyre += truth.relaxing * truth.tyre * (contact - relaxed)
        tyre += truth.tyre_damping * squeeze if deflection > 0.0 else 0.0
        tyre = max(tyre, 0.0) if contact > 0.0 else 0.0

        plate = (next_structure - structure + structure_yield - structure_before) / STEP
        way = structure + structure_yield - x
        sliding = plate - v
        ripple = truth.ripple * math.sin(
            2.0 * math.pi * way / truth.ripple_pitch + truth.ripple_phase
        )
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
        push = tyre - force - ripple - smooth_rail
        before = v
        unloaded, load = (next_structure - structure) / STEP, 0.0
        if truth.structure_hydraulic.yields > 0.0:
            load = plate_under_load(
                truth,
                v,
                unloaded,
                structure_yield,
                force + ripple,
                push,
                rail_up,
                rail_down,
                rod_up,
                rod_down,
            )
            give = truth.structure_hydraulic.yields * load - structure_yield
            plate = unloaded + give / (truth.yielding + STEP)
        sliding = plate - v
        smooth_rod = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
        if truth.bristle > 0.0:
            bound = rail_up if v > 0.0 else rail_down
            bent = (bristle_rail + STEP * v) / (
                1.0 + STEP * abs(v) * truth.bristle / max(bound, 1e-3)
            )
            rate, bristle_rail = (bent - bristle_rail) / STEP, bent
            rail_force = (
                truth.bristle * bristle_rail
                + 2.0 * math.sqrt(truth.bristle * truth.mass) * 0.3 * rate
            )
            bound = rod_up if sliding > 0.0 else rod_down
            bent = (bristle_rod + STEP * sliding) / (
                1.0 + STEP * abs(sliding) * truth.bristle / max(bound, 1e-3)
            )
            rate, bristle_rod = (bent - bristle_rod) / STEP, bent
            rod_force = (
                truth.bristle * bristle_rod
                + 2.0 * math.sqrt(truth.bristle * truth.mass) * 0.3 * rate
            )
            v += STEP / truth.mass * (push + smooth_rod - rail_force + rod_force)
        else:
            v, smooth_rod, rod_force = slide(
                truth, v, plate, push, rail_up, rail_down, rod_up, rod_down
            )
        acceleration = (v - before) / STEP
        x += STEP * v
        force += (1.0 - math.exp(-STEP / truth.electrical)) * (truth.constant * asked - force)
        cell = force + ripple - smooth_rod - rod_force
        ground_before, structure_before = ground_yield, structure_yield
        ground_yield += (
            STEP / (truth.yielding + STEP) * (-truth.ground_hydraulic.yields * tyre - ground_yield)
        )
        if truth.structure_hydraulic.yields > 0.0:
            structure_yield += STEP * (plate - unloaded)
            # Where rod and rail both stick, only the plate's own spring says what it is.
            cell = load
        ground, structure = next_ground, next_structure
    motion[0], motion[1], motion[2], motion[3], motion[4], motion[5] = (
        ground,
        structure,
        x,
        v,
        force,
        relaxed,
    )
    motion[6], motion[7], motion[8], motion[9] = bristle_rail, bristle_rod, rail_end, rod_end
    motion[10], motion[11], motion[12], motion[13] = (
        ground_yield,
        structure_yield,
        ground_before,
        structure_before,
    )
    motion[14], motion[15], motion[16] = acceleration, cell, count
