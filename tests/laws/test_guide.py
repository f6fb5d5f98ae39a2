"""Dry friction, springs, waves and viscous friction of whatever slides along a guide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import Guide, Motor, Rail
from rigtwin.components.dry_friction import (
    breakaway,
    dry_limits,
    friction,
    friction_size,
    gap_at,
    slide,
    stretch,
)
from rigtwin.components.guide import resists
from rigtwin.components.guide_force import damping, position_force
from tests.laws.joints import PERIOD, force_to_move, motion_under
from tests.laws.written import law_of

TIME = PERIOD * np.arange(2000)
SINE = 0.02 * np.sin(2.0 * np.pi * TIME)
SPEED = np.gradient(SINE, PERIOD)
SLIDES = [
    Rail(),
    Rail(30.0, stribeck=12.0, stribeck_velocity=0.02, stribeck_exponent=1.4, asymmetry=8.0),
    Rail(30.0, stribeck=-12.0, asymmetry=-8.0),
    Motor(),
    Motor(stribeck=5.0, stribeck_exponent=0.7, asymmetry=3.0, load_coefficient=0.05),
    Guide(),
    Guide(20.0, stribeck=8.0, stribeck_velocity=0.03, asymmetry=6.0, load_coefficient=0.2),
    Guide(2.0, asymmetry=10.0),
    Guide(2.0, asymmetry=-10.0),
    Guide(0.0, load_coefficient=0.3, stribeck=1.0, stribeck_exponent=1.0),
    Guide(0.5, stribeck=0.01, stribeck_exponent=2.02),
]


@law_of("coulomb", Rail, Motor, Guide)
@law_of("stribeck", Rail, Motor, Guide)
@law_of("asymmetry", Rail, Motor, Guide)
@law_of("load_friction", Motor, Guide)
@pytest.mark.parametrize("slides", SLIDES)
@pytest.mark.parametrize("velocity", [-0.3, -0.02, 0.0, 0.004, 0.05])
@pytest.mark.parametrize("load", [-200.0, 0.0, 350.0])
def test_dry_friction_bears_coulomb_stribeck_load_and_half_the_asymmetry(slides, velocity, load):
    """F = F_c + μ|N| + F_s exp(−|v/v_s|^n) ± ½ a, and never below zero."""
    ratio = abs(velocity) / slides.stribeck_velocity
    size = slides.coulomb + slides.stribeck * math.exp(-(ratio**slides.stribeck_exponent))
    size += getattr(slides, "load_coefficient", 0.0) * abs(load)
    expected = (max(size + slides.asymmetry / 2.0, 0.0), max(size - slides.asymmetry / 2.0, 0.0))
    assert dry_limits(friction(slides), velocity, load) == pytest.approx(expected)
    assert breakaway(friction(slides), gap_at(0.3), 0.1, velocity, load) == pytest.approx(expected)


def test_the_nominal_rail_and_motor_bear_their_breakaway_forces():
    for load in (0.0, 400.0):
        assert dry_limits(friction(Rail()), 0.1, load) == (50.0, 50.0)
        assert dry_limits(friction(Motor()), 0.1, load) == (14.0, 14.0)
    assert dry_limits(friction(Guide()), 0.1, 400.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("slides", "changing"),
    [
        (Rail(), False),
        (Motor(), False),
        (Guide(20.0), False),
        (Guide(20.0, stribeck_velocity=0.5, stribeck_exponent=1.0), False),
        (Rail(stribeck=1.0), True),
        (Rail(asymmetry=-1.0), True),
        (Motor(load_coefficient=0.1), True),
        (Guide(backlash=0.01), True),
    ],
)
def test_dry_friction_depends_on_the_motion_only_with_more_than_coulomb(slides, changing):
    dry = friction(slides)
    assert dry.changing is changing
    names = ("coulomb", "stribeck", "stribeck_velocity", "stribeck_exponent", "asymmetry")
    assert [getattr(dry, name) for name in names] == [getattr(slides, name) for name in names]
    assert dry.backlash == slides.backlash
    assert dry.load_coefficient == getattr(slides, "load_coefficient", 0.0)


def test_the_size_of_dry_friction_adds_all_its_parts():
    dry = friction(Guide(20.0, stribeck=-8.0, asymmetry=-6.0, load_coefficient=0.2))
    assert friction_size(dry, 0.0) == pytest.approx(20.0 + 8.0 + 3.0)
    assert friction_size(dry, -50.0) == pytest.approx(20.0 + 8.0 + 3.0 + 10.0)


@law_of("backlash", Rail, Motor, Guide)
@pytest.mark.parametrize("slides", [Rail(50.0), Motor(coulomb=50.0), Guide(50.0)])
def test_friction_is_felt_only_where_the_play_is_taken_up(slides):
    """The friction's element lies within ± half the play about the moving part."""
    loose, gap = friction(slides._replace(backlash=0.004, asymmetry=6.0)), gap_at(0.0)
    for position, limits, element in [
        (0.0, (0.0, 0.0), 0.0),
        (0.0019, (0.0, 0.0), 0.0),
        (0.0025, (53.0, 0.0), 0.0005),
        (0.0065, (53.0, 0.0), 0.0045),
        (0.0064, (0.0, 0.0), 0.0045),
        (0.0026, (0.0, 0.0), 0.0045),
        (0.0015, (0.0, 47.0), 0.0035),
        (-0.0045, (0.0, 47.0), -0.0025),
        (-0.0005, (53.0, 0.0), -0.0025),
    ]:
        assert breakaway(loose, gap, position, 0.1, 0.0) == limits, position
        assert gap[0] == pytest.approx(element, abs=1e-15)


