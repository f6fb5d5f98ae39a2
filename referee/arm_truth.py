"""Inverse dynamics of planar arms and of a cart with a pendulum, written by hand.

Links hang from each other in a vertical plane. Newton's and Euler's equations are summed from the
last link to the first. Joints may have friction, springs and rotors, and a belt may couple the last
two joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.81
"""Gravity, m/s²."""


class Link(NamedTuple):
    """Link of an arm.

    Attributes
    ----------
    length : float
        Distance to the next joint, m.
    mass : float
        Mass, kg.
    along, across : float
        Centre of mass from the joint, m: along the link, and in the direction of a growing angle.
    inertia : float
        Moment of inertia about the centre of mass, kg m².
    """

    length: float
    mass: float
    along: float
    across: float
    inertia: float


class Resistance(NamedTuple):
    """Resistance along one coordinate, in N, m and kg, or Nm, rad and kg m².

    Attributes
    ----------
    slip, breakaway : float
        Dry friction in motion and at standstill, N.
    fade_speed : float
        Speed within which the friction falls from `breakaway` to `slip`, m/s.
    viscous : float
        Viscous friction, Ns/m.
    constant : float
        Constant force, N.
    spring : float
        Stiffness, N/m.
    rotor : float
        Inertia of the motor, reflected through its gear, kg.
    """

    slip: float = 0.0
    breakaway: float = 0.0
    fade_speed: float = 0.1
    viscous: float = 0.0
    constant: float = 0.0
    spring: float = 0.0
    rotor: float = 0.0


class Arm(NamedTuple):
    """Arm on the floor or on a cart.

    Attributes
    ----------
    cart : float or None
        Mass of the cart that the first link hangs from, kg. None for an arm on the floor.
    links : tuple of Link
        Links from the first to the last.
    resistances : tuple of Resistance
        Resistance of every joint, that of the cart first.
    belt : Resistance
        Resistance along the sum of the last two angles.
    """

    cart: float | None
    links: tuple[Link, ...]
    resistances: tuple[Resistance, ...]
    belt: Resistance = Resistance()


class JointTravel(NamedTuple):
    """Motion of the joints: position, speed and acceleration, each of shape (joints, ticks)."""

    position: Array
    speed: Array
    acceleration: Array


def add_ball(link: Link, mass: float, along: float, across: float, radius: float) -> Link:
    """Return a link with a solid ball fixed to it.

    mass: kg; along, across: centre of the ball from the joint, m; radius: m.
    """
    total = link.mass + mass
    new_along = (link.mass * link.along + mass * along) / total
    new_across = (link.mass * link.across + mass * across) / total

    def parallel_axis(inertia: float, kilograms: float, x: float, y: float) -> float:
        return inertia + kilograms * ((x - new_along) ** 2 + (y - new_across) ** 2)

    # Both inertias about the new centre of mass; a solid ball has 2/5 m r² about its own.
    inertia = parallel_axis(link.inertia, link.mass, link.along, link.across)
    inertia += parallel_axis(0.4 * mass * radius**2, mass, along, across)
    return Link(link.length, total, new_along, new_across, inertia)


def link_forces(
    links: Sequence[Link], point_acceleration: Array, travel: JointTravel
) -> tuple[Array, Array]:
    """Return the forces on links that hang from a point.

    Parameters
    ----------
    links : sequence of Link
        Links from the first to the last.
    point_acceleration : ndarray
        Acceleration of the point, across and up, m/s², shape (2, ticks).
    travel : Travel
        Motion of the joints, each relative to the link before it.

    Returns
    -------
    tuple of ndarray
        Torques on the joints, Nm, shape (joints, ticks), and force on the point, N, shape (2,
        ticks).
    """
    # Absolute angles, rates and accelerations are the sums over the joints before.
    angle, rate, angular_acceleration = (np.cumsum(each, axis=0) for each in travel)
    radial = np.stack([np.sin(angle), -np.cos(angle)])
    tangential = np.stack([np.cos(angle), np.sin(angle)])
    # Gravity as an upward acceleration of the support, so no weight terms are needed.
    joints = [point_acceleration + np.array([[0.0], [GRAVITY]])]
    for number, link in enumerate(links):
        along_motion = (
            angular_acceleration[number] * tangential[:, number]
            - rate[number] ** 2 * radial[:, number]
        )
        # Acceleration of the next joint: tangential α·L and centripetal −ω²·L.
        joints.append(joints[-1] + link.length * along_motion)
    torques = np.empty_like(angle)
    force, torque = np.zeros_like(point_acceleration), np.zeros(angle.shape[1])
    # Newton and Euler from the tip: forces and moments of the outer links accumulate.
    for number in reversed(range(len(links))):
        link, u, w = links[number], radial[:, number], tangential[:, number]
        centre = link.along * u + link.across * w
        along_motion = angular_acceleration[number] * w - rate[number] ** 2 * u
        across_motion = -angular_acceleration[number] * u - rate[number] ** 2 * w
        inertial = link.mass * (
            joints[number] + link.along * along_motion + link.across * across_motion
        )
        # Euler about the joint: the link's own, that of its mass at the lever, and that of the
        # outer links.
        torque = torque + link.inertia * angular_acceleration[number]
        torque = torque + _cross(centre, inertial) + _cross(link.length * u, force)
        force = force + inertial
        # A planar joint transmits the sum of all moments further out.
        torques[number] = torque
    return torques, force


def _cross(first: Array, second: Array) -> Array:
    """Return the out-of-plane component of a cross product."""
    return first[0] * second[1] - first[1] * second[0]


def resisting_force(
    resistance: Resistance, position: Array, speed: Array, acceleration: Array
) -> Array:
    """Return the force that moves one coordinate against its resistance, N, shape (ticks,)."""
    # Stribeck curve: breakaway at standstill, slip at speed.
    dry = resistance.slip + (resistance.breakaway - resistance.slip) * np.exp(
        -((speed / resistance.fade_speed) ** 2)
    )
    # sign(0) = 0: at a standstill the friction of a prescribed motion is not determined.
    force = dry * np.sign(speed) + resistance.viscous * speed + resistance.constant
    return force + resistance.spring * position + resistance.rotor * acceleration


def motor_forces(arm: Arm, travel: JointTravel) -> Array:
    """Return the forces of the motors of an arm that moves as prescribed.

    Parameters
    ----------
    arm : Arm
        Arm with or without a cart. The cart is the first joint.
    travel : Travel
        Motion of all joints.

    Returns
    -------
    ndarray
        Forces, N, or torques, Nm, shape (joints, ticks).
    """
    point_acceleration, hinges = np.zeros((2, travel.position.shape[1])), travel
    if arm.cart is not None:
        point_acceleration[0] = travel.acceleration[0]
        hinges = JointTravel(*(each[1:] for each in travel))
    forces, reaction = link_forces(arm.links, point_acceleration, hinges)
    if arm.cart is not None:
        # The cart feels the horizontal force of the links and its own inertia.
        forces = np.concatenate([[reaction[0] + arm.cart * point_acceleration[0]], forces])
    for number, resistance in enumerate(arm.resistances):
        forces[number] = forces[number] + resisting_force(
            resistance, *(each[number] for each in travel)
        )
    # A belt over both joints turns with the sum of their angles, so each joint feels its force.
    forces[-2:] += resisting_force(arm.belt, *(each[-2:].sum(axis=0) for each in travel))
    return forces
