"""The ideal systems against solve_ivp, and e1, e2 beside the thesis."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from controllers import Settings, Skyhook
from experiments.single_mass import CHAPTER_3
from experiments.studies import TABLE_3_5, TABLE_6_3_FORCE, find, run_once
from rigtwin.configuration import Configuration, Timing
from rigtwin.errors import RigtwinError
from rigtwin.metrics import ideal, tracking

TIME = np.arange(10_000) * 1e-3


def ground_at(t):
    return 0.005 * np.sin(2 * np.pi * 1.1 * t) * np.minimum(t, 1.0)


@pytest.mark.parametrize("sky", [0.0, 200.0])
def test_ideal_quarter_car(sky):
    settings = Settings(skyhook=Skyhook.ACTIVE if sky else Skyhook.NONE, skyhook_damping=sky)

    def slope(t, s):
        force = 200 - 1000 * (s[0] - s[2]) - 50 * (s[1] - s[3]) - sky * s[1]
        return [s[1], force / 25 - 9.81, s[3], (50_000 * (ground_at(t) - s[2]) - force) / 34]

    exact = solve_ivp(slope, (0, 10), [-0.004, 0, -0.004, 0], t_eval=TIME, rtol=1e-9, atol=1e-11).y
    ours = ideal(Configuration(controller=settings), ground_at(TIME))
    assert np.max(np.abs(ours.structure - exact[0])) < 2e-4
    assert np.max(np.abs(ours.wheel - exact[2])) < 2e-4


def test_ideal_single_mass():
    def slope(t, s):
        rate = (ground_at(t + 1e-6) - ground_at(t - 1e-6)) / 2e-6
        return [s[1], (220 - 350 * (s[0] - ground_at(t)) - 30 * (s[1] - rate)) / 25 - 9.81]

    exact = solve_ivp(slope, (0, 10), [-0.0044, 0], t_eval=TIME, rtol=1e-9, atol=1e-11).y
    ours = ideal(Configuration(controller=CHAPTER_3), ground_at(TIME))
    assert np.max(np.abs(ours.structure - exact[0])) < 1e-4
    # Static drop, thesis §3.6: 0.072 m.
    at_rest = ideal(Configuration(controller=CHAPTER_3), np.zeros(60_000))
    assert at_rest.structure[-1] == pytest.approx(-0.0721, abs=2e-4)
    assert at_rest.force[-1] == pytest.approx(25 * 9.81, rel=1e-3)


def test_semi_active_has_no_linear_ideal():
    with pytest.raises(RigtwinError, match="not linear"):
        ideal(Configuration(controller=Settings(skyhook=Skyhook.SEMI_ACTIVE)), np.zeros(10))


def test_table_3_5_within_a_factor_of_two():
    experiment = find("single-mass")
    assert experiment.configuration.timing == Timing(duration=45.0)
    runs = [tracking(run_once("single-mass", seed), experiment.configuration) for seed in range(3)]
    for name in ("position_e1", "position_e2", "force_e1", "force_e2"):
        ratio = float(np.median([getattr(run, name) for run in runs])) / TABLE_3_5[name][0]
        assert 0.5 < ratio < 2.0, name


def test_table_6_3_force():
    errors = tracking(run_once("drop", 0), find("drop").configuration)
    assert errors.force_total == pytest.approx(TABLE_6_3_FORCE, rel=0.2)


def test_limit_cycle_and_missing_wheel_hop():
    recording = run_once("drop", 0)
    late = recording.time > 10
    assert np.ptp(recording.column("/truth", "load_cell")[late]) > 2 * 14
    wheel = recording.column("/truth", "structure") - recording.column("/truth", "suspension")
    assert np.std(wheel[recording.time > 3]) < 5e-6
