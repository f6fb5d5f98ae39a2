"""e1 and e2 of tests on the twin beside the thesis."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.thesis.trial import trial
from experiments.thesis.validation import TABLE_3_5
from rigtwin.description.settings import Timing
from rigtwin.recording import load
from rigtwin.simulation.metrics import compute_tracking
from rigtwin.simulation.runner import record
from tests.helpers.tracking import tracking_of


@pytest.mark.slow
def test_table_3_5_within_a_factor_of_two():
    runs = [trial("single-mass", 0)]
    assert runs[0].configuration.timing == Timing(duration=45.0)
    errors = [
        compute_tracking(run.ideal, run.simulation.commands, run.plate, run.force) for run in runs
    ]
    for name in ("position_e1", "position_e2", "force_e1", "force_e2"):
        ratio = float(np.median([getattr(one, name) for one in errors])) / float(TABLE_3_5[name][0])
        assert 0.5 < ratio < 2.0, name


def test_table_6_3_force_limit_cycle_and_missing_wheel_hop():
    run = trial("drop", 0)
    assert compute_tracking(
        run.ideal, run.simulation.commands, run.plate, run.force
    ).force_total == pytest.approx(12.4, rel=0.2)
    assert np.ptp(run.force[run.time > 10]) > 2 * 14
    assert np.std(run.wheel[run.time > 3]) < 5e-6


def test_of_a_recording_as_of_the_run_in_memory(tmp_path):
    run = trial("drop", 3, lambda c: c._replace(timing=c.timing._replace(duration=2.0)))
    demands = np.zeros((run.configuration.ticks, 3))
    record(tmp_path / "drop.mcap", "drop", run.configuration, demands, 3)
    recorded = vars(tracking_of(load(tmp_path / "drop.mcap"), run.configuration))
    assert recorded == pytest.approx(
        vars(compute_tracking(run.ideal, run.simulation.commands, run.plate, run.force)), rel=1e-9
    )
