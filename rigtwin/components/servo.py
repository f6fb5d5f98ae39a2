"""A servo: a controller of a position that sits in its actuator. Parameters, law, kinds of effect.
Units are those of a joint that slides; of one that turns, read rad for m and Nm for N.

force = position_gain · (command − position) − damping_gain · speed, within ±force_limit: MuJoCo's
`position` actuator with `kp`, `kv` and `forcerange` (MuJoCo, XML reference, actuator/position).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.actuators import ForceActuator
from rigtwin.components.effect import Context, Kind, Starts, shares_of_nominal
from rigtwin.components.quantity import MJCF, NONE, UNLIMITED, Quantity
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


class Servo(NamedTuple):
    """Command of a position to force: limits of the command, delay, gain, rate limit, lag, then
    the law. Within the deadband of the position's error it does not push."""

    position_gain: Annotated[float, Quantity("N/m", 1e-9, 1e12, MJCF)] = 1.0
    damping_gain: Annotated[float, Quantity("Ns/m", 0.0, 1e12, MJCF)] = 0.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, MJCF)] = UNLIMITED
    command_low: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = -UNLIMITED
    command_high: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = UNLIMITED
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    rate_limit: Annotated[float, Quantity("m/s", 1e-9, UNLIMITED, NONE)] = UNLIMITED


Pusher = ForceActuator | Servo
PUSHERS = (ForceActuator, Servo)
"""Types of actuators that push a joint; where it goes follows from that."""


class Push(NamedTuple):
    """What pushes a joint: constant, N per unit of the command; position_gain N/m and damping_gain
    Ns/m, of a servo; band, N that are kept back by its deadband; limit, N."""

    constant: float
    position_gain: float
    damping_gain: float
    band: float
    limit: float


def push_law(of: Pusher) -> Push:
    """The law of a force actuator or a servo."""
    limit = min(of.force_limit, UNLIMITED)
    if isinstance(of, Servo):
        kept = of.position_gain * of.deadband
        return Push(of.position_gain, of.position_gain, of.damping_gain, kept, limit)
    return Push(of.constant, 0.0, 0.0, 0.0, limit)


@compilable
def pull(law: Push, command: float, position: float) -> float:
    """A servo's force, its damping and its limit apart."""
    force = law.position_gain * (command - position)
    return math.copysign(max(abs(force) - law.band, 0.0), force)


@compilable
def push(law: Push, command: float, position: float, speed: float) -> float:
    """The force of what pushes.

    Parameters
    ----------
    law
        Of a force actuator or a servo.
    command
        In its unit, as conditioned.
    position, speed
        Of the joint, m and m/s.

    Returns
    -------
    float
        N.
    """
    force = law.constant * command
    if law.position_gain > 0.0:
        force = pull(law, command, position) - law.damping_gain * speed
    return min(max(force, -law.limit), law.limit)


@kernel
def push_all(law: Push, commands: Array, positions: Array, speeds: Array) -> Array:
    """The same from tick to tick, each shape (ticks,)."""
    forces = np.empty(len(commands))
    for tick in range(len(commands)):
        forces[tick] = push(law, commands[tick], positions[tick], speeds[tick])
    return forces


def _damping_gain(at: Context) -> Starts:
    unit = at.nominal if at.nominal > 0.0 else at.scales.force / at.scales.speed
    shares = (0.0, 0.5, 2.0, 4.0) if at.nominal > 0.0 else (0.03, 0.1, 0.3, 1.0)
    return Starts.single([share * unit for share in shares], 0.004 * unit)


def _force_limit(at: Context) -> Starts:
    size = min(at.scales.force, at.nominal)
    return Starts.single([share * size for share in (2.5, 1.7, 1.2, 0.8, 0.5)], 0.004 * size)


KINDS = (
    Kind(
        "position_gain",
        "position gain",
        ("position_gain",),
        "force for each unit of the position's error",
        {Servo: shares_of_nominal((0.4, 0.75, 1.3, 2.5), 0.004)},
    ),
    Kind(
        "damping_gain",
        "damping gain",
        ("damping_gain",),
        "force for each unit of speed, against it",
        {Servo: _damping_gain},
    ),
    Kind(
        "force_limit",
        "limit of the force",
        ("force_limit",),
        "force limited to this magnitude",
        {Servo: _force_limit},
    ),
)
