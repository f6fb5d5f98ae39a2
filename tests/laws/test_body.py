"""A rigid body's ten inertial parameters, and gravity as a base that is off level sees it."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import Base, Body
from rigtwin.components.body import (
    about_frame,
    list_parameters,
    list_surplus,
    turn_gravity,
)
from tests.helpers.bodies import arrange_pseudo_inertia
from tests.laws.written import law_of

INERTIA = np.array([[0.04, 0.003, -0.002], [0.003, 0.05, 0.004], [-0.002, 0.004, 0.03]])
"""About the centre of mass, kg m²."""
NOMINAL = Body(2.0, 0.1, -0.05, 0.2)


def moments(parts: list[tuple[float, tuple[float, float, float]]]) -> list[float]:
    """Sum the ten parameters of point masses in kg at places in m.

    m, Σ m x, Σ m y, Σ m z, Σ m (y² + z²), Σ m (z² + x²), Σ m (x² + y²), −Σ m x y, −Σ m x z,
    −Σ m y z.
    """
    total = np.zeros(10)
    for m, (x, y, z) in parts:
        first = [m, m * x, m * y, m * z]
        second = [m * (y * y + z * z), m * (z * z + x * x), m * (x * x + y * y)]
        total += [*first, *second, -m * x * y, -m * x * z, -m * y * z]
    return total.tolist()


def test_a_point_mass_has_the_moments_of_its_place():
    found = about_frame(2.0, np.array([0.1, -0.05, 0.2]), np.zeros((3, 3)))
    assert found == pytest.approx(moments([(2.0, (0.1, -0.05, 0.2))]))


def test_a_nominal_body_has_one_kilogram_at_its_frame_and_the_mjcfs_inertia():
    expected = [1.0, 0.0, 0.0, 0.0, 0.04, 0.05, 0.03, 0.003, -0.002, 0.004]
    assert list_parameters(Body(), 1.0, INERTIA) == pytest.approx(expected)


@law_of("mass", Body)
@law_of("inertia", Body)
@law_of("lever_x", Body)
@law_of("lever_y", Body)
@law_of("lever_z", Body)
@law_of("payload", Body)
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"mass": 3.0},
        {"inertia": 1.7},
        {"centre_x": 0.3},
        {"centre_y": 0.2},
        {"centre_z": -0.1},
        {"payload": 0.8, "payload_x": 0.2, "payload_y": -0.3, "payload_z": 0.1},
        {"mass": 1.5, "inertia": 0.6, "centre_x": -0.2, "payload": 0.3, "payload_z": 0.5},
    ],
)
def test_a_body_is_its_mass_with_scaled_inertia_and_a_point_mass_on_it(changes):
    """The inertia about the centre scales with the mass, as the shape stays."""
    body = NOMINAL._replace(**changes)
    centre = (body.centre_x, body.centre_y, body.centre_z)
    place = (body.payload_x, body.payload_y, body.payload_z)
    scaled = body.inertia * body.mass / 2.0 * INERTIA
    own = [scaled[0, 0], scaled[1, 1], scaled[2, 2], scaled[0, 1], scaled[0, 2], scaled[1, 2]]
    expected = np.array(moments([(body.mass, centre), (body.payload, place)]))
    expected[4:] += own
    assert list_parameters(body, 2.0, INERTIA) == pytest.approx(expected)
    usual = np.array(moments([(2.0, (0.1, -0.05, 0.2))]))
    usual[4:] += [0.04, 0.05, 0.03, 0.003, -0.002, 0.004]
    surplus = list_surplus(body, 2.0, np.array([0.1, -0.05, 0.2]), INERTIA)
    assert surplus == pytest.approx(expected - usual, abs=1e-12)


def test_a_body_without_a_mass_in_the_mjcf_keeps_its_inertia():
    found = list_parameters(Body(2.0), 0.0, INERTIA)
    assert found[4:7] == pytest.approx([0.04, 0.05, 0.03])
    assert list_parameters(Body(2.0), 0.5, INERTIA)[4:7] == pytest.approx([0.16, 0.2, 0.12])
    assert list_parameters(Body(0.01), 0.005, INERTIA)[4] == pytest.approx(0.08)


def test_the_pseudo_inertia_is_the_sum_of_m_r_r_over_homogeneous_places():
    parts = [(0.4, (0.1, 0.2, -0.3)), (0.7, (-0.2, 0.1, 0.05)), (0.2, (0.3, -0.1, 0.4))]
    expected = np.zeros((4, 4))
    for mass, place in parts:
        expected += mass * np.outer([*place, 1.0], [*place, 1.0])
    found = arrange_pseudo_inertia(np.array(moments(parts)))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def turned_about(axis: int, angle: float, vector: np.ndarray) -> np.ndarray:
    """Return a fixed vector as seen from a frame turned about one of its axes.

    Rodrigues: cos a v + sin a v × e + (1 − cos a) (e·v) e.
    """
    unit = np.eye(3)[axis]
    along = (1.0 - np.cos(angle)) * (unit @ vector) * unit
    return np.cos(angle) * vector + np.sin(angle) * np.cross(vector, unit) + along


@law_of("tilt_x", Base)
@law_of("tilt_y", Base)
@law_of("tilt_z", Base)
@pytest.mark.parametrize(
    "base", [Base(), Base(0.3), Base(tilt_y=-0.2), Base(tilt_z=0.5), Base(0.2, -0.3, 0.4)]
)
def test_a_base_sees_gravity_turned_about_x_then_y_then_z(base):
    gravity = np.array([0.3, -0.5, -9.81])
    expected = gravity
    for axis, angle in enumerate((base.tilt_x, base.tilt_y, base.tilt_z)):
        expected = turned_about(axis, angle, expected)
    np.testing.assert_allclose(turn_gravity(base, gravity), expected, atol=1e-12)