def test_a_play_counts_as_taken_up_within_a_rounding_error():
    loose = friction(Guide(50.0, backlash=0.004))
    for sign, limits in ((1.0, (50.0, 0.0)), (-1.0, (0.0, 50.0))):
        assert breakaway(loose, gap_at(0.0), sign * (0.002 - 5e-13), 0.1, 0.0) == limits
        assert breakaway(loose, gap_at(0.0), sign * (0.002 - 5e-12), 0.1, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("apart", "stretched"), [(0.005, 0.003), (0.001, 0.0), (-0.0015, 0.0), (-0.005, -0.003)]
)
def test_a_spring_behind_a_play_is_stretched_by_what_exceeds_half_of_it(apart, stretched):
    assert stretch(apart, 0.002) == pytest.approx(stretched)


@law_of("compliance", Guide)
@pytest.mark.parametrize(
    ("apart", "force", "slid"),
    [
        (0.0005, 0.0, 0.0),
        (0.002, 10.0, 0.0),
        (0.003, 20.0, 0.0),
        (0.004, 20.0, 0.001),
        (-0.0035, -25.0, 0.0),
        (-0.004, -30.0, 0.0),
        (-0.006, -30.0, -0.002),
    ],
)
def test_a_spring_in_series_stretches_until_dry_friction_slides(apart, force, slid):
    """k = 10 kN/m behind a play of ±1 mm; friction bears 20 N forward and 30 N backward."""
    found = slide(apart, 0.001, 1e4, 20.0, 30.0)
    assert found == pytest.approx((force, slid), abs=1e-12)


@law_of("compliance", Guide)
@law_of("backlash", Guide)
def test_after_a_reversal_the_spring_lets_go_before_friction_slides_again():
    back_and_forth = np.concatenate([np.linspace(0.0, 0.02, 1000), np.linspace(0.02, 0.0, 1000)])
    force = force_to_move(Guide(20.0, backlash=0.003), back_and_forth, spring=1e4)
    assert force[999] == pytest.approx(20.0)
    back = 0.02 - back_and_forth[1000:]
    expected = np.select(
        [back < 0.002, back < 0.005, back < 0.007],
        [20.0 - 1e4 * back, 0.0 * back, -1e4 * (back - 0.005)],
        -20.0,
    )
    np.testing.assert_allclose(force[1000:], expected, atol=1e-6)


