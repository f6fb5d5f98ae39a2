"""Recordings that are predicted window by window: which are, and how well."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rigtwin.models.forward_dynamics import ForwardDynamicsModel
from rigtwin.models.initial_state import InitialState
from rigtwin.models.start import read_start
from rigtwin.models.windows import FEWEST, GROWN, SHORTEST, divide
from tests.helpers.coupled import PERIOD, arm, integrate, recording

NOISE = 2e-4


def judge_by(rate: float):
    """Judge states of a machine whose errors grow by e in every 1/rate ticks."""

    def judge(first: int, last: int) -> InitialState:
        state = InitialState({}, np.zeros(1), 1, 0.01)
        state.growth = float(np.exp(min(rate * (last - first), 50.0)))
        return state

    return judge


@pytest.mark.parametrize("rate", [0.0, 0.01, 0.03, 0.3])
def test_windows_cover_all_ticks_and_end_before_errors_grow(rate: float) -> None:
    windows = divide(0, 3001, 0.01, judge_by(rate))
    assert (windows[0].first, windows[-1].last) == (0, 3001)
    assert all(before.last == after.first for before, after in pairwise(windows))
    shortest = min(window.ticks for window in windows)
    assert all(w.state.growth <= GROWN or w.ticks < 4 * FEWEST for w in windows)
    assert shortest >= FEWEST
    assert (len(windows) == 1) == (rate == 0.0)


def measured(start: tuple[float, float], ticks: int) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(ticks) * PERIOD
    torques = np.stack([2.0 * np.sin(4.0 * time), 0.8 * np.sin(7.0 * time + 1.0)])
    return torques, integrate(torques, start, (0.0, 0.0))[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "regular"),
    [((0.2, -0.1), True), ((3.0, 0.5), False)],
)
def test_a_whirling_double_pendulum_is_predicted_to_the_noise(
    tmp_path: Path, start: tuple[float, float], regular: bool
) -> None:
    machine = arm(tmp_path)
    torques, angles = measured(start, 4000)
    random = np.random.default_rng(4)
    observed = angles + NOISE * random.standard_normal(angles.shape)
    columns = {
        "/command": dict(zip(("drive_1", "drive_2"), torques, strict=True)),
        "/sensor": dict(zip(("angle_1", "angle_2"), observed, strict=True)),
    }
    record = recording(machine, columns)
    model = machine.physics.model(machine, record.inputs, machine.configuration_of(record), 8)
    assert isinstance(model, ForwardDynamicsModel)
    assert (model.cuts == ()) == regular
    rest = np.std(model.predict(machine.plant) - observed, axis=1)
    assert np.all(rest < 1.3 * NOISE)


def test_a_start_is_read_from_both_sides_and_no_more_stiffly_than_the_motion() -> None:
    time, random = np.arange(200) * 0.01, np.random.default_rng(1)
    signal = np.sin(12.0 * time) + 1e-3 * random.standard_normal(200)
    value, slope = np.sin(12.0), 12.0 * np.cos(12.0)
    stiff = read_start(signal[100:], 0.01)
    free = read_start(signal[100:], 0.01, 1e-3)
    both = read_start(signal[100:], 0.01, 1e-3, signal[:100])
    errors = [abs(read[1] - slope) for read in (stiff, free, both)]
    assert errors[0] > errors[1] > errors[2]
    assert both[0] == pytest.approx(value, abs=2e-3)
    assert errors[2] < 0.1


@pytest.mark.parametrize(("rate", "longest"), [(10.7, 0.4), (200.0, 0.3)])
def test_a_short_pendulum_upright_cannot_fall_within_a_window(rate: float, longest: float) -> None:
    """Errors grow by the rate a second; no window is shorter than 0.15 s, however they grow."""
    windows = divide(0, 12000, 0.002, judge_by(0.002 * rate))
    lengths = [0.002 * window.ticks for window in windows]
    assert min(lengths) >= SHORTEST
    assert max(lengths) <= longest
