"""A guide behind a mount that yields: a spring in series with everything the guide does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rigtwin.components import Guide, mount
from rigtwin.components.guide_step import guide_step_of
from rigtwin.components.mount import MountState, give_way, guess_position, resist_at
from tests.laws.joints import PERIOD, force_to_move, motion_under
from tests.laws.written import law_of

STEP, SPRING, REST = 1e-3, 2e5, 0.001
GUIDES = [
    Guide(mount_compliance=1e-4),
    Guide(20.0, mount_compliance=1e-4),
    Guide(20.0, 300.0, 2000.0, mount_compliance=1e-4, offset=4.0),
    Guide(20.0, asymmetry=6.0, backlash=0.002, mount_compliance=3e-4),
    Guide(5.0, 100.0, viscous_asymmetry=40.0, drag=900.0, mount_compliance=1e-4),
    Guide(8.0, stribeck=4.0, load_coefficient=0.1, cogging=3.0, mount_compliance=2e-4),
    Guide(viscous=500.0, relaxation=0.02, drag=50.0, stiffness=500.0, mount_compliance=5e-4),
    Guide(5.0, 400.0, 300.0, relaxation=0.02, mount_compliance=3e-4),
    Guide(10.0, 100.0, 500.0, backlash=0.004, mount_compliance=2e-4, offset=3.0),
    Guide(0.5, cogging=8.0, cogging_pitch=0.002, cogging_phase=1.0, mount_compliance=2e-4),
    Guide(2.0, curve_2=3.0, curve_3=-900.0, curve_half_range=0.4, mount_compliance=2e-4),
]
STATES = [
    (outer, inner, speed, slider, viscous, load)
    for outer, inner, speed, slider, viscous, load in np.random.default_rng(2)
    .uniform(-1.0, 1.0, (40, 6))
    .tolist()
]
"""Shares of the largest outer position, inner position, speed, slider, viscous force and load."""
SIZES = (0.006, 0.004, 0.05, 0.004, 20.0, 60.0)


def limits_of(guide: Guide, speed: float, load: float) -> tuple[float, float]:
    """Return what dry friction bears, forward and backward, N."""
    ratio = abs(speed) / guide.stribeck_velocity
    size = guide.coulomb + guide.load_coefficient * abs(load)
    size += guide.stribeck * math.exp(-(ratio**guide.stribeck_exponent))
    return max(size + guide.asymmetry / 2.0, 0.0), max(size - guide.asymmetry / 2.0, 0.0)


def written_resistance(
    guide: Guide,
    share: float,
    inner: float,
    slider: float,
    viscous: float,
    limits: tuple[float, float],
    position: float,
) -> tuple[float, float, float]:
    """Return a guide's force N, how far its slider slides m, and the lagging viscous force N."""
    half, apart = guide.backlash / 2.0, position - slider
    stretched = math.copysign(max(abs(apart) - half, 0.0), apart)
    dry = min(max(SPRING * stretched, -limits[1]), limits[0])
    slid = stretched - dry / SPRING
    v = (position - inner) / STEP
    uneven = math.copysign(guide.viscous_asymmetry / 2.0, v)
    lagging = viscous + share * ((guide.viscous + uneven) * v - viscous)
    wave = math.sin(2.0 * math.pi * position / guide.cogging_pitch + guide.cogging_phase)
    force = guide.stiffness * (position - REST) + guide.offset + guide.cogging * wave
    bent = math.acos(min(max(position / guide.curve_half_range, -1.0), 1.0))
    force += guide.curve_2 * math.cos(2.0 * bent) + guide.curve_3 * math.cos(3.0 * bent)
    return force + dry + lagging + guide.drag * v * abs(v), slid, lagging


@law_of("mount", Guide)
@pytest.mark.parametrize("guide", GUIDES)
@pytest.mark.parametrize("shares", STATES)
def test_the_mounts_stretch_is_its_compliance_times_all_that_the_guide_does(guide, shares):
    """x_outer − x = c F(x), with dry friction by the speed of the step before."""
    outer, inner, speed, slider, viscous, load = (
        share * size for share, size in zip(shares, SIZES, strict=True)
    )
    share = STEP / (guide.relaxation + STEP)
    limits = limits_of(guide, speed, load)
    if guide.coulomb == guide.stribeck == guide.load_coefficient == 0.0:
        slider = inner
    guide_step = guide_step_of(guide, SPRING, REST, STEP)
    state = MountState(inner, speed, slider, viscous)
    (position, _, slid_to, lagging), force = give_way(guide_step, state, load, outer)
    expected = written_resistance(guide, share, inner, slider, viscous, limits, position)
    assert force == pytest.approx(expected[0], abs=1e-9)
    assert slid_to == pytest.approx(slider + expected[1], abs=1e-15)
    assert lagging == pytest.approx(expected[2], abs=1e-9)
    mismatch = position + guide.mount_compliance * force - outer
    assert abs(mismatch) <= 1.1e-9 * abs(outer - inner) + 1e-15
    directly = resist_at(guide_step, state, limits, position)
    assert directly == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("guide", [g for g in GUIDES if g.drag == g.cogging == g.curve_3 == 0.0])
