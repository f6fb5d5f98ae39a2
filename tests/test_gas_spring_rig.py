"""The gas spring as a part of the rig: twin, ideal, quick replay, and the diagnosis' component
replays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments import find
from experiments.thesis.trial import trial
from rigtwin.description.configuration import Configuration
from rigtwin.diagnosis.compare import compare
from rigtwin.models.quarter_car import QuarterCarModel
from rigtwin.recording import load
from rigtwin.simulation.ideal import simulate_ideal
from rigtwin.simulation.runner import record, simulate
from tests.helpers.twin import RIG


def settings_of_the_test() -> Configuration:
    return find("gas-spring").configuration


@pytest.mark.slow
def test_the_ideal_against_solve_ivp():
    configuration = settings_of_the_test()
    spring = configuration.plant.gas_spring

    def slope(_, s):
        travel = s[0] - s[2]
        gas = spring.force * (spring.length / (spring.length + travel)) ** spring.exponent
        force = 100 - 300 * travel - 50 * (s[1] - s[3]) + gas
        return [s[1], force / 25 - 9.81, s[3], (-50_000 * s[2] - force) / 34]

    time = np.arange(5000) * 1e-3
    exact = solve_ivp(slope, (0, 5), [-0.0044, 0, -0.0044, 0], t_eval=time, rtol=1e-9, atol=1e-11).y
    ours = simulate_ideal(configuration, np.zeros(5000))
    assert np.max(np.abs(ours.structure - exact[0])) < 1e-4
    assert np.max(np.abs(ours.wheel - exact[2])) < 1e-5


def test_at_rest_motor_and_gas_carry_the_body():
    run = trial("gas-spring", 0)
    late = run.time > 15
    spring = run.configuration.plant.gas_spring
    gas = (
        spring.force
        * (spring.length / (spring.length + np.mean(run.travel[late]))) ** spring.exponent
    )
    assert np.mean(run.force[late]) + gas == pytest.approx(25 * 9.81, abs=3.0)
    assert gas > 100.0
    # It follows the ideal as the passive test without it does.
    assert np.std(run.plate - run.ideal.structure) < 0.01


def test_the_quick_replay_is_the_twin():
    configuration = settings_of_the_test()
    configuration = configuration._replace(timing=configuration.timing._replace(duration=4.0))
    ran = simulate(configuration, np.zeros((4000, 3)), 2)
    quick = QuarterCarModel(
        ran.commands[:, 0], ran.commands[:, 1], ran.commands[:, 3], configuration, 4
    )
    true = quick.predict_true(configuration.plant)
    assert np.max(np.abs(true[2] - ran.truth[:, 2])) < 2e-5
    assert np.std(true[3] - ran.truth[:, 3]) < 0.5


def test_component_replays_know_it(tmp_path):
    configuration = settings_of_the_test()
    configuration = configuration._replace(timing=configuration.timing._replace(duration=6.0))
    path = tmp_path / "gas.mcap"
    record(path, "gas-spring", configuration, np.zeros((6000, 3)), 1)
    # The operator's settings say that it is there.
    assert RIG.configuration_of(load(path)).plant == configuration.plant
    with_it = compare(RIG, load(path), configuration)
    for name in ("carriage", "mechanics", "motor"):
        assert with_it.replays[name].ratio < 2.0, name
    plant = configuration.plant._replace(
        gas_spring=configuration.plant.gas_spring._replace(force=1.0)
    )
    without = compare(RIG, load(path), configuration._replace(plant=plant))
    assert without.replays["carriage"].ratio > 5.0
