"""What becomes of a command or a signal on its way: delay, deadband, gain, saturation, rate limit,
lag, in that order.

All of them are neutral in the nominal machine, whose commands pass as they are.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.actuators import ForceActuator, PositionActuator
from rigtwin.components.computer import Computer
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.effect import Context, Guess, Kind, Starts, at_limits, fixed_starts
from rigtwin.components.guide import late_or_early_starts, late_starts
from rigtwin.components.motor import Motor
from rigtwin.components.quantity import UNLIMITED
from rigtwin.components.sensors import (
    DECLARED,
    ForceSensor,
    LoadCell,
    Lvdt,
    PositionSensor,
    VelocitySensor,
)
from rigtwin.components.servo import PUSHERS, Pusher, Servo
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delay_sample, ring

ACTS_LATE = "the force acts later than it is recorded, as that of an actuator behind its command"


class Actuator(NamedTuple):
    """low, high: of the command. delay: in timesteps. zero_centred: whether the deadband lies about
    zero (an amplifier) or about the last position (a valve's overlap). reach: by how much further
    it goes to positive commands, and less far to negative ones. uneven: share of the gain that
    positive commands have more and negative ones less. rate: greatest change a timestep.
    share: of the way to its input that the lag goes in a timestep."""

    neutral: bool
    low: float
    high: float
    delay: float
    deadband: float
    zero_centred: bool
    reach: float
    gain: float
    uneven: float
    saturation: float
    rate: float
    share: float


class ActuatorState(NamedTuple):
    """history: past commands, a ring; memory: where the ring stands, the deadband's output, the
    rate limit's, the lag's."""

    history: Array
    memory: Array


def actuator(of: Motor | Cylinder | Pusher, computer: Computer, timestep: float) -> Actuator:
    """The conditioning of a motor's voltage, a cylinder's position or a force actuator's or servo's
    command. A servo's deadband is of its error, not of its command."""
    delay = of.delay + computer.delay
    rate = UNLIMITED if isinstance(of, Cylinder) else of.rate_limit
    uneven = 0.5 * of.gain_asymmetry if isinstance(of, ForceActuator) else 0.0
    reach = 0.5 * of.deadband_asymmetry if isinstance(of, ForceActuator) else 0.0
    deadband, saturation = (
        (0.0, UNLIMITED) if isinstance(of, Servo) else (of.deadband, of.saturation)
    )
    neutral = (delay, deadband, reach, of.gain, uneven, saturation, rate, of.lag) == (
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        UNLIMITED,
        UNLIMITED,
        0.0,
    )
    share = 1.0 if of.lag == 0.0 else 1.0 - math.exp(-timestep / of.lag)
    return Actuator(
        neutral=neutral,
        low=of.command_low if isinstance(of, PUSHERS) else -UNLIMITED,
        high=of.command_high if isinstance(of, PUSHERS) else UNLIMITED,
        delay=delay / timestep,
        deadband=deadband,
        zero_centred=not isinstance(of, Cylinder | Servo),
        reach=reach,
        gain=of.gain,
        uneven=uneven,
        saturation=saturation,
        rate=rate * timestep if rate < UNLIMITED else UNLIMITED,
        share=share,
    )


def hold(conditioning: Actuator, command: float) -> ActuatorState:
    """The state in which `command` has been held for long."""
    command = min(max(command, conditioning.low), conditioning.high)
    state = ActuatorState(ring(conditioning.delay, command), np.array([0.0, command, 0.0, 0.0]))
    state.memory[2:] = limit(conditioning, state, command)
    return state


@compilable
def limit(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """Deadband, gain and saturation."""
    band = conditioning.deadband
    if conditioning.zero_centred:
        edge = max(band + math.copysign(conditioning.reach, command * conditioning.reach), 0.0)
        passed = math.copysign(max(abs(command) - edge, 0.0), command)
    else:
        passed = min(max(state.memory[1], command - band), command + band)
        state.memory[1] = passed
    uneven = conditioning.uneven
    scaled = conditioning.gain * passed * (1.0 + (uneven if passed > 0.0 else -uneven))
    return min(max(scaled, -conditioning.saturation), conditioning.saturation)


@compilable
def condition(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """What acts over the coming timestep. Advances the state by one timestep."""
    command = min(max(command, conditioning.low), conditioning.high)
    if conditioning.neutral:
        state.memory[3] = command
        return command
    wanted = limit(
        conditioning, state, delay_sample(state.history, state.memory, conditioning.delay, command)
    )
    before = state.memory[2]
    state.memory[2] = before + min(max(wanted - before, -conditioning.rate), conditioning.rate)
    state.memory[3] += conditioning.share * (state.memory[2] - state.memory[3])
    return state.memory[3]


@kernel
def condition_all(
    conditioning: Actuator, state: ActuatorState, commands: Array, steps: int, out: Array
) -> None:
    """What acts at each step, written to `out`, shape (steps · ticks,). commands: shape
    (ticks,)."""
    for tick in range(len(commands)):
        for step in range(steps):
            out[tick * steps + step] = condition(conditioning, state, commands[tick])


BELOW = (0.95, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1)
"""Shares of a known limit at which a lower one is looked for."""


def _speed_limit(at: Context) -> Starts:
    known = [share * getattr(at.plant, at.effect.group).speed_limit for share in BELOW]
    return at_limits([min(pair) for pair in zip(at.swing.fastest, known, strict=True)], 1e-6)


def _deadband(at: Context) -> Starts:
    placed = at.effect.of in (PositionActuator, Servo)
    size = at.scales.stroke if placed else max(at.swing.largest[0], 1e-12)
    return Starts.single([share * size for share in (0.003, 0.01, 0.03, 0.1, 0.3)], 0.001 * size)


def _uneven_deadband(at: Context) -> Starts:
    """Of which one side alone, or most of it, has none."""
    size = max(at.swing.largest[0], 1e-12)
    starts = [
        (2.0 * sign * share * size, share * size)
        for share in (0.01, 0.03, 0.1, 0.3)
        for sign in (-1.0, 1.0)
    ]
    return Starts(tuple(starts), (0.001 * size, 0.001 * size))


def _yielding(at: Context) -> Starts:
    # A plate is set to zero without load, or under about the load that it bears in the test.
    starts = tuple(product((2e-7, 1e-6, 5e-6), (0.0, 0.005), (0.0, at.scales.force)))
    return Starts(starts, (2e-8, 2e-4, 20.0))


def _offset(at: Context) -> Starts:
    sizes = {ForceSensor: at.scales.force, VelocitySensor: at.scales.speed}
    size = sizes.get(at.effect.of, at.scales.stroke)
    return Starts.single([share * size for share in (-0.2, -0.02, 0.02, 0.2)], 0.002 * size)


def _drift(at: Context) -> Starts:
    sizes = {ForceSensor: at.scales.force, VelocitySensor: at.scales.speed}
    size = sizes.get(at.effect.of, at.scales.stroke) / at.scales.time
    return Starts.single([share * size for share in (-2e-3, -2e-4, 2e-4, 2e-3)], 2e-5 * size)


def _two_lags(at: Context) -> Starts:
    time = at.scales.time
    sizes = [share * time for share in (0.005, 0.02, 0.06, 0.2)]
    starts = tuple((long, ratio * long) for long in sizes for ratio in (0.2, 0.7))
    return Starts(starts, (0.002 * time, 0.002 * time))


def _resonance(at: Context) -> Starts:
    slowest = 1.0 / (2.0 * math.pi * at.scales.time)
    speeds = [slowest * ratio for ratio in (1.5, 4.0, 10.0, 30.0, 80.0)]
    return Starts(tuple(product(speeds, (0.15, 0.5, 0.9))), (0.02 * slowest, 0.01))


def _each(guess: Guess | None, *types: type) -> dict[type, Guess | None]:
    return dict.fromkeys(types, guess)


RIG = (Motor, Cylinder, *DECLARED)
LIMITED_COMMANDS = (ForceActuator, PositionActuator)
DESCRIBED_ACTUATORS = (*LIMITED_COMMANDS, Servo)
DESCRIBED_SENSORS = (PositionSensor, VelocitySensor, ForceSensor)
DESCRIBED = (*DESCRIBED_ACTUATORS, *DESCRIBED_SENSORS)
KINDS = (
    Kind(
        "gain",
        "gain",
        ("gain",),
        "output by this factor",
        _each(fixed_starts((0.8, 0.93, 1.07, 1.2), 0.004), *RIG, *DESCRIBED),
    ),
    Kind(
        "gain_asymmetry",
        "gain that differs by direction",
        ("gain_asymmetry",),
        "output greater for positive commands than for negative, by this share",
        _each(fixed_starts((-0.3, -0.07, 0.07, 0.3), 0.004), ForceActuator),
        "output smaller for positive commands than for negative, by this share",
    ),
    Kind(
        "lag",
        "lag",
        ("lag",),
        "a first-order lag more",
        _each(fixed_starts((5e-4, 2e-3, 6e-3, 2e-2, 5e-2), 1e-4), *RIG)
        | _each(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "delay",
        "delay",
        ("delay",),
        "a delay more",
        _each(fixed_starts((5e-4, 2e-3, 5e-3, 1e-2, 2e-2), 1e-4), *RIG, Computer)
        | _each(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "saturation",
        "saturation",
        ("saturation",),
        "command limited to this magnitude",
        _each(lambda at: at_limits(at.swing.largest, 1e-6), Motor, Cylinder)
        | _each(lambda at: at_limits(at.swing.largest, 1e-9), *LIMITED_COMMANDS),
    ),
    Kind(
        "deadband",
        "deadband",
        ("deadband",),
        "command without effect within this band",
        {
            Motor: fixed_starts((0.02, 0.08, 0.3), 0.004),
            Cylinder: fixed_starts((1e-4, 5e-4, 2e-3, 6e-3), 2e-5),
            **_each(_deadband, *DESCRIBED_ACTUATORS),
        },
    ),
    Kind(
        "deadband_asymmetry",
        "deadband that differs by direction",
        ("deadband_asymmetry", "deadband"),
        "command without effect within a band that reaches further to positive commands",
        _each(_uneven_deadband, ForceActuator),
        "command without effect within a band that reaches further to negative commands",
    ),
    Kind(
        "rate_limit",
        "rate limit",
        ("rate_limit",),
        "command's rate limited",
        {
            Motor: lambda at: at_limits(at.swing.fastest, 1e-6),
            **_each(lambda at: at_limits(at.swing.fastest, 1e-9), *DESCRIBED_ACTUATORS),
        },
    ),
    Kind("rate_limit", "rate limit", ("speed_limit",), "speed limited", {Cylinder: _speed_limit}),
    Kind(
        "compliance",
        "compliance",
        ("compliance", "yield_lag", "zero_load"),
        "yields under load, at once or a little later",
        {Cylinder: _yielding},
        nuisances=("zero_load",),
    ),
    Kind(
        "backlash",
        "backlash",
        ("backlash",),
        "a play between piston and plate",
        {Cylinder: fixed_starts((1e-4, 3e-4, 1e-3, 3e-3, 1e-2), 4e-5)},
    ),
    Kind(
        "two_lags",
        "pair of lags",
        ("lag", "second_lag"),
        "two first-order lags, one after the other",
        {PositionActuator: _two_lags},
    ),
    Kind(
        "resonance",
        "natural frequency",
        ("natural_frequency", "damping_ratio"),
        "follows as an underdamped system of second order",
        {PositionActuator: _resonance},
    ),
    Kind(
        "offset",
        "offset",
        ("offset",),
        "output displaced",
        {
            Lvdt: fixed_starts((-2e-3, -3e-4, 3e-4, 2e-3), 1e-5),
            LoadCell: fixed_starts((-20.0, -4.0, 4.0, 20.0), 0.1),
            **_each(_offset, *DESCRIBED_SENSORS, PositionActuator),
        },
    ),
    Kind(
        "drift",
        "drift",
        ("drift",),
        "zero that moves with time, each second",
        {
            Lvdt: fixed_starts((-2e-4, -3e-5, 3e-5, 2e-4), 2e-6),
            LoadCell: fixed_starts((-2.0, -0.3, 0.3, 2.0), 0.02),
            **_each(_drift, *DESCRIBED_SENSORS),
        },
    ),
    Kind(
        "hum",
        "mains hum",
        ("hum",),
        "amplitude of the mains line",
        _each(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "noise",
        "white noise",
        ("white",),
        "white noise, rms",
        _each(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "quantisation",
        "quantisation",
        ("resolution",),
        "size of one bit",
        _each(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
)
