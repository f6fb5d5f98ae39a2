"""Paths of the commands, hydraulic cylinders and sensors of the referee's rig.

The hydraulics are a chain of integrators, advanced by the midpoint rule.
"""

from __future__ import annotations

import math

import numba

from referee.reference_truth import STEP, Array, CommandPath, Hydraulic, Sensor


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
