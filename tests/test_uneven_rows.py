"""Rows at uneven times: whose time stamps count, and what their noise becomes."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.describing.clock import find_clock
from rigtwin.importing.columns import Columns
from rigtwin.importing.timing import interpolate
from rigtwin.signals.noise import white_noise

PERIOD, ROWS = 0.01, 2000
EVEN = PERIOD * np.arange(ROWS)
LATE = np.sort(EVEN + np.random.default_rng(3).normal(0.0, 0.05 * PERIOD, ROWS))


@pytest.mark.parametrize(("sampled", "resampled"), [(LATE, True), (EVEN, False)])
def test_stamps_count_if_the_motion_is_smooth_by_them(sampled: np.ndarray, resampled: bool):
    noise = np.random.default_rng(4).standard_normal((2, ROWS))
    angle = np.sin(2.0 * sampled) + 1e-4 * noise[0]
    columns = Columns({"t": LATE, "q": angle, "tau": np.cos(3.0 * sampled) + 0.05 * noise[1]})
    clock = find_clock(columns, "t [s]")
    assert (clock.resample is not None) == resampled
    if clock.resample is not None:
        assert clock.resample == pytest.approx(PERIOD, rel=1e-4)


def test_noise_alone_does_not_tell_when_rows_were_sampled():
    noise = np.random.default_rng(5).standard_normal(ROWS)
    assert find_clock(Columns({"t": LATE, "q": noise}), "t [s]").resample is None


def test_the_grid_follows_rows_whose_period_is_not_round():
    stamps = np.delete(1.00107 * EVEN, [300, 301])
    clock = find_clock(Columns({"t": stamps, "q": np.sin(stamps)}), "t [s]")
    assert clock.resample == pytest.approx(1.00107 * PERIOD, rel=1e-4)


def test_interpolation_keeps_most_of_the_noise():
    noise = np.random.default_rng(6).standard_normal(ROWS)
    between = interpolate(EVEN, noise, 1.0003 * EVEN[:-2], np.inf)
    assert 0.75 < white_noise(between) < 1.0


def test_held_values_and_gaps_are_interpolated_straight():
    steps = np.repeat([0.0, 1.0, 0.0, 1.0], ROWS // 4)
    between = interpolate(EVEN, steps, EVEN[:-1] + 0.3 * PERIOD, np.inf)
    assert between.min() >= 0.0
    assert between.max() <= 1.0
    rows = np.r_[0:50, 90:ROWS]
    bridged = interpolate(EVEN[rows], np.sin(9.0 * EVEN[rows]), EVEN[50:90], 1.5 * PERIOD)
    np.testing.assert_allclose(np.diff(bridged, 2), 0.0, atol=1e-12)
