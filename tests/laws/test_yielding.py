"""A plate that yields to its load: a spring behind a lag, in equilibrium with the rod's force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from rigtwin.components import Cylinder
from rigtwin.components.yielding import Rod, rod_load, solve_yielding, yield_to_load
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = PERIOD * np.arange(300)


@law_of("compliance", Cylinder)
@pytest.mark.parametrize(("compliance", "lag", "zero"), [(1e-6, 0.0, 0.0), (3e-6, 0.02, 150.0)])
def test_a_plate_yields_by_its_compliance_times_the_load_beyond_its_zero(compliance, lag, zero):
    """y = c (N − z), behind a lag of first order."""
    cylinder = Cylinder(compliance=compliance, yield_lag=lag, zero_load=zero)
    load = np.where(TIME < 0.05, 200.0, 500.0)
    # The load rises linearly over the tick before 0.05 s, so the jump lies half a tick earlier.
    since = np.maximum(TIME + 0.5 * PERIOD - 0.05, 0.0)
    reached = np.where(since > 0.0, 1.0, 0.0) if lag == 0.0 else 1.0 - np.exp(-since / lag)
    expected = compliance * (200.0 - zero + 300.0 * reached)
    tolerance = 1e-12 if lag == 0.0 else compliance * 300.0 * (PERIOD / lag) ** 2 / 8.0
    assert yield_to_load(cylinder, load, PERIOD) == pytest.approx(expected, abs=tolerance)


def test_a_nominal_cylinder_does_not_yield():
    assert not np.any(yield_to_load(Cylinder(), np.full(5, 300.0), PERIOD))


RODS = [(30.0, 0.0, 14.0, 14.0), (30.0, 200.0, 20.0, 5.0), (-60.0, 50.0, 0.0, 0.0)]
"""Motor force N, viscous friction Ns/m, dry friction forward and backward N."""


def written_load(v: float, free: float, share: float, rod: tuple[float, ...]) -> float:
    """Solve N = F − b s − R(s) with the sliding speed s = free + share N − v for the load N."""
    force, viscous, forward, backward = rod
    stuck = (v - free) / share
    if -forward <= stuck - force <= backward:
        return stuck
    sign = 1.0 if stuck < force - forward else -1.0
    dry = forward if sign > 0.0 else -backward
    return (force - dry - viscous * (free - v)) / (1.0 + viscous * share)


@pytest.mark.parametrize("rod", RODS)
@pytest.mark.parametrize("share", [1e-4, 2e-3])
@pytest.mark.parametrize("v", [-0.3, -0.04, 0.0, 0.001, 0.05, 0.4])
@pytest.mark.parametrize("free", [-0.1, 0.0, 0.08])
def test_the_rods_load_balances_motor_friction_and_plate(rod, share, v, free):
    found = rod_load(Rod(free, share, *rod), v)
    assert found == pytest.approx(written_load(v, free, share, rod), abs=1e-9)


@pytest.mark.parametrize("rod", RODS)
@pytest.mark.parametrize("seed", range(4))
def test_carriage_and_plate_are_in_equilibrium_at_the_end_of_a_step(rod, seed):
    """m v + h N(v) + rail friction = rhs, found by bisection instead of case by case."""
    random = np.random.default_rng(seed)
    for _ in range(60):
        inertia, step = 10.0 ** random.uniform(-1.0, 1.0), 10.0 ** random.uniform(-4.0, -2.0)
        rail = step * random.uniform(0.0, 60.0, 2)
        share, free = 10.0 ** random.uniform(-6.0, -2.0), random.choice([0.0, 0.08, -0.1])
        rhs = step * random.uniform(-200.0, 200.0) + random.choice([0.0, inertia * free])

        def left(v: float) -> float:
            return inertia * v + step * written_load(v, free, share, rod) - rhs  # noqa: B023

        if left(0.0) + rail[0] < 0.0:
            v = brentq(lambda speed: left(speed) + rail[0], 0.0, 50.0, xtol=1e-15)  # noqa: B023
        elif left(0.0) - rail[1] > 0.0:
            v = brentq(lambda speed: left(speed) - rail[1], -50.0, 0.0, xtol=1e-15)  # noqa: B023
        else:
            v = 0.0
        assert isinstance(v, float)
        both = (float(rail[0]), float(rail[1]))
        found = solve_yielding(Rod(free, share, *rod), rhs, inertia, step, both)
        assert found[0] == pytest.approx(v, abs=1e-9)
        # A stuck rod passes on the least difference of the velocities, 1/share newtons a metre a
        # second.
        load = written_load(v, free, share, rod)
        assert found[1] == pytest.approx(load, rel=1e-6, abs=1e-12 / share)
