"""Planar arms and a cart with a pendulum: the forces that a prescribed motion takes, by equations
of motion written by hand.

Links hang from each other in a vertical plane. Newton's and Euler's equations are summed from the
last link to the first; joints may have friction, springs and rotors, and a belt may couple the last
two.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.81
"""m/s²."""


class Link(NamedTuple):
    """length: m to the next joint; mass: kg; along, across: m, of the centre of mass from the
    joint, along the link and in the direction in which its angle grows; inertia: kg m² about it."""

    length: float
    mass: float
    along: float
    across: float
    inertia: float


class Drag(NamedTuple):
    """What resists along one coordinate, N or Nm: slip, breakaway: dry friction at speed and at
    standstill; slow: speed within which it falls; viscous: by the speed; constant; spring: by the
    position; rotor: kg or kg m² of the motor, through its gear."""

    slip: float = 0.0
    breakaway: float = 0.0
    slow: float = 0.1
    viscous: float = 0.0
    constant: float = 0.0
    spring: float = 0.0
    rotor: float = 0.0


class Arm(NamedTuple):
    """cart: kg on a rail that the first link hangs from, None for an arm on the floor; links: from
    the first to the last; drags: of the joints, the cart's first; belt: of the sum of the last two
    angles."""

    cart: float | None
    links: tuple[Link, ...]
    drags: tuple[Drag, ...]
    belt: Drag = Drag()


class Travel(NamedTuple):
    """A motion: position, speed and acceleration, shape (joints, ticks) each."""

    position: Array
    speed: Array
    acceleration: Array


def add_ball(link: Link, mass: float, along: float, across: float, radius: float) -> Link:
    """A link with a solid ball fixed to it, whose centre is there."""
    total = link.mass + mass
    a = (link.mass * link.along + mass * along) / total
    e = (link.mass * link.across + mass * across) / total

    def about(inertia: float, kilograms: float, x: float, y: float) -> float:
        return inertia + kilograms * ((x - a) ** 2 + (y - e) ** 2)

    inertia = about(link.inertia, link.mass, link.along, link.across)
    inertia += about(0.4 * mass * radius**2, mass, along, across)
    return Link(link.length, total, a, e, inertia)


def swing(links: Sequence[Link], hung: Array, travel: Travel) -> tuple[Array, Array]:
    """The forces on links that hang from a point.

    Parameters
    ----------
    links
        From the first to the last.
    hung
        m/s², of the point, across and up, shape (2, ticks).
    travel
        Of the joints, each relative to the link before.

    Returns
    -------
    tuple
        Torques on the joints, Nm, shape (joints, ticks), and the force on the point, N, shape (2,
        ticks).
    """
    angle, rate, gain = (np.cumsum(each, axis=0) for each in travel)
    out = np.stack([np.sin(angle), -np.cos(angle)])
    on = np.stack([np.cos(angle), np.sin(angle)])
    joints = [hung + np.array([[0.0], [GRAVITY]])]
    for number, link in enumerate(links):
        turned = gain[number] * on[:, number] - rate[number] ** 2 * out[:, number]
        joints.append(joints[-1] + link.length * turned)
    torques = np.empty_like(angle)
    force, torque = np.zeros_like(hung), np.zeros(angle.shape[1])
    for number in reversed(range(len(links))):
        link, u, w = links[number], out[:, number], on[:, number]
        centre = link.along * u + link.across * w
        turned = gain[number] * w - rate[number] ** 2 * u
        aside = -gain[number] * u - rate[number] ** 2 * w
        own = link.mass * (joints[number] + link.along * turned + link.across * aside)
        torque = torque + link.inertia * gain[number]
        torque = torque + _cross(centre, own) + _cross(link.length * u, force)
        force = force + own
        torques[number] = torque
    return torques, force


def _cross(one: Array, other: Array) -> Array:
    return one[0] * other[1] - one[1] * other[0]


def resist(drag: Drag, position: Array, speed: Array, acceleration: Array) -> Array:
    """What moves one coordinate against all that resists along it, shape (ticks,)."""
    dry = drag.slip + (drag.breakaway - drag.slip) * np.exp(-((speed / drag.slow) ** 2))
    found = dry * np.sign(speed) + drag.viscous * speed + drag.constant
    return found + drag.spring * position + drag.rotor * acceleration


def drive(arm: Arm, travel: Travel) -> Array:
    """What the motors of an arm give while it moves as prescribed.

    Parameters
    ----------
    arm
        With or without a cart, which is then the first joint.
    travel
        Of all joints.

    Returns
    -------
    array
        N or Nm, shape (joints, ticks).
    """
    hung, hinges = np.zeros((2, travel.position.shape[1])), travel
    if arm.cart is not None:
        hung[0] = travel.acceleration[0]
        hinges = Travel(*(each[1:] for each in travel))
    found, pull = swing(arm.links, hung, hinges)
    if arm.cart is not None:
        found = np.concatenate([[pull[0] + arm.cart * hung[0]], found])
    for number, drag in enumerate(arm.drags):
        found[number] = found[number] + resist(drag, *(each[number] for each in travel))
    found[-2:] += resist(arm.belt, *(each[-2:].sum(axis=0) for each in travel))
    return found
