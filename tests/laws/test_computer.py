"""The computer that runs the controller: ticks that it misses."""

from __future__ import annotations

import numpy as np
import pytest

from experiments import EXPERIMENTS
from rigtwin.components import Computer, Mains, RigPlant
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from tests.laws.joints import INTERPRETED
from tests.laws.written import law_of


@law_of("missed_ticks", Computer)
@pytest.mark.skipif(INTERPRETED, reason="the running rig calls MuJoCo from compiled code")
@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_at_a_missed_tick_all_outputs_stay_as_they_are(share):
    from rigtwin.simulation.compiled_loop import run_compiled
    from rigtwin.simulation.twin import Twin

    plant = RigPlant(computer=Computer(missed_ticks=share))
    configuration = Configuration(plant=plant, timing=Timing(duration=2.0))
    demands = EXPERIMENTS["imposed"].demands(configuration, 0)
    twin = Twin(configuration, float(demands[0, 0]), 1)
    blocks = run_compiled(twin, configuration, demands)
    commands = np.concatenate([block.commands for block in blocks])
    stayed = np.all(np.diff(commands, axis=0) == 0.0, axis=1)
    # The standard deviation of the share is √(p (1 − p)/n).
    spread = np.sqrt(share * (1.0 - share) / len(stayed))
    assert np.mean(stayed) == pytest.approx(share, abs=4.0 * spread)


def test_the_nominal_computer_is_in_time_and_the_mains_have_50_hertz():
    assert Computer() == Computer(missed_ticks=0.0, delay=0.0)
    assert Mains().frequency == 50.0
