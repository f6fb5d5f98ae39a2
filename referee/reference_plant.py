"""The referee's rig, written from the same description as the twin but without any of its code.

The integration step is 50 µs. The hydraulics are a chain of integrators, advanced by the midpoint
rule. Dry friction is set-valued, solved by projection, or a bristle that yields before it slides.
The contact of the tyre sets in over a tenth of a millimetre. Every defect of the rig is a field of
`Truth`, whose defaults are the rig without defects.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 5e-5
"""Integration step, s."""
ONSET = 1e-4
"""Deflection over which the contact of the tyre sets in, m."""
NEVER = 1e9
"""Value of a limit that is never reached."""
Bounds = tuple[float, float, float, float]
"""Bounds of dry friction: of the rail in positive and in negative direction, then of the rod."""


class ReferenceSlider(NamedTuple):
    """Sliding part with dry and viscous friction.

    Attributes
    ----------
    coulomb, viscous : float
        Coulomb friction, N, and viscous friction, Ns/m.
    peak, peak_speed, peak_shape : float
        Additional friction at standstill, N, the speed at which it fades, m/s, and the exponent.
    asymmetry : float
        Difference of the dry friction between the two directions, N.
    play : float
        Play in series with the friction, m.
    wave, wave_length : float
        Share by which friction varies along the way, and its wavelength, m.
    drag : float
        Friction with the squared speed, N/(m/s)².
    """

    coulomb: float
    viscous: float = 0.0
    peak: float = 0.0
    peak_speed: float = 0.01
    peak_shape: float = 2.0
    asymmetry: float = 0.0
    play: float = 0.0
    wave: float = 0.0
    wave_length: float = 0.02
    drag: float = 0.0


class CommandPath(NamedTuple):
    """Path of a command to its actuator.

    Attributes
    ----------
    gain : float
        Gain.
    lag, delay : float
        First-order lag and delay, s.
    limit, rate : float
        Largest command, in its unit, and largest rate, per second.
    dead_zone : float
        Half width of a dead zone, in the command's unit.
    fading : float
        Share of the gain lost within a minute.
    """

    gain: float = 1.0
    lag: float = 0.0
    delay: float = 0.0
    limit: float = NEVER
    dead_zone: float = 0.0
    rate: float = NEVER
    fading: float = 0.0


class Hydraulic(NamedTuple):
    """Hydraulic cylinder.

    Attributes
    ----------
    speed : float
        Largest speed, m/s.
    compliance : float
        Yield under load, m/N.
    play : float
        Play between piston and plate, m.
    slowdown : float
        Share by which the natural frequencies are lower than nominal.
    creep : float
        Own motion of the piston, m/s.
    """

    speed: float = 0.3
    compliance: float = 0.0
    play: float = 0.0
    slowdown: float = 0.0
    creep: float = 0.0


class Sensor(NamedTuple):
    """Sensor with its noise and defects; `u` stands for the sensor's unit.

    Attributes
    ----------
    white, mains : float
        White noise, u rms, and amplitude of the 50 Hz hum, u.
    bit : float
        Resolution, u.
    gain, offset : float
        Gain, and offset, u.
    lag, delay : float
        First-order lag and delay, s.
    curvature, full_scale : float
        Share of the reading lost at full scale, and the full scale, u.
    drift : float
        Drift, u/s.
    crosstalk : float
        Reading per acceleration of the carriage, u/(m/s²).
    """

    white: float
    mains: float
    bit: float
    gain: float = 1.0
    offset: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    curvature: float = 0.0
    full_scale: float = 1.0
    drift: float = 0.0
    crosstalk: float = 0.0


LVDT = Sensor(6e-5, 2e-4, 4.6e-6, full_scale=0.03)
CELL = Sensor(1.5, 5.0, 0.076, full_scale=400.0)


class Truth(NamedTuple):
    """Parameters of the whole rig.

    Attributes
    ----------
    mass : float
        Mass of the carriage, kg.
    rail, motor : Slider
        Friction of the rail and of the motor's rod.
    tyre, tyre_damping, tyre_hardening : float
        Stiffness, N/m, and damping, Ns/m, of the tyre, and its stiffening, 1/m.
    relaxing, relaxing_time : float
        Share of the tyre's stiffness that relaxes, and its time constant, s.
    motor_constant, electrical_lag : float
        Force per voltage of the motor, N/V, and lag of its current, s.
    ripple, ripple_pitch, ripple_phase : float
        Cogging of the motor: amplitude, N, pitch, m, and phase, rad.
    voltage, ground, structure : Drive
        Paths of the three commands.
    ground_hydraulic, structure_hydraulic : Hydraulic
        Cylinders.
    ground_lvdt, structure_lvdt, suspension_lvdt, load_cell : Sensor
        Sensors.
    computation_delay : float
        Delay of all commands by the computer, s.
    missed : float
        Share of missed ticks.
    bristle : float
        Stiffness of bristle friction, N/m. 0 stands for set-valued friction.
    load_lag : float
        Lag of a compliant cylinder behind its load, s. 0 stands for none.
    """

    mass: float = 34.0
    rail: ReferenceSlider = ReferenceSlider(50.0)
    tyre: float = 50_000.0
    tyre_damping: float = 0.0
    tyre_hardening: float = 0.0
    relaxing: float = 0.0
    relaxing_time: float = 0.05
    motor_constant: float = 186.0
    electrical_lag: float = 1.26e-3
    motor: ReferenceSlider = ReferenceSlider(14.0)
    ripple: float = 0.0
    ripple_pitch: float = 0.03
    ripple_phase: float = 0.0
    voltage: CommandPath = CommandPath()
    ground: CommandPath = CommandPath()
    structure: CommandPath = CommandPath()
    ground_hydraulic: Hydraulic = Hydraulic()
    structure_hydraulic: Hydraulic = Hydraulic()
    ground_lvdt: Sensor = LVDT
    structure_lvdt: Sensor = LVDT
    suspension_lvdt: Sensor = LVDT
    load_cell: Sensor = CELL
    computation_delay: float = 0.0
    missed: float = 0.0
    bristle: float = 0.0
    load_lag: float = 4e-3


@numba.njit(cache=True, nogil=True)
def dry_bounds(slider: ReferenceSlider, speed: float, position: float) -> tuple[float, float]:
    """Return the bounds of dry friction in positive and in negative direction, N.

    The size is F_c + F_p exp(−(|v|/v_s)^n), times the variation along the way.
    """
    size = slider.coulomb + slider.peak * math.exp(
        -((abs(speed) / slider.peak_speed) ** slider.peak_shape)
    )
    size *= 1.0 + slider.wave * math.sin(2.0 * math.pi * position / slider.wave_length)
    return max(size + 0.5 * slider.asymmetry, 0.0), max(size - 0.5 * slider.asymmetry, 0.0)


@numba.njit(cache=True, nogil=True)
def solve(rhs: float, mass: float, bounds: Bounds, plate: float) -> float:
    """Return the velocity of the carriage after a step, m/s.

    Solves m v + F_rail(v) − F_rod(plate − v) = rhs, with rhs and bounds as impulses in Ns. The left
    side rises monotonically with v, with jumps where rail or rod stick, so bisection always
    converges.
    """
    rail_up, rail_down, rod_up, rod_down = bounds
    # No friction can move the carriage beyond these bounds: they bracket the root.
    low = min(0.0, plate, rhs / mass) - (rail_up + rail_down + rod_up + rod_down) / mass - 1e-12
    high = max(0.0, plate, rhs / mass) + (rail_up + rail_down + rod_up + rod_down) / mass + 1e-12
    for guess in (0.0, plate):
        # Sticking is a solution if zero lies within the jump of the balance there.
        least = mass * guess - rhs
        most = least
        least += -rail_down if guess <= 0.0 else rail_up
        most += rail_up if guess >= 0.0 else -rail_down
        least -= rod_up if guess <= plate else -rod_down
        most += rod_down if guess >= plate else -rod_up
        if least <= 0.0 <= most:
            return guess
    # 60 halvings of a bracket of some m/s end at the resolution of a double.
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
    truth: Truth, v: float, plate: float, push: float, bounds: Bounds
) -> tuple[float, float, float]:
    """Return the next velocity of the carriage, m/s, and the rod's viscous and dry friction, N.

    v, plate: velocities of carriage and plate, m/s; push: all other forces on the carriage, N;
    bounds: of dry friction, N.
    """
    rail_up, rail_down, rod_up, rod_down = bounds
    sliding = plate - v
    viscous = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
    impulses = (STEP * rail_up, STEP * rail_down, STEP * rod_up, STEP * rod_down)
    next_velocity = solve(truth.mass * v + STEP * (push + viscous), truth.mass, impulses, plate)
    if next_velocity > plate:
        return next_velocity, viscous, -rod_down
    if next_velocity < plate:
        return next_velocity, viscous, rod_up
    rail = rail_up if next_velocity > 0.0 else (-rail_down if next_velocity < 0.0 else 0.0)
    dry_force = truth.mass * (next_velocity - v) / STEP - push - viscous + rail
    if next_velocity == 0.0:
        # Both stick: the division between them is undetermined. The rail takes what it can.
        dry_force = dry_force - max(-rail_up, min(rail_down, dry_force))
    return next_velocity, viscous, max(-rod_down, min(rod_up, dry_force))


@numba.njit(cache=True, nogil=True)
def plate_under_load(
    truth: Truth,
    v: float,
    unloaded: float,
    deflection: float,
    pull: float,
    push: float,
    bounds: Bounds,
) -> float:
    """Return the load of a compliant structure plate, N, by bisection; pull: motor force, N.

    A greater load lets the plate run ahead, which reduces the load, so the balance is monotone.
    """
    lag = truth.load_lag + STEP
    reach = bounds[2] + bounds[3] + 1.0 + abs(pull)
    low, high = pull - reach, pull + reach
    for _ in range(45):
        load = 0.5 * (low + high)
        plate = unloaded + (truth.structure_hydraulic.compliance * load - deflection) / lag
        _, viscous, dry_force = slide(truth, v, plate, push, bounds)
        if load > pull - viscous - dry_force:
            high = load
        else:
            low = load
    return 0.5 * (low + high)


@numba.njit(cache=True, nogil=True)
def pass_command(
    drive: CommandPath,
    memory: Array,
    history: Array,
    count: int,
    command: float,
    centred: bool,
    time: float,
    computation_delay: float,
) -> float:
    """Return a command after its path, for one step.

    memory: outputs of rate limit, lag and dead zone, shape (3,); history: past commands, a ring of
    steps; centred: whether the dead zone is about zero, as of a voltage, or follows the command as
    play does, as of a position.
    """
    length = len(history)
    # Rings of 2048 steps hold 0.1 s: no delay of this rig is longer.
    history[count % length] = command
    steps_back = (drive.delay + computation_delay) / STEP
    whole = int(steps_back)
    fraction = steps_back - whole
    # A delay of a fraction of a step is interpolated, so it is continuous in its parameter.
    newer, older = history[(count - whole) % length], history[(count - whole - 1) % length]
    wanted = newer + fraction * (older - newer)
    if drive.dead_zone > 0.0:
        if centred:
            wanted = (
                0.0
                if abs(wanted) <= drive.dead_zone
                else wanted - math.copysign(drive.dead_zone, wanted)
            )
        else:
            if wanted > memory[2] + drive.dead_zone:
                memory[2] = wanted - drive.dead_zone
            elif wanted < memory[2] - drive.dead_zone:
                memory[2] = wanted + drive.dead_zone
            wanted = memory[2]
    # Gain after the dead zone, so that the zone is in the command's own unit.
    wanted *= drive.gain * (1.0 - drive.fading * time / 60.0)
    wanted = max(-drive.limit, min(drive.limit, wanted))
    most = drive.rate * STEP
    # Rate limit before the lag, as an amplifier limits its input.
    memory[0] += max(-most, min(most, wanted - memory[0]))
    if drive.lag > 0.0:
        memory[1] += STEP / (drive.lag + STEP) * (memory[0] - memory[1])
    else:
        memory[1] = memory[0]
    return memory[1]


@numba.njit(cache=True, nogil=True)
def hydraulic_step(cylinder: Hydraulic, z: Array, plate: float, command: float) -> float:
    """Advance a cylinder by one step and return the next position of its piston, m.

    z: states of the identified response in observer form, shape (4,); plate: position of the
    piston, m.
    """
    # H(s) of thesis Eq. 6.2. A slower cylinder scales its frequencies: a_k → a_k w^(n − k).
    w = 1.0 - cylinder.slowdown
    a3, a2, a1, a0 = 165.9 * w, 6674.0 * w**2, 8.598e4 * w**3, 6.281e5 * w**4
    b2, b1, b0 = 1817.0 * w**2, 7.719e4 * w**3, 6.243e5 * w**4
    scale = 6.281e5 / 6.243e5
    z0, z1, z2, z3 = z[0], z[1], z[2], z[3]
    # Midpoint rule: a half step with the slope of the start, a whole one with that of the middle.
    for half in range(2):
        # Observer form: the output is the first state.
        d0 = z1 - a3 * z0
        d1 = z2 - a2 * z0 + scale * b2 * command
        d2 = z3 - a1 * z0 + scale * b1 * command
        d3 = -a0 * z0 + scale * b0 * command
        share = 0.5 * STEP if half == 0 else STEP
        z0, z1, z2, z3 = z[0] + share * d0, z[1] + share * d1, z[2] + share * d2, z[3] + share * d3
    z[0], z[1], z[2], z[3] = z0, z1, z2, z3
    # The servo valve saturates: the piston follows the linear response up to its largest speed.
    most = cylinder.speed * STEP
    # A creeping piston drifts however it is commanded, as a leaking valve makes it.
    return plate + max(-most, min(most, z0 - plate)) + cylinder.creep * STEP


@numba.njit(cache=True, nogil=True)
def take_up(cylinder: Hydraulic, plate: float, piston: float) -> float:
    """Return the position of a plate that a piston with play moves, m."""
    if piston - plate > 0.5 * cylinder.play:
        return piston - 0.5 * cylinder.play
    if plate - piston > 0.5 * cylinder.play:
        return piston + 0.5 * cylinder.play
    return plate


@numba.njit(cache=True, nogil=True)
def settle(z: Array, position: float, cylinder: Hydraulic) -> None:
    """Set the states of a cylinder at rest to a position, m."""
    w, scale = 1.0 - cylinder.slowdown, 6.281e5 / 6.243e5
    # Steady state of the observer form: every derivative of `hydraulic_step` is zero.
    a3, a2, a1 = 165.9 * w, 6674.0 * w**2, 8.598e4 * w**3
    z[0], z[1] = position, a3 * position
    z[2] = a2 * position - scale * 1817.0 * w**2 * position
    z[3] = a1 * position - scale * 7.719e4 * w**3 * position


@numba.njit(cache=True, nogil=True)
def reading(
    sensor: Sensor,
    value: float,
    acceleration: float,
    history: Array,
    memory: Array,
    tick: int,
    noise: float,
) -> float:
    """Return one sample of a sensor, in its unit.

    history: past values, a ring of ticks; memory: output of the lag, shape (1,); noise: of this
    sample.
    """
    length = len(history)
    if tick == 0:
        history[:] = value
        memory[0] = value
    history[tick % length] = value
    # Sensors are sampled once per tick of 1 ms.
    ticks_back = sensor.delay / 1e-3
    whole = int(ticks_back)
    fraction = ticks_back - whole
    newer, older = history[(tick - whole) % length], history[(tick - whole - 1) % length]
    delayed = newer + fraction * (older - newer)
    memory[0] = (
        memory[0] + (1.0 - math.exp(-1e-3 / sensor.lag)) * (delayed - memory[0])
        if sensor.lag > 0.0
        else delayed
    )
    x = memory[0]
    x = (
        sensor.gain * x * (1.0 - sensor.curvature * (x / sensor.full_scale) ** 2)
        + sensor.offset
        + sensor.drift * tick * 1e-3
        + sensor.crosstalk * acceleration
    )
    x += noise
    # Noise before rounding: it dithers the converter.
    return round(x / sensor.bit) * sensor.bit if sensor.bit > 0.0 else x


class ReferenceBody(NamedTuple):
    """State of the rig, changed in place.

    Attributes
    ----------
    motion : ndarray
        Motion of the rig, entries as named below, shape (19,).
    histories : ndarray
        Rings of past commands: voltage, ground, structure, shape (3, 2048).
    memories : ndarray
        Rate limit, lag and dead zone of these commands, shape (3, 3).
    sensed : ndarray
        Rings of past values of the sensors, shape (4, 64).
    lags : ndarray
        Lags of the sensors, shape (4, 1).
    ground_z, structure_z : ndarray
        States of the hydraulics, shape (4,).
    """

    motion: Array
    histories: Array
    memories: Array
    sensed: Array
    lags: Array
    ground_z: Array
    structure_z: Array


# Entries of `ReferenceBody.motion`, in m, N and s.
GROUND, STRUCTURE, POSITION, VELOCITY, FORCE = range(5)  # Plates, carriage, motor force.
RELAXED, BRISTLE_RAIL, BRISTLE_ROD = range(5, 8)  # Relaxed deflection of the tyre, bristles.
RAIL_END, ROD_END = range(8, 10)  # Trailing ends of the play of rail and rod.
GROUND_YIELD, STRUCTURE_YIELD = range(10, 12)  # Yielding of the plates.
GROUND_BEFORE, STRUCTURE_BEFORE = range(12, 14)  # The same a step ago.
ACCELERATION, CELL_FORCE, STEPS = range(
    14, 17
)  # Acceleration of the carriage, load cell, steps so far.
GROUND_PISTON, STRUCTURE_PISTON = range(17, 19)  # Pistons of the cylinders.


@numba.njit(cache=True, nogil=True)
def at_rest(
    truth: Truth, ground_command: float, structure_command: float, preload: float
) -> ReferenceBody:
    """Return the state before the first tick.

    Everything rests, the commands, m, have been constant for a long time, and tyre and motor carry
    the preload, N.
    """
    body = ReferenceBody(
        np.zeros(19),
        np.empty((3, 2048)),
        np.zeros((3, 3)),
        np.empty((4, 64)),
        np.zeros((4, 1)),
        np.zeros(4),
        np.zeros(4),
    )
    ground = ground_command * truth.ground.gain
    # The tyre carries the preload, so the carriage stands lower by its deflection.
    x = ground - preload / truth.tyre
    settle(body.ground_z, ground, truth.ground_hydraulic)
    settle(body.structure_z, x, truth.structure_hydraulic)
    # As if these commands had been held for longer than any delay.
    first = (preload / truth.motor_constant, ground_command, structure_command)
    for number in range(3):
        body.histories[number, :] = first[number]
    body.memories[0, 0] = body.memories[0, 1] = first[0] * truth.voltage.gain
    body.memories[1, 0] = body.memories[1, 1] = first[1] * truth.ground.gain
    body.memories[2, 0] = body.memories[2, 1] = first[2] * truth.structure.gain
    body.memories[1, 2], body.memories[2, 2] = first[1], first[2]
    motion = body.motion
    motion[GROUND], motion[STRUCTURE], motion[POSITION], motion[RAIL_END] = ground, x, x, x
    motion[FORCE] = motion[CELL_FORCE] = preload
    motion[GROUND_PISTON], motion[STRUCTURE_PISTON] = ground, x
    return body


@numba.njit(cache=True, nogil=True)
def true_values(body: ReferenceBody) -> tuple[float, float, float, float]:
    """Return the readings of ideal sensors: ground, structure and travel, m, and load cell, N."""
    motion = body.motion
    ground = motion[GROUND] + motion[GROUND_YIELD]
    structure = motion[STRUCTURE] + motion[STRUCTURE_YIELD]
    return ground, structure, structure - motion[POSITION], motion[CELL_FORCE]


@numba.njit(cache=True, nogil=True)
def sample(truth: Truth, body: ReferenceBody, tick: int, noise: Array, out: Array) -> None:
    """Write the samples of all sensors at a tick into `out`, shape (4,); noise: shape (4,)."""
    values = true_values(body)
    sensors = (truth.ground_lvdt, truth.structure_lvdt, truth.suspension_lvdt, truth.load_cell)
    for number in range(4):
        out[number] = reading(
            sensors[number],
            values[number],
            body.motion[ACCELERATION],
            body.sensed[number],
            body.lags[number],
            tick,
            noise[number],
        )


@numba.njit(cache=True, nogil=True)
def tyre_force(
    truth: Truth, deflection: float, squeeze: float, relaxed: float
) -> tuple[float, float]:
    """Return the force of the tyre, N, and its relaxed deflection after a step, m.

    deflection: m, positive in compression; squeeze: its rate, m/s.
    """
    # A hyperbola instead of max(deflection, 0): the contact sets in smoothly over `ONSET`. The
    # second term keeps the force at the working point, 4 mm, unchanged.
    contact = (
        0.5 * (deflection + math.sqrt(deflection * deflection + ONSET * ONSET))
        - 0.25 * ONSET**2 / 0.004
    )
    # Standard linear solid: a share of the stiffness relaxes towards the present deflection.
    relaxed += STEP / truth.relaxing_time * (contact - relaxed)
    tyre = truth.tyre * (contact * (1.0 + truth.tyre_hardening * contact))
    tyre += truth.relaxing * truth.tyre * (contact - relaxed)
    tyre += truth.tyre_damping * squeeze if deflection > 0.0 else 0.0
    # A tyre pushes only.
    return max(tyre, 0.0) if contact > 0.0 else 0.0, relaxed


@numba.njit(cache=True, nogil=True)
def end_of_play(play: float, position: float, end: float) -> tuple[float, bool, bool]:
    """Return the trailing end of a play, m, and whether friction is felt upwards and downwards."""
    end = max(min(end, position + 0.5 * play), position - 0.5 * play)
    return end, position - end >= 0.5 * play - 1e-12, end - position >= 0.5 * play - 1e-12


@numba.njit(cache=True, nogil=True)
def bristle_force(
    stiffness: float, mass: float, bristle: float, speed: float, bound: float
) -> tuple[float, float]:
    """Return the friction of a bristle, N, and its deflection after a step, m; bound: N.

    LuGre bristle (Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419):
    ż = v − σ |v| z / F, stepped implicitly, because σ is stiff; damping ratio 0.3 of mass on σ.
    """
    bent = (bristle + STEP * speed) / (1.0 + STEP * abs(speed) * stiffness / max(bound, 1e-3))
    rate = (bent - bristle) / STEP
    return stiffness * bent + 2.0 * math.sqrt(stiffness * mass) * 0.3 * rate, bent


@numba.njit(cache=True, nogil=True)
def drive_actuators(
    truth: Truth, body: ReferenceBody, commands: Array, time: float
) -> tuple[float, float, float]:
    """Advance the commands' paths and the pistons by one step.

    Returns the voltage, V, and the next positions of ground and structure plate, m.
    """
    motion, count, late = body.motion, int(body.motion[STEPS]), truth.computation_delay
    paths, rings = body.memories, body.histories
    voltage = pass_command(truth.voltage, paths[0], rings[0], count, commands[3], True, time, late)
    # The amplifier ends at ±10 V, the motor at ±1860 N.
    most = 1860.0 / truth.motor_constant
    voltage = max(-most, min(most, max(-10.0, min(10.0, voltage))))
    ground_command = pass_command(
        truth.ground, paths[1], rings[1], count, commands[0], False, time, late
    )
    structure_command = pass_command(
        truth.structure, paths[2], rings[2], count, commands[1], False, time, late
    )
    motion[STEPS] = count + 1
    motion[GROUND_PISTON] = hydraulic_step(
        truth.ground_hydraulic, body.ground_z, motion[GROUND_PISTON], ground_command
    )
    motion[STRUCTURE_PISTON] = hydraulic_step(
        truth.structure_hydraulic, body.structure_z, motion[STRUCTURE_PISTON], structure_command
    )
    ground = take_up(truth.ground_hydraulic, motion[GROUND], motion[GROUND_PISTON])
    structure = take_up(truth.structure_hydraulic, motion[STRUCTURE], motion[STRUCTURE_PISTON])
    return voltage, ground, structure


@numba.njit(cache=True, nogil=True)
def friction_bounds(truth: Truth, motion: Array, sliding: float, rod_position: float) -> Bounds:
    """Return the bounds of dry friction, N: the rail's up and down, the rod's up and down.

    sliding, rod_position: velocity, m/s, and position, m, of the plate against the carriage.
    """
    x = motion[POSITION]
    rail_up, rail_down = dry_bounds(truth.rail, motion[VELOCITY], x)
    rod_up, rod_down = dry_bounds(truth.motor, sliding, rod_position)
    # Friction behind a play is felt only at the play's ends.
    if truth.rail.play > 0.0:
        motion[RAIL_END], up, down = end_of_play(truth.rail.play, x, motion[RAIL_END])
        rail_up, rail_down = rail_up if up else 0.0, rail_down if down else 0.0
    if truth.motor.play > 0.0:
        motion[ROD_END], up, down = end_of_play(truth.motor.play, rod_position, motion[ROD_END])
        rod_up, rod_down = rod_up if up else 0.0, rod_down if down else 0.0
    return rail_up, rail_down, rod_up, rod_down


@numba.njit(cache=True, nogil=True)
def move_carriage(
    truth: Truth, motion: Array, plate: float, push: float, bounds: Bounds
) -> tuple[float, float, float]:
    """Return the next velocity of the carriage, m/s, and the rod's viscous and dry friction, N.

    plate: velocity of the structure plate, m/s; push: all other forces on the carriage, N; bounds:
    of dry friction, by `friction_bounds`.
    """
    v, (rail_up, rail_down, rod_up, rod_down) = motion[VELOCITY], bounds
    if truth.bristle <= 0.0:
        return slide(truth, v, plate, push, bounds)
    sliding = plate - v
    viscous = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
    # The bristle sees the bound of the direction in which it is bent further.
    bound = rail_up if v > 0.0 else rail_down
    rail_force, motion[BRISTLE_RAIL] = bristle_force(
        truth.bristle, truth.mass, motion[BRISTLE_RAIL], v, bound
    )
    bound = rod_up if sliding > 0.0 else rod_down
    rod_force, motion[BRISTLE_ROD] = bristle_force(
        truth.bristle, truth.mass, motion[BRISTLE_ROD], sliding, bound
    )
    v += STEP / truth.mass * (push + viscous - rail_force + rod_force)
    return v, viscous, rod_force


@numba.njit(cache=True, nogil=True)
def advance_step(truth: Truth, body: ReferenceBody, commands: Array, time: float) -> None:
    """Advance the rig by one step; arguments as in `advance`."""
    motion, yielding = body.motion, truth.structure_hydraulic.compliance > 0.0
    voltage, next_ground, next_structure = drive_actuators(truth, body, commands, time)
    ground, structure, x, v = motion[GROUND], motion[STRUCTURE], motion[POSITION], motion[VELOCITY]
    ground_yield, structure_yield = motion[GROUND_YIELD], motion[STRUCTURE_YIELD]
    # Forces on the carriage at the old position, with the velocities over this step. Rates over
    # this step come from differences, so yielding and play are included.
    squeeze = (next_ground - ground + ground_yield - motion[GROUND_BEFORE]) / STEP - v
    tyre, motion[RELAXED] = tyre_force(truth, ground + ground_yield - x, squeeze, motion[RELAXED])
    plate = (next_structure - structure + structure_yield - motion[STRUCTURE_BEFORE]) / STEP
    rod_position = structure + structure_yield - x
    ripple = truth.ripple * math.sin(
        2.0 * math.pi * rod_position / truth.ripple_pitch + truth.ripple_phase
    )
    bounds = friction_bounds(truth, motion, plate - v, rod_position)
    smooth_rail = truth.rail.viscous * v + truth.rail.drag * v * abs(v)
    carriage_force = tyre - motion[FORCE] - ripple - smooth_rail
    unloaded, load = (next_structure - structure) / STEP, 0.0
    if yielding:
        pull = motion[FORCE] + ripple
        load = plate_under_load(truth, v, unloaded, structure_yield, pull, carriage_force, bounds)
        compression = truth.structure_hydraulic.compliance * load - structure_yield
        plate = unloaded + compression / (truth.load_lag + STEP)
    motion[VELOCITY], smooth_rod, rod_force = move_carriage(
        truth, motion, plate, carriage_force, bounds
    )
    # The acceleration feeds the crosstalk of the load cell.
    motion[ACCELERATION] = (motion[VELOCITY] - v) / STEP
    motion[POSITION] += STEP * motion[VELOCITY]
    # Exact step of the motor's lag, with the voltage constant over it.
    motion[FORCE] += (1.0 - math.exp(-STEP / truth.electrical_lag)) * (
        truth.motor_constant * voltage - motion[FORCE]
    )
    motion[CELL_FORCE] = motion[FORCE] + ripple - smooth_rod - rod_force
    # The yielding of a step ago gives the plate's velocity in the next step.
    motion[GROUND_BEFORE], motion[STRUCTURE_BEFORE] = ground_yield, structure_yield
    motion[GROUND_YIELD] += (
        STEP / (truth.load_lag + STEP) * (-truth.ground_hydraulic.compliance * tyre - ground_yield)
    )
    if yielding:
        motion[STRUCTURE_YIELD] += STEP * (plate - unloaded)
        # If rod and rail both stick, only the deflection of the plate determines the force.
        motion[CELL_FORCE] = load
    motion[GROUND], motion[STRUCTURE] = next_ground, next_structure


@numba.njit(cache=True, nogil=True)
def advance(truth: Truth, body: ReferenceBody, commands: Array, time: float) -> None:
    """Advance the rig by one tick.

    commands: ground, m, structure, m, force, N, which is ignored, and voltage, V, shape (4,); time:
    of the tick, s.
    """
    for _ in range(round(1e-3 / STEP)):
        advance_step(truth, body, commands, time)
