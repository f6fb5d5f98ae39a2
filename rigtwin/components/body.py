"""Rigid body of coupled joints: its ten inertial parameters and the effects on them.

The forces of a motion are linear in mass, first moment and moments of inertia about the body's own
frame (Atkeson, An and Hollerbach, International Journal of Robotics Research 5(3), 1986). For all
parameter values within the bounds of this file the body is physically consistent: its
pseudo-inertia matrix is positive definite (Wensing, Kim and Slotine, IEEE Robotics and Automation
Letters 3(1), 2018; Sousa and Cortesão, International Journal of Robotics Research 33(6), 2014).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.effect import Context, Kind, Starts
from rigtwin.components.quantity import MJCF, NONE, Quantity
from rigtwin.components.starts import fixed_starts, shares_of_nominal
from rigtwin.numerics.arrays import Array

INERTIAL = ("mass", "mx", "my", "mz", "ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Names of the ten inertial parameters about the body's frame: mass, kg; first moment, kg m;
moments and products of inertia, kg m²."""
PLACES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Starting positions of a payload, in reaches from the centre of mass; tried to either side."""
PAYLOADS = (0.3, 3.0)
"""Starting masses of a payload, in masses of the body. One is heavy: with too light a start, the
product of mass and lever leads the search to a lever that is too long."""
FURTHEST = 6.0
"""Largest distance of a payload from the body's frame, in reaches."""
TILT = 0.8
"""Largest tilt of a base, rad."""


class Body(NamedTuple):
    """Rigid body with a payload.

    The moments of inertia scale with the mass, as if the body kept its shape, and with the factor
    `inertia`. The payload is a point mass fixed to the body.
    """

    # Mass, centre of mass in the body's frame, factor on the moments of inertia about the latter.
    mass: Annotated[float, Quantity("kg", 1e-9, 1e6, MJCF)] = 1.0
    centre_x: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    centre_y: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    centre_z: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    inertia: Annotated[float, Quantity("1", 0.01, 100.0, "1: as the MJCF has it")] = 1.0
    # Extent of the body from its frame; it scales the search for a payload.
    reach: Annotated[float, Quantity("m", 1e-6, 100.0, MJCF)] = 1.0
    payload: Annotated[float, Quantity("kg", 0.0, 1e6, NONE)] = 0.0
    payload_x: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    payload_y: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    payload_z: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0


class Base(NamedTuple):
    """Base of a machine, which may be off level.

    The tilts are rotations about x, then y, then z of the base, from the orientation that the
    MJCF's gravity implies.
    """

    tilt_x: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0
    tilt_y: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0
    tilt_z: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0


def about_frame(mass: float, centre: Array, inertia: Array) -> Array:
    """Return the ten inertial parameters of a body about its frame.

    The parallel-axis theorem gives I_frame = I_centre + m·(cᵀc·1 − c·cᵀ).

    Parameters
    ----------
    mass
        Mass, kg.
    centre
        Centre of mass in the body's frame, m, shape (3,).
    inertia
        Inertia about the centre of mass, along the frame's axes, kg m², shape (3, 3).

    Returns
    -------
    array
        Parameters in the order of `INERTIAL`, shape (10,).
    """
    about = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    moments = [about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2]]
    return np.array([mass, *(mass * centre), *moments])


def list_parameters(body: Body, mass: float, inertia: Array) -> Array:
    """Return the ten inertial parameters of a body with its payload.

    Parameters
    ----------
    body
        Body with its effects.
    mass
        Mass of the body in the MJCF, kg.
    inertia
        Inertia of the body in the MJCF, about its centre of mass along the frame's axes, kg m²,
        shape (3, 3).

    Returns
    -------
    array
        Parameters in the order of `INERTIAL`, shape (10,).
    """
    share = body.mass / mass if mass > 0.0 else 1.0
    centre = np.array([body.centre_x, body.centre_y, body.centre_z])
    place = np.array([body.payload_x, body.payload_y, body.payload_z])
    body_parameters = about_frame(body.mass, centre, body.inertia * share * inertia)
    return body_parameters + about_frame(body.payload, place, np.zeros((3, 3)))


