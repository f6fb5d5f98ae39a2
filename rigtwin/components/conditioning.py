"""Conditioning of a command before it acts.

With the command u[k] at step k, the order of operations is

    limits      u ← clip(u, low, high)
    delay       u ← u[k − delay]
    deadband    u ← sign(u)·max(|u| − band, 0)  (amplifier), or a backlash of ±band (valve)
    gain        u ← gain·(1 ± uneven)·(1 − curvature + curvature·|u|/full)·u, by the direction of u
    saturation  u ← clip(u, −saturation, saturation)
    rate limit  y ← y + clip(u − y, −rate, rate)
    lag         z ← z + (1 − exp(−h/T))·(y − z)

What acts over a step is the mean of the lag's output z over it. Its value at the end of the step
would act half a step early.

All of them are neutral in the nominal machine, whose commands pass unchanged.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.actuators import ForceActuator
from rigtwin.components.computer import Computer
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.motor import Motor
from rigtwin.components.quantity import UNLIMITED
from rigtwin.components.servo import PUSHERS, Pusher, Servo
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delay_sample, ring


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
    straight: float  # Share of the gain that is the same for all commands.
    curved: float  # Share of the gain that a command of 1 adds.
    saturation: float  # Largest magnitude after the gain.
    rate: float  # Largest change in a timestep.
    share: float  # Share of the remaining distance that the lag covers in a timestep.
    mean_share: float  # Share that it covers on average over the timestep.


class ActuatorState(NamedTuple):
    """State of a command's conditioning; changed in place."""

    history: Array  # Past commands, a ring buffer.
    memory: (
        Array  # Position in the ring, output of deadband, of rate limit, of lag, last output; (5,).
    )


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
    uneven = reach = curvature = 0.0
    full = 1.0
    if isinstance(component, ForceActuator):
        uneven, reach = 0.5 * component.gain_asymmetry, 0.5 * component.deadband_asymmetry
        curvature, full = component.curvature, component.full_command
    deadband, saturation = 0.0, UNLIMITED
    if not isinstance(component, Servo):
        deadband, saturation = component.deadband, component.saturation
    absent = (delay, deadband, reach, uneven, curvature, component.lag) == (0.0,) * 6
    neutral = absent and (component.gain, saturation, rate) == (1.0, UNLIMITED, UNLIMITED)
    share = mean_share = 1.0
    if component.lag > 0.0:
        steps = timestep / component.lag
        share = -math.expm1(-steps)
        mean_share = 1.0 - share / steps
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
        straight=1.0 - curvature,
        curved=curvature / full,
        saturation=saturation,
        rate=rate * timestep if rate < UNLIMITED else UNLIMITED,
        share=share,
        mean_share=mean_share,
    )


def hold(conditioning: Actuator, command: float) -> ActuatorState:
    """Return the state after a command, in its unit, has been held for long."""
    command = min(max(command, conditioning.low), conditioning.high)
    state = ActuatorState(
        ring(conditioning.delay, command), np.array([0.0, command, 0.0, 0.0, 0.0])
    )
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
    scaled *= conditioning.straight + conditioning.curved * abs(passed)
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
        state.memory[3] = state.memory[4] = command
        return command
    wanted = limit(
        conditioning, state, delay_sample(state.history, state.memory, conditioning.delay, command)
    )
    before = state.memory[2]
    state.memory[2] = before + min(max(wanted - before, -conditioning.rate), conditioning.rate)
    lacking = state.memory[2] - state.memory[3]
    state.memory[4] = state.memory[3] + conditioning.mean_share * lacking
    state.memory[3] += conditioning.share * lacking
    return state.memory[4]


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
