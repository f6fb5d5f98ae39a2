"""Conditioning of a command before it acts, and the kinds of effect on commands and sensors.

With the command u[k] at step k, the order of operations is

    limits      u ← clip(u, low, high)
    delay       u ← u[k − delay]
    deadband    u ← sign(u)·max(|u| − band, 0)  (amplifier), or a backlash of ±band (valve)
    gain        u ← gain·(1 ± uneven)·u, by the direction of u
    saturation  u ← clip(u, −saturation, saturation)
    rate limit  y ← y + clip(u − y, −rate, rate)
    lag         z ← z + (1 − exp(−h/T))·(y − z)

All of them are neutral in the nominal machine, whose commands pass unchanged.
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
from rigtwin.components.effect import Context, Guess, Kind, Starts
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
from rigtwin.components.servo import PUSHERS, Pusher, Servo, VelocityServo
from rigtwin.components.starts import at_limits, fixed_starts, late_or_early_starts, late_starts
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delay_sample, ring

ACTS_LATE = "the force acts later than it is recorded, as that of an actuator behind its command"


class Actuator(NamedTuple):
    """Conditioning of a command as compiled code takes it, for one timestep."""

    neutral: bool  # Whether a command within its limits passes unchanged.
    low: float  # Smallest command.
    high: float  # Largest command.
    delay: float  # Delay in timesteps.
    deadband: float  # Half-width of the deadband, in the command's unit.
    zero_centred: bool  # Deadband about zero (amplifier) or about the last output (valve overlap).
    reach: float  # Widening of the deadband to positive commands, and narrowing to negative ones.
    gain: float  # Mean gain of both directions.
    uneven: float  # Share of the gain added for positive commands and taken from negative ones.
    saturation: float  # Largest magnitude after the gain.
    rate: float  # Largest change in a timestep.
    share: float  # Share of the remaining distance that the lag covers in a timestep.


class ActuatorState(NamedTuple):
    """State of a command's conditioning; changed in place."""

    history: Array  # Past commands, a ring buffer.
    memory: Array  # Position in the ring, output of deadband, of rate limit, of lag; shape (4,).


def actuator(component: Motor | Cylinder | Pusher, computer: Computer, timestep: float) -> Actuator:
    """Return the conditioning of an actuator's command.

    Parameters
    ----------
    component
        Motor (voltage), cylinder (position), force actuator or servo.
    computer
        Computer, whose delay adds to the actuator's.
    timestep
        Step at which the command is conditioned, s.

    Returns
    -------
    Actuator
        Conditioning, discretised for that step.
    """
    # A cylinder has a speed limit of its own, behind its dynamics. The deadband of a servo lies in
    # its position error, in `servo`.
    delay = component.delay + computer.delay
    rate = UNLIMITED if isinstance(component, Cylinder) else component.rate_limit
    uneven = 0.5 * component.gain_asymmetry if isinstance(component, ForceActuator) else 0.0
    reach = 0.5 * component.deadband_asymmetry if isinstance(component, ForceActuator) else 0.0
    deadband, saturation = 0.0, UNLIMITED
    if not isinstance(component, Servo):
        deadband, saturation = component.deadband, component.saturation
    neutral = (delay, deadband, reach, component.gain, uneven, saturation, rate, component.lag) == (
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        UNLIMITED,
        UNLIMITED,
        0.0,
    )
    share = 1.0 if component.lag == 0.0 else 1.0 - math.exp(-timestep / component.lag)
    return Actuator(
        neutral=neutral,
        low=component.command_low if isinstance(component, PUSHERS) else -UNLIMITED,
        high=component.command_high if isinstance(component, PUSHERS) else UNLIMITED,
        delay=delay / timestep,
        deadband=deadband,
        zero_centred=not isinstance(component, Cylinder | Servo),
        reach=reach,
        gain=component.gain,
        uneven=uneven,
        saturation=saturation,
        rate=rate * timestep if rate < UNLIMITED else UNLIMITED,
        share=share,
    )