def list_surplus(body: Body, mass: float, centre: Array, inertia: Array) -> Array:
    """Return the change of the ten inertial parameters from those of the MJCF.

    Parameters
    ----------
    body
        Body with its effects.
    mass
        Mass of the body in the MJCF, kg.
    centre
        Centre of mass in the MJCF, m, shape (3,).
    inertia
        Inertia in the MJCF, about the centre of mass along the frame's axes, kg m², shape (3, 3).

    Returns
    -------
    array
        Differences in the order of `INERTIAL`, shape (10,).
    """
    return list_parameters(body, mass, inertia) - about_frame(mass, centre, inertia)


def turn_gravity(base: Base, gravity: Array) -> Array:
    """Return gravity in the frame of a tilted base.

    Parameters
    ----------
    base
        Base with its tilts about x, y and z.
    gravity
        Gravity in the frame of the level base, m/s², shape (3,).

    Returns
    -------
    array
        Gravity in the frame of the tilted base, m/s², shape (3,).
    """
    turned = gravity
    for axis, angle in enumerate(base):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        rotation = np.eye(3)
        rotation[first, first] = rotation[second, second] = np.cos(angle)
        # The base turns one way, so gravity turns the other in its frame.
        rotation[first, second], rotation[second, first] = np.sin(angle), -np.sin(angle)
        turned = rotation @ turned
    return turned


def _displaced(context: Context) -> Starts:
    reach = float(context.component(Body).reach)
    values = [context.nominal + share * reach for share in (-0.2, -0.05, 0.05, 0.2)]
    return Starts.single(values, 0.005 * reach)


def _loaded(context: Context) -> Starts:
    body = context.component(Body)
    centre = np.array([body.centre_x, body.centre_y, body.centre_z])
    values = []
    for share in PAYLOADS:
        for place in PLACES:
            for side in (1.0, -1.0) if any(place) else (1.0,):
                at_place = centre + side * body.reach * np.array(place)
                values.append((share * body.mass, *at_place.tolist()))
    # The step of each derivative is a small share of the body's mass and reach.
    far = FURTHEST * body.reach
    return Starts(
        tuple(values),
        (0.005 * body.mass, *(0.005 * body.reach,) * 3),
        bounds=((0.0, 20.0 * body.mass), *((-far, far),) * 3),
    )


def _lever(axis: str) -> Kind:
    return Kind(
        f"lever_{axis}",
        f"centre of mass along {axis}",
        (f"centre_{axis}",),
        f"centre of mass elsewhere along the body's own {axis}",
        {Body: _displaced},
    )


def _tilt(axis: str) -> Kind:
    return Kind(
        f"tilt_{axis}",
        f"base turned about {axis}",
        (f"tilt_{axis}",),
        f"the base is not level: turned about its own {axis}",
        {Base: fixed_starts((-0.1, -0.02, 0.02, 0.1), 0.001)},
    )


KINDS = (
    Kind(
        "mass",
        "mass",
        ("mass",),
        "mass, with the same shape",
        {Body: shares_of_nominal((0.6, 0.9, 1.1, 1.5), 0.005)},
    ),
    *(_lever(axis) for axis in "xyz"),
    Kind(
        "inertia",
        "moment of inertia",
        ("inertia",),
        "moments of inertia about the centre of mass, all by this factor",
        {Body: shares_of_nominal((0.5, 0.9, 1.1, 2.0), 0.005)},
    ),
    Kind(
        "payload",
        "payload",
        ("payload", "payload_x", "payload_y", "payload_z"),
        "something of unknown mass, fixed to it at an unknown place",
        {Body: _loaded},
    ),
    *(_tilt(axis) for axis in "xyz"),
)