@law_of("viscous_asymmetry", Guide)
@law_of("viscous", Guide)
@pytest.mark.parametrize(("viscous", "more"), [(0.0, 0.0), (300.0, 0.0), (300.0, 80.0)])
def test_viscous_friction_differs_by_half_its_asymmetry_each_way(viscous, more):
    guide = Guide(viscous=viscous, viscous_asymmetry=more)
    assert damping(guide, 0.2) == viscous + more / 2.0
    assert damping(guide, -0.2) == viscous - more / 2.0
    expected = viscous * SPEED + more / 2.0 * np.abs(SPEED)
    np.testing.assert_allclose(force_to_move(guide, SINE), expected, atol=1e-9)


@law_of("stiffness", Guide)
@law_of("offset", Guide)
@law_of("cogging", Guide)
@pytest.mark.parametrize(
    "guide",
    [
        Guide(),
        Guide(stiffness=2000.0),
        Guide(offset=-5.0),
        Guide(cogging=3.0),
        Guide(cogging=0.01),
        Guide(stiffness=800.0, offset=2.0, cogging=4.0, cogging_pitch=0.012, cogging_phase=0.7),
    ],
)
@pytest.mark.parametrize("position", [-0.011, 0.0, 0.02])
def test_forces_of_the_position_are_spring_offset_and_waves(guide, position):
    """F = k (x − x₀) + F₀ + F_w sin(2π x/p + φ)."""
    wave = math.sin(2.0 * math.pi * position / guide.cogging_pitch + guide.cogging_phase)
    expected = guide.stiffness * (position - 0.004) + guide.offset + guide.cogging * wave
    assert position_force(guide, position, 0.004) == pytest.approx(expected, abs=1e-12)


@law_of("slack", Guide)
@pytest.mark.parametrize(
    ("deflection", "pull"),
    [(0.02, 34.0), (0.0031, 0.2), (0.003, 0.0), (-0.001, 0.0), (-0.01, -14.0)],
)
def test_a_spring_bears_no_force_within_its_slack(deflection, pull):
    """F = k (d ∓ ½ s) beyond ±½ s, with d the deflection."""
    guide = Guide(stiffness=2000.0, slack=0.006)
    assert position_force(guide, 0.004 + deflection, 0.004) == pytest.approx(pull, abs=1e-9)


@law_of("cubic_stiffness", Guide)
@pytest.mark.parametrize("deflection", [-0.2, 0.0, 0.05, 0.3])
def test_a_spring_hardens_with_the_cube_of_its_deflection(deflection):
    """F = k d + k₃ d³."""
    guide = Guide(stiffness=200.0, cubic_stiffness=900.0)
    expected = 200.0 * deflection + 900.0 * deflection**3
    assert position_force(guide, 0.1 + deflection, 0.1) == pytest.approx(expected, abs=1e-9)


def test_the_nominal_wave_has_a_pitch_of_30_mm_and_no_phase():
    guide = Guide(cogging=3.0)
    assert position_force(guide, 0.0075, 0.0) == pytest.approx(3.0)
    assert position_force(guide, 0.0225, 0.0) == pytest.approx(-3.0)


HILLS = Guide(
    curve_2=4.0,
    curve_3=-2.0,
    curve_4=1.5,
    curve_5=0.7,
    curve_middle=0.01,
    curve_half_range=0.05,
)


@law_of("position_force", Guide)
@pytest.mark.parametrize("position", [-0.04, -0.011, 0.0, 0.01, 0.0331, 0.06])
def test_a_curve_over_the_stroke_is_a_chebyshev_series(position):
    """F = Σ c_n cos(n·arccos ξ) with ξ = (x − 0.01)/0.05."""
    angle = math.acos((position - 0.01) / 0.05)
    heights = (0.0, 0.0, 4.0, -2.0, 1.5, 0.7)
    expected = sum(height * math.cos(n * angle) for n, height in enumerate(heights))
    assert position_force(HILLS, position, 0.0) == pytest.approx(expected, abs=1e-12)


def test_beyond_its_range_a_curve_stays_as_at_the_end():
    up, down = (position_force(HILLS, 0.01 + end, 0.0) for end in (0.05, -0.05))
    assert position_force(HILLS, 0.5, 0.0) == up == pytest.approx(4.0 - 2.0 + 1.5 + 0.7)
    assert position_force(HILLS, -0.5, 0.0) == down == pytest.approx(4.0 + 2.0 + 1.5 - 0.7)


