"""The cross of beams against closed forms, the thesis' figures and its own 78 freedoms."""

from __future__ import annotations

import math
import time

import numba
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from controllers import Settings
from controllers.beam import (
    FREEDOMS,
    MODES,
    all_modes,
    assembled,
    at_start,
    beam,
    centre,
    element,
    modes,
)

SETTINGS = Settings()
PERIOD = 1e-3
UPWARD = np.zeros(FREEDOMS)
UPWARD[2::6] = 1.0


def test_the_whole_weighs_what_the_thesis_says():
    mass, stiffness = assembled(SETTINGS)
    assert mass.shape == (78, 78)
    assert UPWARD @ mass @ UPWARD == pytest.approx(24.998, abs=5e-4)
    assert np.allclose(mass, mass.T)
    # Six rigid motions cost no energy: three translations, three rotations about the centre.
    assert np.sum(np.abs(np.linalg.eigvalsh(stiffness)) < 1e-6 * np.abs(stiffness).max()) == 6


def test_heave_modes_free_and_on_a_spring():
    free = modes(SETTINGS, PERIOD).frequencies
    assert free[0] == 0.0
    assert free[1:3] == pytest.approx([2.655, 14.43], rel=5e-4)
    mass, stiffness = assembled(SETTINGS)
    stiffness[2, 2] += 1000.0
    squares, shapes = eigh(stiffness, mass)
    felt = np.abs(shapes[2]) > 1e-3
    assert np.sqrt(np.abs(squares[felt]))[:2] / (2 * math.pi) == pytest.approx(
        [0.899, 2.953], rel=6e-4
    )


def test_one_arm_is_an_euler_bernoulli_cantilever():
    """Three elements give the first frequency of a clamped beam of 6 m: (1.8751)² √(EI/ρA)/L²."""
    mass, stiffness = assembled(SETTINGS)
    arm = [6 * node + freedom for node in (1, 2, 3) for freedom in (2, 4)]
    squares = eigh(stiffness[np.ix_(arm, arm)], mass[np.ix_(arm, arm)])[0]
    root = float(brentq(lambda x: math.cos(x) * math.cosh(x) + 1, 1.5, 2.2))  # type: ignore[arg-type]
    s = SETTINGS
    exact = (
        root**2
        * math.sqrt(s.beam_modulus * s.beam_inertia / (s.beam_density * s.beam_area))
        / 6.0**2
    )
    assert math.sqrt(squares[0]) == pytest.approx(exact, rel=1e-3)


def test_an_element_stretches_and_bends_as_it_should():
    _, stiffness = element(SETTINGS)
    s, length = SETTINGS, SETTINGS.beam_length
    free = slice(6, 12)
    moved = np.linalg.solve(stiffness[free, free], np.eye(6))
    assert moved[0, 0] == pytest.approx(length / (s.beam_modulus * s.beam_area))
    assert moved[2, 2] == pytest.approx(length**3 / (3 * s.beam_modulus * s.beam_inertia))
    # Pushed up at its tip it turns about −y.
    assert moved[4, 2] == pytest.approx(-(length**2) / (2 * s.beam_modulus * s.beam_inertia))


def test_reduced_and_whole_agree_below_5_hz():
    angular, shapes = all_modes(SETTINGS)
    reduced = modes(SETTINGS, PERIOD)
    kept = 2 * math.pi * reduced.frequencies
    damping = SETTINGS.beam_damping
    for frequency in np.linspace(0.05, 5.0, 400):
        s = 2j * math.pi * frequency
        whole = np.sum(shapes[2] ** 2 / (s**2 + damping * angular**2 * s + angular**2))
        ours = np.sum(reduced.centre**2 / (s**2 + damping * kept**2 * s + kept**2))
        assert abs(ours - whole) < 1e-3 * abs(whole), frequency


def test_gravity_moves_it_as_a_whole():
    model = modes(SETTINGS, PERIOD)
    assert np.abs(model.weight[1:]).max() < 1e-9 * abs(model.weight[0])
    at, rates = at_start(SETTINGS, model), (0.0,) * MODES
    for _ in range(500):
        at, rates = beam(model, at, rates, 0.0)
    assert centre(model, at) == pytest.approx(SETTINGS.start - 0.5 * 9.81 * 0.5**2, rel=1e-9)
    assert centre(model, rates) == pytest.approx(-9.81 * 0.5, rel=1e-9)


def test_bent_start_is_at_rest_under_its_weight():
    settings = SETTINGS._replace(beam_sag=1.0, preload=24.998 * 9.81)
    model = modes(settings, PERIOD)
    at, rates = at_start(settings, model), (0.0,) * MODES
    for _ in range(1000):
        at, rates = beam(model, at, rates, settings.preload)
    assert centre(model, at) == pytest.approx(settings.start, abs=2e-4)


@numba.njit
def many(model, ticks):  # type: ignore[no-untyped-def]
    at, rates = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for tick in range(ticks):
        at, rates = beam(model, at, rates, float(tick % 7))
    return centre(model, at)


def test_one_tick_is_cheap():
    """The limit is 5 us; it takes about a tenth of one, so even a busy machine passes."""
    model = modes(SETTINGS, PERIOD)
    many(model, 10)
    took = []
    for _ in range(5):
        start = time.perf_counter()
        many(model, 20_000)
        took.append((time.perf_counter() - start) / 20_000)
    assert min(took) < 5e-6
