"""Servos: actuators with a controller of position or velocity of their own.

    position servo: force = clip(gains·(position_gain·(command − position) − damping_gain·speed))
    velocity servo: force = clip(gains·(velocity_gain·command − damping_gain·speed))

Both forces are limited to ±force_limit. These are MuJoCo's `position` actuator with `kp`, `kv` and
`forcerange`, and its `velocity` actuator, whose two gains are equal (MuJoCo, XML reference,
actuator/position and actuator/velocity). A DC motor driven by a voltage has the law of a velocity
servo too, with the back-EMF as its damping. `gains` scales both gains, as a wrong torque constant
of the motor does. Units are those of a sliding joint; for a turning joint, read rad for m and Nm
for N.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.actuators import ForceActuator
from rigtwin.components.effect import Context, Kind, Starts
from rigtwin.components.plant import Plant, component_of
from rigtwin.components.quantity import MJCF, NONE, UNLIMITED, Quantity
from rigtwin.components.starts import shares_of_nominal
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


class Servo(NamedTuple):
    """Actuator that controls a position by a force.

    Order of operations: limits of the command, delay, gain, rate limit, lag, then the law. Within
    the deadband of the position error it exerts no position force.
    """

    # Law of the servo, by the MJCF.
    position_gain: Annotated[float, Quantity("N/m", 1e-9, 1e12, MJCF)] = 1.0
    damping_gain: Annotated[float, Quantity("Ns/m", 0.0, 1e12, MJCF)] = 0.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, MJCF)] = UNLIMITED
    command_low: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = -UNLIMITED
    command_high: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = UNLIMITED
    gains: Annotated[float, Quantity("1", 0.05, 20.0, "1: as specified")] = 1.0
    # Conditioning of the command; neutral in the nominal machine.
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    rate_limit: Annotated[float, Quantity("m/s", 1e-9, UNLIMITED, NONE)] = UNLIMITED
    # Play between motor and joint; the servo measures the position of its motor.
    backlash: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    rotor_share: Annotated[float, Quantity("1", 0.005, 0.995, "0.5: as much as the joint")] = 0.5
    rotor_friction: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    play_compliance: Annotated[float, Quantity("m/N", 0.0, 1e3, NONE)] = 0.0


class VelocityServo(NamedTuple):
    """Actuator that controls a velocity by a force.

    Order of operations: limits of the command, delay, deadband, gain, saturation, rate limit, lag,
    then the law.
    """

    # Law of the servo, by the MJCF.
    velocity_gain: Annotated[float, Quantity("N/unit of the command", -1e12, 1e12, MJCF)] = 1.0
    damping_gain: Annotated[float, Quantity("Ns/m", 0.0, 1e12, MJCF)] = 1.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, MJCF)] = UNLIMITED
    command_low: Annotated[
        float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)
    ] = -UNLIMITED
    command_high: Annotated[float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)] = (
        UNLIMITED
    )
    gains: Annotated[float, Quantity("1", 0.05, 20.0, "1: as specified")] = 1.0
    # Conditioning of the command; neutral in the nominal machine.
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("unit of the command", 0.0, UNLIMITED, NONE)] = 0.0
    saturation: Annotated[float, Quantity("unit of the command", 1e-9, UNLIMITED, NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("unit of the command/s", 1e-9, UNLIMITED, NONE)] = (
        UNLIMITED
    )


SERVOS = (Servo, VelocityServo)
"""Types of actuators whose force depends on the joint's motion."""
Pusher = ForceActuator | Servo | VelocityServo
PUSHERS = (ForceActuator, *SERVOS)
"""Types of actuators that exert a force on a joint, whose motion follows from it."""


def pusher_of(plant: Plant, name: str) -> Pusher:
    """Return the force actuator or servo of a plant with a name."""
    return component_of(plant, name, *PUSHERS)


class Play(NamedTuple):
    """Play between an actuator's motor and the joint, as compiled code takes it."""

    half: float  # Half the play, m; 0 for none.
    rotor_share: float  # Share of the joint's inertia that is the motor's rotor.
    rotor_friction: float  # Coulomb friction of the rotor, N.
    compliance: float  # Compliance of the contact at either end of the play, m/N.


def play_of(actuator: Pusher) -> Play:
    """Return the play between an actuator's motor and the joint; a velocity servo has none."""
    if isinstance(actuator, VelocityServo):
        return Play(0.0, 0.5, 0.0, 0.0)
    half = 0.5 * actuator.backlash
    return Play(half, actuator.rotor_share, actuator.rotor_friction, actuator.play_compliance)


class Push(NamedTuple):
    """Law of a force actuator or servo as compiled code takes it."""

    constant: float  # Force per unit of the command, N per unit.
    position_gain: float  # Position gain of a position servo, N/m; 0 for any other actuator.
    damping_gain: float  # Damping gain of a servo, Ns/m.
    band: float  # Force within a servo's deadband, N.
    limit: float  # Largest force, N.
    zero: float  # Position that a position servo reads where its joint stands at 0, m.