@law_of("drag", Guide)
def test_quadratic_friction_grows_with_the_square_of_the_speed():
    force = force_to_move(Guide(drag=800.0), SINE)
    np.testing.assert_allclose(force, 800.0 * SPEED * np.abs(SPEED), atol=1e-9)


@law_of("relaxation", Guide)
def test_relaxing_viscous_friction_lags_as_a_first_order_system():
    """At a constant speed from rest F = b v (1 − exp(−t/T))."""
    force = force_to_move(Guide(viscous=300.0, relaxation=0.05), 0.1 * TIME)
    expected = 300.0 * 0.1 * (1.0 - np.exp(-TIME / 0.05))
    np.testing.assert_allclose(force, expected, atol=0.02 * 30.0)


@law_of("load_friction", Guide)
def test_load_friction_of_a_prescribed_joint_counts_inertia_weight_and_spring():
    """F = N + μ|N| sgn v with N = m a + G + k x: the whole force that reaches the guide."""
    guide = Guide(stiffness=2000.0, load_coefficient=0.1)
    force = force_to_move(guide, SINE, mass=4.0, load=30.0)
    acceleration = np.gradient(SPEED, PERIOD)
    carried = 4.0 * acceleration + 30.0 + 2000.0 * SINE
    away = np.abs(SPEED) > 0.01
    away[:3] = False
    expected = carried + 0.1 * np.abs(carried) * np.sign(SPEED)
    np.testing.assert_allclose(force[away], expected[away], atol=1e-6)


@law_of("load_friction", Guide)
@law_of("coulomb", Guide)
def test_load_friction_of_a_pushed_joint_counts_the_actuators_force():
    """m dv/dt = F − G − F_c − μ|F|: weight and inertia are no part of the load."""
    guide = Guide(3.0, load_coefficient=0.1)
    speed = motion_under(guide, np.full(500, 40.0), mass=4.0, load=12.0)[1]
    expected = (40.0 - 12.0 - 3.0 - 0.1 * 40.0) / 4.0
    assert np.gradient(speed, PERIOD)[5:-5] == pytest.approx(expected)


@law_of("viscous", Guide)
@law_of("coulomb", Guide)
@law_of("drag", Guide)
@law_of("asymmetry", Guide)
@pytest.mark.parametrize("force", [60.0, -60.0])
@pytest.mark.parametrize(
    ("viscous", "dry", "drag", "uneven"),
    [(100.0, 0.0, 0.0, 0.0), (100.0, 15.0, 0.0, 4.0), (50.0, 10.0, 80.0, 0.0)],
)
def test_a_pushed_joint_ends_at_the_speed_where_all_forces_balance(
    force, viscous, dry, drag, uneven
):
    """|F| = F_c ± ½ a + b |v| + d v²."""
    guide = Guide(dry, viscous, drag=drag, asymmetry=uneven)
    final = motion_under(guide, np.full(1000, force), mass=1.5)[1, -1]
    remaining = abs(force) - dry - math.copysign(uneven / 2.0, force)
    if drag > 0.0:
        expected = (math.sqrt(viscous**2 + 4.0 * drag * remaining) - viscous) / (2.0 * drag)
    else:
        expected = remaining / viscous
    assert final == pytest.approx(math.copysign(expected, force), rel=1e-6)


def test_a_guide_that_resists_one_way_only_is_a_force_not_friction():
    """The weaker direction keeps at least 5 % of the mean friction, of either sort."""
    assert resists(Guide())
    assert resists(Guide(20.0, stribeck=-5.0, asymmetry=47.4))
    assert not resists(Guide(20.0, stribeck=-5.0, asymmetry=47.6))
    assert not resists(Guide(20.0, stribeck=-5.0, asymmetry=-47.6))
    assert resists(Guide(20.0, asymmetry=60.0, load_coefficient=0.1))
    assert resists(Guide(viscous=100.0, viscous_asymmetry=-190.0))
    assert resists(Guide(viscous=100.0, viscous_asymmetry=189.0))
    assert not resists(Guide(viscous=100.0, viscous_asymmetry=190.5))
    assert not resists(Guide(viscous=100.0, viscous_asymmetry=-190.5))
    assert not resists(Guide(20.0, asymmetry=-38.5))
