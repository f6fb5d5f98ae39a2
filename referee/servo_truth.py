"""A link on a servo that may be late, stiff, worn or rubbing, integrated by hand.

The servo's motor turns by τ = kp (u − θ) − kv θ', where u is the command, held from row to row and
late. A play may separate the motor from the link; contact within it is rigid and inelastic. Dry
friction is set-valued: it takes no more momentum than there is. All is stepped by semi-implicit
Euler, much finer than the rows of the log.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 5e-5
"""Longest integration step, s."""


class ServoTruth(NamedTuple):
    """Servo with its link.

    Attributes
    ----------
    inertia, rotor : float
        Inertia of the link, and of the motor behind its gear, kg m².
    weight : float
        Torque of gravity on the link held level, Nm. It hangs at an angle of 0.
    stiffness, damping : float
        Gains kp, Nm/rad, and kv, Nms/rad.
    coulomb, viscous : float
        Friction of the link's bearing, Nm and Nms/rad.
    play : float
        Play between motor and link, rad.
    delay : float
        Delay of the command, s.
    """

    inertia: float
    rotor: float
    weight: float
    stiffness: float
    damping: float
    coulomb: float
    viscous: float
    play: float
    delay: float


def angles_under(servo: ServoTruth, command: Array, period: float) -> Array:
    """Return the angle of the link at each row of a log, rad, shape (rows,).

    Parameters
    ----------
    servo
        Servo with its link, at rest at the first command.
    command
        Commanded angles, rad, shape (rows,).
    period
        Time from row to row, s.
    """
    steps = math.ceil(period / STEP)
    out = np.empty(len(command))
    _integrate(servo, command, round(servo.delay * steps / period), steps, period / steps, out)
    return out


@numba.njit
def _integrate(
    servo: ServoTruth, command: Array, late: int, steps: int, h: float, out: Array
) -> None:
    """Integrate the servo; `late` is its delay in steps of length h, s."""
    total = servo.inertia + servo.rotor
    motor, motor_speed, link, speed = command[0], 0.0, command[0], 0.0
    half = 0.5 * servo.play
    for row in range(len(command)):
        out[row] = link
        for step in range(steps):
            wanted = command[max(row * steps + step - late, 0) // steps]
            torque = servo.stiffness * (wanted - motor) - servo.damping * motor_speed
            pull = -servo.weight * math.sin(link) - servo.viscous * speed
            if half == 0.0:
                speed = _rub(speed + h * (torque + pull) / total, h * servo.coulomb / total)
                motor_speed = speed
            else:
                motor_speed += h * torque / servo.rotor
                speed = _rub(speed + h * pull / servo.inertia, h * servo.coulomb / servo.inertia)
                gap = motor + h * motor_speed - link - h * speed
                if abs(gap) > half:
                    # The contact gives both the speed that holds the gap at its edge.
                    beyond = (gap - math.copysign(half, gap)) / h
                    motor_speed -= beyond * servo.inertia / total
                    speed += beyond * servo.rotor / total
            motor += h * motor_speed
            link += h * speed


@numba.njit
def _rub(speed: float, most: float) -> float:
    """Return a speed from which dry friction has taken `most`, or all of it."""
    return math.copysign(max(abs(speed) - most, 0.0), speed)
