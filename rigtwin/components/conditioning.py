"""What becomes of an actuator's command before it acts: delay, deadband, gain, saturation, rate limit, lag, in that order.

All of them are neutral in the nominal rig, whose commands pass as they are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.parameters import UNLIMITED, Computer, Cylinder, Motor
from rigtwin.components.parts import ForceActuator
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.delay import delayed, ring


class Actuator(NamedTuple):
    """delay: in timesteps. zero_centred: whether the deadband lies about zero (an amplifier) or about the last position (a
    valve's overlap). rate: greatest change a timestep. share: of the way to its input that the lag goes in a timestep."""

    neutral: bool
    delay: float
    deadband: float
    zero_centred: bool
    gain: float
    saturation: float
    rate: float
    share: float


class ActuatorState(NamedTuple):
    """history: past commands, a ring; memory: where the ring stands, the deadband's output, the rate limit's, the lag's."""

    history: Array
    memory: Array


def actuator(of: Motor | Cylinder | ForceActuator, computer: Computer, timestep: float) -> Actuator:
    """The conditioning of a motor's voltage, a cylinder's position or a force actuator's command."""
    delay = of.delay + computer.delay
    rate = UNLIMITED if isinstance(of, Cylinder) else of.rate_limit
    neutral = (delay, of.deadband, of.gain, of.saturation, rate, of.lag) == (0.0, 0.0, 1.0, UNLIMITED, UNLIMITED, 0.0)
    share = 1.0 if of.lag == 0.0 else 1.0 - math.exp(-timestep / of.lag)
    return Actuator(
        neutral,
        delay / timestep,
        of.deadband,
        not isinstance(of, Cylinder),
        of.gain,
        of.saturation,
        rate * timestep if rate < UNLIMITED else UNLIMITED,
        share,
    )


def holding(conditioning: Actuator, command: float) -> ActuatorState:
    """The state in which `command` has been held for long."""
    state = ActuatorState(ring(conditioning.delay, command), np.array([0.0, command, 0.0, 0.0]))
    if conditioning.zero_centred:
        state.memory[1] = 0.0
    output = limited(conditioning, state, command)
    state.memory[2] = state.memory[3] = output
    return state


@compilable
def limited(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """Deadband, gain and saturation."""
    band = conditioning.deadband
    if conditioning.zero_centred:
        passed = math.copysign(max(abs(command) - band, 0.0), command)
    else:
        passed = min(max(state.memory[1], command - band), command + band)
        state.memory[1] = passed
    scaled = conditioning.gain * passed
    return min(max(scaled, -conditioning.saturation), conditioning.saturation)


@compilable
def conditioned(conditioning: Actuator, state: ActuatorState, command: float) -> float:
    """What acts over the coming timestep. Advances the state by one timestep."""
    if conditioning.neutral:
        state.memory[3] = command
        return command
    wanted = limited(conditioning, state, delayed(state.history, state.memory, conditioning.delay, command))
    before = state.memory[2]
    state.memory[2] = before + min(max(wanted - before, -conditioning.rate), conditioning.rate)
    state.memory[3] += conditioning.share * (state.memory[2] - state.memory[3])
    return state.memory[3]
