"""The rig as one linear sampled loop, against the twin itself without friction and noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from experiments import EXPERIMENTS
from experiments import find as experiment
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.simulation.runner import simulate, without_limits
from rigtwin.studies.stability.sampled_loop import closed_loop, decay, mechanics

SENSORS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
FREE = {name: {"white": 0.0, "hum": 0.0, "resolution": 0.0} for name in SENSORS} | {
    "rail": {"coulomb": 0.0},
    "motor": {"coulomb": 0.0},
    "structure_cylinder": {"speed_limit": 10.0},
    "timing": {"duration": 16.0},
    # Almost its weight, so that it swings by less than a millimetre and nothing reaches a limit.
    "controller": {"preload": 245.2, "start": -245.2 / 50_000.0},
}
CASES = {
    "nominal": {},
    "late cylinder": {"structure_cylinder": {"delay": 0.0023, "lag": 0.001}},
    "slow sensor and motor": {
        "load_cell": {"delay": 0.0045, "lag": 0.004},
        "motor": {"delay": 0.0013, "lag": 0.002},
    },
    "late computer": {
        "computer": {"delay": 0.003},
        "suspension_lvdt": {"delay": 0.0037, "gain": 1.05, "lag": 0.002},
    },
    "viscous": {
        "motor": {"viscous": 20.0},
        "tyre": {"damping": 200.0, "hardening": 20.0},
        "rail": {"viscous": 30.0},
    },
    "skyhook": {"controller": {"skyhook": "active", "skyhook_damping": 100.0}},
    "stiff force loop": {"controller": {"kp": 1.0, "ki": 100.0}},
    "eager cylinder": {"structure_cylinder": {"gain": 1.1}},
}


def free(changes: dict[str, dict[str, object]]) -> Configuration:
    return override(override(Configuration(), FREE), changes)


def measured(configuration: Configuration) -> float:
    """Decay of the body's acceleration between the second and the last quarter of a run, 1/s."""
    ran = simulate(without_limits(configuration), np.zeros((configuration.ticks, 3)), 0)
    period = configuration.timing.period
    acceleration = np.gradient(np.gradient(ran.commands[:, 1], period), period)
    quarter = len(acceleration) // 4
    early, late = (
        np.sqrt(np.mean(acceleration[at * quarter : (at + 1) * quarter] ** 2)) for at in (1, 3)
    )
    return math.log(early / late) / (2 * quarter * period)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("late computer", "skyhook") else pytest.mark.slow)
        for name in CASES
    ],
)
def test_it_decays_as_the_twin_does(name):
    configuration = free(CASES[name])
    assert decay(configuration) == pytest.approx(measured(configuration), rel=0.04, abs=0.008)


def test_the_nominal_loop_is_slightly_unstable():
    """A continuous calculation of the same loop, its hold left out: +0.236 ± 7.22j."""
    poles = np.log(np.linalg.eigvals(closed_loop(Configuration())).astype(complex) + 1e-300) / 1e-3
    worst = max((pole for pole in poles if pole.imag > 1.0), key=lambda pole: pole.real)
    assert worst == pytest.approx(0.236 + 7.22j, abs=0.02)
    assert decay(Configuration()) == pytest.approx(-worst.real, rel=1e-6)


def test_what_is_not_in_the_loop_does_not_count():
    """In an imposed test nothing comes back from the wheel, which swings for ever on its tyre."""
    imposed = experiment("imposed").configuration
    assert decay(imposed) > 1.0
    assert decay(override(imposed, {"tyre": {"stiffness": 10_000.0}})) == pytest.approx(
        decay(imposed), rel=1e-9
    )


@pytest.mark.slow
def test_where_it_says_that_the_loop_begins_to_swing_the_twin_does():
    """The skyhook damping at which it neither grows nor decays."""

    def with_gain(gain: float) -> Configuration:
        return free({"controller": {"skyhook": "active", "skyhook_damping": gain}})

    critical = float(brentq(lambda gain: decay(with_gain(gain)), 1.0, 200.0))  # type: ignore[arg-type]
    assert measured(with_gain(0.8 * critical)) < 0.0 < measured(with_gain(1.2 * critical))


def test_delay_costs_margin():
    decays = [
        decay(free({"computer": {"delay": delay}})) for delay in (0.0, 0.0005, 0.001, 0.004, 0.0095)
    ]
    assert decays == sorted(decays, reverse=True)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_has_a_margin(name):
    assert math.isfinite(decay(EXPERIMENTS[name].configuration))


def test_the_mechanics_are_those_of_a_wheel_on_its_tyre():
    a, _, _ = mechanics(Configuration().plant, 200.0)
    poles = np.linalg.eigvals(a)
    assert min(abs(poles - 1j * math.sqrt(50_000.0 / 34.0))) < 1e-3