def hold(conditioning: Actuator, command: float) -> ActuatorState:
    """Return the state after a command, in its unit, has been held for long."""
    command = min(max(command, conditioning.low), conditioning.high)
    state = ActuatorState(ring(conditioning.delay, command), np.array([0.0, command, 0.0, 0.0]))
    state.memory[2:] = limit(conditioning, state, command)
    return state


@compilable
def limit(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """Apply deadband, gain and saturation to a command; advance the deadband's state."""
    band = conditioning.deadband
    if conditioning.zero_centred:
        # The edge of the side on which the command lies: band ± reach.
        edge = max(band + math.copysign(conditioning.reach, command * conditioning.reach), 0.0)
        passed = math.copysign(max(abs(command) - edge, 0.0), command)
    else:
        # Play operator: the output moves only once the command has crossed the overlap.
        passed = min(max(state.memory[1], command - band), command + band)
        state.memory[1] = passed
    uneven = conditioning.uneven
    scaled = conditioning.gain * passed * (1.0 + (uneven if passed > 0.0 else -uneven))
    return min(max(scaled, -conditioning.saturation), conditioning.saturation)


@compilable
def condition(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """Return the conditioned command over the coming timestep; advance the state by one timestep.

    Parameters
    ----------
    conditioning
        Conditioning of the command.
    state
        State of the conditioning, changed in place.
    command
        Command of this timestep, in its unit.
    """
    command = min(max(command, conditioning.low), conditioning.high)
    # The usual case in a search for other effects: skip the work, but keep the last output.
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
    """Condition the commands of a whole test.

    Parameters
    ----------
    conditioning
        Conditioning of the command, discretised for a step.
    state
        State of the conditioning, changed in place.
    commands
        Command at each tick, shape (ticks,), held from tick to tick.
    steps
        Steps per tick.
    out
        Conditioned command, written, shape (steps · ticks,).
    """
    for tick in range(len(commands)):
        for step in range(steps):
            out[tick * steps + step] = condition(conditioning, state, commands[tick])


BELOW = (0.95, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1)
"""Starting values of a lower limit, as shares of the known limit."""


def _speed_limit(context: Context) -> Starts:
    known = [share * context.component(Cylinder).speed_limit for share in BELOW]
    return at_limits([min(pair) for pair in zip(context.swing.fastest, known, strict=True)], 1e-6)


def _deadband(context: Context) -> Starts:
    placed = context.effect.of in (PositionActuator, Servo)
    size = context.scales.stroke if placed else max(context.swing.largest[0], 1e-12)
    return Starts.single([share * size for share in (0.003, 0.01, 0.03, 0.1, 0.3)], 0.001 * size)


def _uneven_deadband(context: Context) -> Starts:
    """Return starts of a deadband that lies on one side only."""
    size = max(context.swing.largest[0], 1e-12)
    starts = [
        (2.0 * sign * share * size, share * size)
        for share in (0.01, 0.03, 0.1, 0.3)
        for sign in (-1.0, 1.0)
    ]
    return Starts(tuple(starts), (0.001 * size, 0.001 * size))


def _yielding(context: Context) -> Starts:
    # A plate's zero was set without load, or under about the load that it bears in the test.
    starts = tuple(product((2e-7, 1e-6, 5e-6), (0.0, 0.005), (0.0, context.scales.force)))
    return Starts(starts, (2e-8, 2e-4, 20.0))


def _offset(context: Context) -> Starts:
    sizes = {ForceSensor: context.scales.force, VelocitySensor: context.scales.speed}
    size = sizes.get(context.effect.of, context.scales.stroke)
    return Starts.single([share * size for share in (-0.2, -0.02, 0.02, 0.2)], 0.002 * size)


def _drift(context: Context) -> Starts:
    sizes = {ForceSensor: context.scales.force, VelocitySensor: context.scales.speed}
    size = sizes.get(context.effect.of, context.scales.stroke) / context.scales.time
    return Starts.single([share * size for share in (-2e-3, -2e-4, 2e-4, 2e-3)], 2e-5 * size)


def _two_lags(context: Context) -> Starts:
    time = context.scales.time
    sizes = [share * time for share in (0.005, 0.02, 0.06, 0.2)]
    starts = tuple((long, ratio * long) for long in sizes for ratio in (0.2, 0.7))
    return Starts(starts, (0.002 * time, 0.002 * time))


def _resonance(context: Context) -> Starts:
    # Natural frequencies are tried from about that of the motion upwards.
    slowest = 1.0 / (2.0 * math.pi * context.scales.time)
    speeds = [slowest * ratio for ratio in (1.5, 4.0, 10.0, 30.0, 80.0)]
    return Starts(tuple(product(speeds, (0.15, 0.5, 0.9))), (0.02 * slowest, 0.01))


def _for_types(guess: Guess | None, *types: type) -> dict[type, Guess | None]:
    """Return the same starts for several types of component; None: read off the signals."""
    return dict.fromkeys(types, guess)


RIG = (Motor, Cylinder, *DECLARED)
LIMITED_COMMANDS = (ForceActuator, VelocityServo, PositionActuator)
DESCRIBED_ACTUATORS = (*LIMITED_COMMANDS, Servo)
DESCRIBED_SENSORS = (PositionSensor, VelocitySensor, ForceSensor)
DESCRIBED = (*DESCRIBED_ACTUATORS, *DESCRIBED_SENSORS)
KINDS = (
    Kind(
        "gain",
        "gain",
        ("gain",),
        "output multiplied by this factor",
        _for_types(fixed_starts((0.8, 0.93, 1.07, 1.2), 0.004), *RIG, *DESCRIBED),
    ),
    Kind(
        "gain_asymmetry",
        "gain that differs by direction",
        ("gain_asymmetry",),
        "output greater for positive commands than for negative, by this share",
        _for_types(fixed_starts((-0.3, -0.07, 0.07, 0.3), 0.004), ForceActuator),
        "output smaller for positive commands than for negative, by this share",
    ),
    Kind(
        "lag",
        "lag",
        ("lag",),
        "an additional first-order lag",
        _for_types(fixed_starts((5e-4, 2e-3, 6e-3, 2e-2, 5e-2), 1e-4), *RIG)
        | _for_types(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "delay",
        "delay",
        ("delay",),
        "an additional delay",
        _for_types(fixed_starts((5e-4, 2e-3, 5e-3, 1e-2, 2e-2), 1e-4), *RIG, Computer)
        | _for_types(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "saturation",
        "saturation",
        ("saturation",),
        "command limited to this magnitude",
        _for_types(lambda context: at_limits(context.swing.largest, 1e-6), Motor, Cylinder)
        | _for_types(lambda context: at_limits(context.swing.largest, 1e-9), *LIMITED_COMMANDS),
    ),
    Kind(
        "deadband",
        "deadband",
        ("deadband",),
        "command without effect within this band",
        {
            Motor: fixed_starts((0.02, 0.08, 0.3), 0.004),
            Cylinder: fixed_starts((1e-4, 5e-4, 2e-3, 6e-3), 2e-5),
            **_for_types(_deadband, *DESCRIBED_ACTUATORS),
        },
    ),
    Kind(
        "deadband_asymmetry",
        "deadband that differs by direction",
        ("deadband_asymmetry", "deadband"),
        "command without effect within a band that reaches further to positive commands",
        _for_types(_uneven_deadband, ForceActuator),
        "command without effect within a band that reaches further to negative commands",
    ),
    Kind(
        "rate_limit",
        "rate limit",
        ("rate_limit",),
        "command's rate limited",
        {
            Motor: lambda context: at_limits(context.swing.fastest, 1e-6),
            **_for_types(
                lambda context: at_limits(context.swing.fastest, 1e-9), *DESCRIBED_ACTUATORS
            ),
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
            **_for_types(_offset, *DESCRIBED_SENSORS, PositionActuator),
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
            **_for_types(_drift, *DESCRIBED_SENSORS),
        },
    ),
    Kind(
        "hum",
        "mains hum",
        ("hum",),
        "amplitude of the mains line",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "noise",
        "white noise",
        ("white",),
        "white noise, rms",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "quantisation",
        "quantisation",
        ("resolution",),
        "size of one bit",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
)
