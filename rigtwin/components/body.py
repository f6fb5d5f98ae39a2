"""A rigid body of joints that move together: its ten inertial parameters, and what can be other
about them than told.

The forces that a motion takes are linear in mass, first moment and moments of inertia about the
body's own frame (Atkeson, An and Hollerbach, International Journal of Robotics Research 5(3),
1986). Whatever values the components here have within their bounds, such a body can be made: its
pseudo-inertia matrix is positive definite (Wensing, Kim and Slotine, IEEE Robotics and Automation
Letters 3(1), 2018; Sousa and Cortesão, International Journal of Robotics Research 33(6), 2014).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.effect import Context, Kind, Starts, fixed_starts, shares_of_nominal
from rigtwin.components.quantity import MJCF, NONE, Quantity
from rigtwin.numerics.arrays import Array

INERTIAL = ("mass", "mx", "my", "mz", "ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""The ten parameters: kg, kg m and kg m², about the body's frame."""
PLACES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Where a payload is looked for first, in reaches from the centre of mass, to either side."""
PAYLOADS = (0.3, 3.0)
"""Masses of a payload that is looked for, in masses of the body: heavy ones, as mass times lever
leads a search that starts too light away from where it has to go."""
FURTHEST = 6.0
"""Reaches from its frame at which a payload can sit."""
TILT = 0.8
"""rad, by which a base can be off level."""


class Body(NamedTuple):
    """A rigid body. centre: of mass, in its own frame, m; inertia: about the centre of mass, a
    factor on what its shape gives a mass; reach: how far it extends from its frame, for a search;
    payload: a point mass fixed to it at payload_x, payload_y, payload_z of its frame."""

    mass: Annotated[float, Quantity("kg", 1e-9, 1e6, MJCF)] = 1.0
    centre_x: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    centre_y: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    centre_z: Annotated[float, Quantity("m", -100.0, 100.0, MJCF)] = 0.0
    inertia: Annotated[float, Quantity("1", 0.01, 100.0, "1: as the MJCF has it")] = 1.0
    reach: Annotated[float, Quantity("m", 1e-6, 100.0, MJCF)] = 1.0
    payload: Annotated[float, Quantity("kg", 0.0, 1e6, NONE)] = 0.0
    payload_x: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    payload_y: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    payload_z: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0


class Base(NamedTuple):
    """What a machine stands on. tilt_x, tilt_y, tilt_z: rad that it is turned about its own axes,
    off what the MJCF's gravity says."""

    tilt_x: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0
    tilt_y: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0
    tilt_z: Annotated[float, Quantity("rad", -TILT, TILT, "0: level")] = 0.0


def about_frame(mass: float, centre: Array, inertia: Array) -> Array:
    """The ten parameters of a body.

    Parameters
    ----------
    mass
        kg.
    centre
        Of mass, in the body's frame, m, shape (3,).
    inertia
        About the centre of mass, along the frame's axes, kg m², shape (3, 3).

    Returns
    -------
    array
        In the order of `INERTIAL`, shape (10,).
    """
    about = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    moments = [about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2]]
    return np.array([mass, *(mass * centre), *moments])


def list_parameters(body: Body, mass: float, inertia: Array) -> Array:
    """The ten parameters of a body and what is fixed to it.

    Parameters
    ----------
    body
        With whatever is other about it.
    mass, inertia
        What the MJCF says of the body alone: kg, and kg m² about its centre of mass along the
        frame's axes, shape (3, 3).

    Returns
    -------
    array
        In the order of `INERTIAL`, shape (10,).
    """
    share = body.mass / mass if mass > 0.0 else 1.0
    centre = np.array([body.centre_x, body.centre_y, body.centre_z])
    place = np.array([body.payload_x, body.payload_y, body.payload_z])
    own = about_frame(body.mass, centre, body.inertia * share * inertia)
    return own + about_frame(body.payload, place, np.zeros((3, 3)))


def list_surplus(body: Body, mass: float, centre: Array, inertia: Array) -> Array:
    """What the ten parameters are more than the MJCF's.

    Parameters
    ----------
    body
        With whatever is other about it.
    mass, centre, inertia
        What the MJCF says of the body alone: kg, m, shape (3,), and kg m² about its centre of mass
        along the frame's axes, shape (3, 3).

    Returns
    -------
    array
        In the order of `INERTIAL`, shape (10,).
    """
    return list_parameters(body, mass, inertia) - about_frame(mass, centre, inertia)


def arrange_pseudo_inertia(parameters: Array) -> Array:
    """The pseudo-inertia matrix of ten parameters, shape (4, 4): positive definite for every body
    that can be made, and for no other (Wensing, Kim and Slotine 2018)."""
    mass, mx, my, mz, ixx, iyy, izz, ixy, ixz, iyz = parameters
    about = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    found = np.empty((4, 4))
    found[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    found[:3, 3] = found[3, :3] = (mx, my, mz)
    found[3, 3] = mass
    return found


def turn_gravity(base: Base, gravity: Array) -> Array:
    """Gravity, m/s², shape (3,), as a base that is turned about x, then y, then z of its own
    sees it."""
    turned = gravity
    for axis, angle in enumerate(base):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        rotation = np.eye(3)
        rotation[one, one] = rotation[other, other] = np.cos(angle)
        # The base turns one way, so gravity turns the other in its frame.
        rotation[one, other], rotation[other, one] = np.sin(angle), -np.sin(angle)
        turned = rotation @ turned
    return turned


def _displaced(at: Context) -> Starts:
    reach = float(getattr(at.plant, at.effect.group).reach)
    values = [at.nominal + share * reach for share in (-0.2, -0.05, 0.05, 0.2)]
    return Starts.single(values, 0.005 * reach)


def _loaded(at: Context) -> Starts:
    body: Body = getattr(at.plant, at.effect.group)
    centre = np.array([body.centre_x, body.centre_y, body.centre_z])
    values = []
    for share in PAYLOADS:
        for place in PLACES:
            for side in (1.0, -1.0) if any(place) else (1.0,):
                at_place = centre + side * body.reach * np.array(place)
                values.append((share * body.mass, *at_place.tolist()))
    far = FURTHEST * body.reach
    return Starts(
        tuple(values),
        (0.005 * body.mass, *(0.005 * body.reach,) * 3),
        bounds=((0.0, 20.0 * body.mass), *((-far, far),) * 3),
    )


def _lever(axis: str) -> Kind:
    return Kind(
        f"lever_{axis}",
        f"centre of mass displaced along {axis}",
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