@pytest.mark.parametrize("shares", STATES)
def test_where_only_dry_friction_is_nonlinear_the_first_guess_is_the_equilibrium(guide, shares):
    outer, inner, speed, slider, viscous, load = (
        share * size for share, size in zip(shares, SIZES, strict=True)
    )
    share = STEP / (guide.relaxation + STEP)
    limits = limits_of(guide, speed, load)
    guide_step = guide_step_of(guide, SPRING, REST, STEP)
    state = MountState(inner, speed, slider, viscous)
    position, slope = guess_position(guide_step, state, limits, outer)
    force = written_resistance(guide, share, inner, slider, viscous, limits, position)[0]
    assert position + guide.mount_compliance * force == pytest.approx(outer, abs=1e-14)
    # The slope is how much further the mount's end is for a guide that is further.
    ahead = position + 1e-9
    force_ahead = written_resistance(guide, share, inner, slider, viscous, limits, ahead)[0]
    expected = 1.0 + guide.mount_compliance * (force_ahead - force) / 1e-9
    assert slope == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_a_guide_with_steep_waves_finds_an_equilibrium_however_soft_its_mount(seed):
    """Where 2π w c > p the waves fall more steeply than the mount resists."""
    random = np.random.default_rng(seed)
    for _ in range(60):
        guide = Guide(
            coulomb=random.choice([0.0, 5.0]),
            viscous=random.choice([0.0, 100.0]),
            stiffness=random.choice([0.0, 500.0]),
            cogging=10.0 ** random.uniform(-1.0, 2.0),
            cogging_pitch=10.0 ** random.uniform(-3.5, -1.0),
            cogging_phase=random.uniform(-3.0, 3.0),
            mount_compliance=10.0 ** random.uniform(-6.0, -3.0),
        )
        outer, inner, slider = random.uniform(-0.02, 0.02, 3)
        guide_step = guide_step_of(guide, SPRING, REST, STEP)
        (position, *_), force = give_way(
            guide_step, MountState(inner, 0.1, slider, 0.0), 0.0, outer
        )
        mismatch = position + guide.mount_compliance * force - outer
        assert abs(mismatch) <= 1.1e-9 * abs(outer - inner) + 1e-15


@pytest.mark.parametrize(
    ("guide", "most"),
    [
        (Guide(20.0, 300.0, 2000.0, mount_compliance=1e-4), 1),
        (Guide(5.0, 100.0, drag=900.0, mount_compliance=1e-4), 12),
        (Guide(5.0, 100.0, viscous_asymmetry=90.0, drag=4000.0, mount_compliance=1e-3), 13),
        (Guide(0.5, cogging=3.0, cogging_pitch=0.01, mount_compliance=2e-4), 22),
    ],
)
def test_an_equilibrium_needs_few_evaluations_of_the_law(monkeypatch, guide, most):
    counts: list[int] = []
    evaluate = mount.resist_at

    def count(*arguments: Any) -> tuple[float, float, float]:
        counts[-1] += 1
        return evaluate(*arguments)

    monkeypatch.setattr(mount, "resist_at", count)
    for shares in STATES:
        outer, inner, speed, slider, viscous, load = (
            share * size for share, size in zip(shares, SIZES, strict=True)
        )
        counts.append(0)
        guide_step = guide_step_of(guide, SPRING, REST, STEP)
        give_way(guide_step, MountState(inner, speed, slider, viscous), load, outer)
    assert max(counts) <= most


@law_of("mount", Guide)
def test_behind_a_mount_viscous_friction_lags_by_viscosity_times_compliance():
    """At a constant speed from rest F = b v (1 − exp(−t/(b c)))."""
    time = PERIOD * np.arange(1000)
    guide = Guide(viscous=300.0, mount_compliance=2e-4)
    force = force_to_move(guide, 0.1 * time)
    expected = 30.0 * (1.0 - np.exp(-time / 0.06))
    np.testing.assert_allclose(force, expected, atol=0.01 * 30.0)


@law_of("mount", Guide)
def test_a_mass_on_a_stuck_guide_swings_on_its_mount():
    """x = c F (1 − cos(t/√(c m)))."""
    guide = Guide(1e4, mount_compliance=1e-3)
    position = motion_under(guide, np.full(1500, 5.0), mass=2.0)[0]
    time = PERIOD * np.arange(1500)
    expected = 5e-3 * (1.0 - np.cos(time / math.sqrt(2e-3)))
    np.testing.assert_allclose(position, expected, atol=0.01 * 5e-3)
