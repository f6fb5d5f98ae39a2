"""Runs of equal samples: what is cut off, and what only stands still."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.signals.runs import find_cut_off, longest_run, runs_at_ends

TIME = np.arange(2000) * 1e-3
SINE = np.sin(2.0 * np.pi * TIME)
RANDOM = np.random.default_rng(0)


def test_ticks_where_a_sensor_is_cut_off_do_not_count():
    noise = 1e-3 * np.random.default_rng(0).standard_normal(2000)
    signal = np.sin(np.linspace(0, 20, 2000)) + noise
    assert not find_cut_off(signal).any()
    clipped = np.minimum(signal, 0.8)
    assert np.array_equal(find_cut_off(clipped), clipped == 0.8)


def stop_and_go() -> np.ndarray:
    """It slows down, rests for half a second at the end of its travel, and goes back."""
    way = 0.5 - 0.5 * np.cos(np.pi * np.clip(TIME[:500] / 0.5, 0.0, 1.0))
    return np.concatenate([way, np.full(500, way[-1]), way[::-1]])


@pytest.mark.parametrize(
    ("signal", "ends"),
    [
        (np.clip(SINE, -0.9, 0.95), 4),
        (np.clip(SINE + 1e-3 * RANDOM.standard_normal(2000), -1.2, 0.8), 2),
        (SINE, 0),
        (stop_and_go(), 0),
        (np.round(20.0 * SINE) / 20.0, 0),
        (np.sign(SINE), 0),
        (np.maximum(SINE - 0.2, 0.0), 0),
        (np.round(300.0 * stop_and_go()) / 300.0, 0),
    ],
    ids=[
        "clipped",
        "clipped and noisy",
        "whole",
        "at rest",
        "bits",
        "steps",
        "off",
        "at rest in bits",
    ],
)
def test_what_runs_into_an_end_is_told_from_what_rests_there(signal, ends):
    assert len(runs_at_ends(signal)) == ends


def test_longest_run():
    signal = np.array([1.0, 1.0, 2.0, 2.0, 2.0, 3.0])
    assert longest_run(signal, np.ones(6, bool)) == (2, 3)
    assert longest_run(signal, signal != 2.0) == (0, 2)
    assert longest_run(np.arange(5.0), np.ones(5, bool)) == (0, 1)