def push_law(actuator: Pusher, zero: float = 0.0) -> Push:
    """Return the law of a force actuator or a servo.

    Parameters
    ----------
    actuator
        Actuator with its parameters.
    zero
        Offset of the encoder within the loop of a position servo, m.
    """
    limit = min(actuator.force_limit, UNLIMITED)
    if isinstance(actuator, Servo):
        stiffness = actuator.gains * actuator.position_gain
        damping = actuator.gains * actuator.damping_gain
        return Push(stiffness, stiffness, damping, stiffness * actuator.deadband, limit, zero)
    if isinstance(actuator, VelocityServo):
        gain = actuator.gains * actuator.velocity_gain
        return Push(gain, 0.0, actuator.gains * actuator.damping_gain, 0.0, limit, 0.0)
    return Push(actuator.constant, 0.0, 0.0, 0.0, limit, 0.0)


@compilable
def depends_on_motion(law: Push) -> bool:
    """Return whether a force depends on position or velocity, as a servo's does."""
    return law.position_gain > 0.0 or law.damping_gain > 0.0


@compilable
def pull(law: Push, command: float, position: float) -> float:
    """Return a servo's force, N, without damping and limit.

    It is constant·command of a velocity servo, and position_gain·(command − position) of a position
    servo, shrunk towards zero by the deadband.
    """
    if law.position_gain == 0.0:
        return law.constant * command
    force = law.position_gain * (command - position - law.zero)
    return math.copysign(max(abs(force) - law.band, 0.0), force)


@compilable
def push(law: Push, command: float, position: float, speed: float) -> float:
    """Return the force of a force actuator or a servo.

    Parameters
    ----------
    law
        Law of the actuator.
    command
        Conditioned command, in its unit.
    position, speed
        Position and velocity of the joint, m and m/s.

    Returns
    -------
    float
        Force, N.
    """
    force = pull(law, command, position) - law.damping_gain * speed
    return min(max(force, -law.limit), law.limit)


@kernel
def push_all(law: Push, commands: Array, positions: Array, speeds: Array) -> Array:
    """Return the forces at all ticks, N; arguments as in `push`, shape (ticks,) each."""
    forces = np.empty(len(commands))
    for tick in range(len(commands)):
        forces[tick] = push(law, commands[tick], positions[tick], speeds[tick])
    return forces


def _damping_gain(context: Context) -> Starts:
    unit = context.nominal if context.nominal > 0.0 else context.scales.force / context.scales.speed
    shares = (0.0, 0.5, 2.0, 4.0) if context.nominal > 0.0 else (0.03, 0.1, 0.3, 1.0)
    return Starts.single([share * unit for share in shares], 0.004 * unit)


def _force_limit(context: Context) -> Starts:
    size = min(context.scales.force, context.nominal)
    return Starts.single([share * size for share in (2.5, 1.7, 1.2, 0.8, 0.5)], 0.004 * size)


def _backlash(context: Context) -> Starts:
    stroke, force = context.scales.stroke, context.scales.force
    plays = [share * stroke for share in (0.01, 0.04, 0.12, 0.4)]
    yielding = 0.001 * stroke / force
    values = tuple((play, 0.5, 0.1 * force, yielding) for play in plays)
    return Starts(values, (0.002 * stroke, 0.02, 0.01 * force, yielding))


def _motor_backlash(context: Context) -> Starts:
    # Nothing holds the rotor back but its inertia, whose share decides on the motion.
    stroke, force = context.scales.stroke, context.scales.force
    yielding = 0.001 * stroke / force
    values = tuple(
        (play * stroke, share, 0.0, yielding)
        for play, share in product((0.004, 0.012, 0.04, 0.12), (0.1, 0.35, 0.7))
    )
    return Starts(values, (0.001 * stroke, 0.01, 0.005 * force, yielding))


PLAY = ("backlash", "rotor_share", "rotor_friction", "play_compliance")
"""Parameters of a play between a motor and its joint."""
KINDS = (
    Kind(
        "backlash",
        "backlash",
        PLAY,
        "a play between the servo's motor, whose position it controls, and the joint",
        {Servo: _backlash},
    ),
    Kind(
        "backlash",
        "backlash",
        PLAY,
        "a play between the motor and the joint, whose position is measured",
        {ForceActuator: _motor_backlash},
    ),
    Kind(
        "gains",
        "factor on both gains",
        ("gains",),
        "both gains of the servo multiplied by this factor, as by a wrong torque constant",
        dict.fromkeys(SERVOS, shares_of_nominal((0.3, 0.6, 1.6, 3.5), 0.004)),
        multiplied=("position_gain", "damping_gain"),
    ),
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
        # A velocity servo's damping acts as the joint's own, so that nothing tells them apart.
        {Servo: _damping_gain},
    ),
    Kind(
        "force_limit",
        "limit of the force",
        ("force_limit",),
        "force limited to this magnitude",
        dict.fromkeys(SERVOS, _force_limit),
    ),
)
