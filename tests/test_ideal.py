"""The ideal emulated systems against solve_ivp."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_lyapunov

from controllers import Settings, Skyhook, Structure
from controllers.beam import all_modes, assembled
from controllers.skyhook import semi_active_damping
from experiments.single_mass import CHAPTER_3
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.simulation.ideal import simulate_ideal

TIME = np.arange(10_000) * 1e-3


def ground_at(t):
    return 0.005 * np.sin(2 * np.pi * 1.1 * t) * np.minimum(t, 1.0)


@pytest.mark.parametrize("sky", [0.0, 200.0])
def test_quarter_car(sky):
    settings = Settings(skyhook=Skyhook.ACTIVE if sky else Skyhook.NONE, skyhook_damping=sky)

    def slope(t, s):
        force = 200 - 1000 * (s[0] - s[2]) - 50 * (s[1] - s[3]) - sky * s[1]
        return [s[1], force / 25 - 9.81, s[3], (50_000 * (ground_at(t) - s[2]) - force) / 34]

    exact = solve_ivp(slope, (0, 10), [-0.004, 0, -0.004, 0], t_eval=TIME, rtol=1e-9, atol=1e-11).y
    ours = simulate_ideal(Configuration(controller=settings), ground_at(TIME))
    assert np.max(np.abs(ours.structure - exact[0])) < 2e-4
    assert np.max(np.abs(ours.wheel - exact[2])) < 2e-4
    assert np.max(np.abs(ours.velocity - exact[1])) < 2e-3


def test_single_mass():
    def slope(t, s):
        rate = (ground_at(t + 1e-6) - ground_at(t - 1e-6)) / 2e-6
        return [s[1], (220 - 350 * (s[0] - ground_at(t)) - 30 * (s[1] - rate)) / 25 - 9.81]

    exact = solve_ivp(slope, (0, 10), [-0.0044, 0], t_eval=TIME, rtol=1e-9, atol=1e-11).y
    ours = simulate_ideal(Configuration(controller=CHAPTER_3), ground_at(TIME))
    assert np.max(np.abs(ours.structure - exact[0])) < 1e-4
    # Static drop, thesis §3.6: 0.072 m.
    at_rest = simulate_ideal(Configuration(controller=CHAPTER_3), np.zeros(60_000))
    assert at_rest.structure[-1] == pytest.approx(-0.0721, abs=2e-4)
    assert at_rest.force[-1] == pytest.approx(25 * 9.81, rel=1e-3)


@pytest.mark.slow
def test_semi_active_quarter_car():
    settings = Settings(skyhook=Skyhook.SEMI_ACTIVE, skyhook_damping=200.0)

    def slope(t, s):
        travel = s[1] - s[3]
        damper = semi_active_damping(settings, s[1], travel) * travel
        force = 200 - 1000 * (s[0] - s[2]) - 50 * travel - damper
        return [s[1], force / 25 - 9.81, s[3], (50_000 * (ground_at(t) - s[2]) - force) / 34]

    exact = solve_ivp(
        slope, (0, 10), [-0.004, 0, -0.004, 0], t_eval=TIME, max_step=2e-4, rtol=1e-6, atol=1e-9
    ).y
    ours = simulate_ideal(Configuration(controller=settings), ground_at(TIME))
    assert np.max(np.abs(ours.structure - exact[0])) < 2e-4
    # It is not the passive suspension.
    assert (
        np.max(np.abs(simulate_ideal(Configuration(), ground_at(TIME)).structure - exact[0])) > 5e-3
    )


@pytest.mark.slow
def test_beams_on_a_quarter_car_against_all_78_freedoms():
    settings = Settings(structure=Structure.BEAM)
    mass, _ = assembled(settings)
    angular, shapes = all_modes(settings)
    upward = np.zeros(len(mass))
    upward[2::6] = 1.0
    weight, centre, damping = (
        shapes.T @ mass @ upward * -9.81,
        shapes[2],
        settings.beam_damping * angular**2,
    )

    def slope(t, s):
        q, rate, wheel, wheel_rate = s[:78], s[78:156], s[156], s[157]
        force = 200 - 1000 * (centre @ q - wheel) - 50 * (centre @ rate - wheel_rate)
        modal = centre * force + weight - angular**2 * q - damping * rate
        return np.concatenate(
            [rate, modal, [wheel_rate, (50_000 * (ground_at(t) - wheel) - force) / 34]]
        )

    start = np.zeros(158)
    start[:78] = shapes.T @ mass @ upward * -0.004
    start[156] = -0.004
    exact = solve_ivp(
        slope, (0, 1.5), start, t_eval=TIME[:1500], method="LSODA", rtol=1e-7, atol=1e-10
    ).y
    ours = simulate_ideal(
        Configuration(controller=settings, timing=Timing(duration=1.5)), ground_at(TIME[:1500])
    )
    assert np.max(np.abs(ours.structure - centre @ exact[:78])) < 5e-4
    tip = shapes[6 * 3 + 2] @ exact[:78]
    assert ours.wing is not None
    assert np.max(np.abs(ours.wing[:, 3] - tip)) < 5e-4
    assert np.ptp(tip) > 0.1


def test_stationary_rms_on_a_white_noise_road_by_the_lyapunov_equation():
    # Ground velocity white: ẋ = A x + B w, A P + P Aᵀ + B Bᵀ S = 0.
    k, b, m, kt, mu = 1000.0, 50.0, 25.0, 50_000.0, 34.0
    # The ground itself wanders; travel, deflection and velocities are stationary: states z = x_s −
    # x_u, v_s, y = x_u − u, v_u.
    a = np.array(
        [
            [0, 1, 0, -1],
            [-k / m, -b / m, 0, b / m],
            [0, 0, 0, 1],
            [k / mu, b / mu, -kt / mu, -b / mu],
        ]
    )
    noise = np.array([0.0, 0.0, -1.0, 0.0])
    density = 1e-4
    covariance = solve_continuous_lyapunov(a, -density * np.outer(noise, noise))
    settings = Settings(preload=25 * 9.81, start=-25 * 9.81 / kt)
    ticks, period = 400_000, 1e-3
    random = np.random.default_rng(3)
    ground = np.cumsum(random.standard_normal(ticks)) * math.sqrt(density * period)
    run = simulate_ideal(Configuration(controller=settings), ground)
    late = slice(20_000, None)
    for signal, variance in (
        (run.velocity, covariance[1, 1]),
        (run.structure - run.wheel, covariance[0, 0]),
        (run.wheel - ground, covariance[2, 2]),
    ):
        assert np.std(signal[late]) == pytest.approx(math.sqrt(variance), rel=0.05)


@pytest.mark.parametrize(("stiffness", "damping"), [(1000.0, 50.0), (4000.0, 300.0)])
def test_passive_invariant_point(stiffness, damping):
    """At ω² = k_t / m_u the forces on both masses give m_s·x_s = −m_u·u, whatever the
    suspension."""
    frequency = math.sqrt(50_000.0 / 34.0)
    time = np.arange(40_000) * 1e-3
    # A ground held over each tick is half a tick late and a little smaller; both are far below the
    # tolerance.
    ground = 1e-3 * np.sin(frequency * time)
    settings = Settings(
        suspension_stiffness=stiffness,
        suspension_damping=damping,
        preload=25 * 9.81,
        start=-25 * 9.81 / 5e4,
    )
    late = slice(20_000, None)
    moved = simulate_ideal(Configuration(controller=settings), ground).structure[late]
    waves = np.column_stack(
        [np.sin(frequency * time[late]), np.cos(frequency * time[late]), np.ones(20_000)]
    )
    along, across, _ = np.linalg.lstsq(waves, moved, rcond=None)[0]
    assert along == pytest.approx(-34 / 25 * 1e-3, rel=0.01)
    assert abs(across) < 0.03 * abs(along)
