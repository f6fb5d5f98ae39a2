"""The reduced plant against the twin in MuJoCo, under the same commands, with every effect that it
can have."""

from __future__ import annotations

import numpy as np
import pytest

from experiments import EXPERIMENTS
from rigtwin.components import Effect, RigPlant, Scales, Swing, candidates
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Safety
from rigtwin.diagnosis.fit import with_values
from rigtwin.diagnosis.spikes import despike
from rigtwin.diagnosis.swing import swings
from rigtwin.models.quarter_car import Disturbances, QuarterCarModel
from rigtwin.models.quarter_car_step import motor_friction, solve_velocity
from rigtwin.recording import RecordedTest
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.rig_contacts import initial_yield
from rigtwin.simulation.twin import Twin
from tests.helpers.twin import RIG, recorded

SECONDS = 4.0
QUIET = RigPlant()._replace(
    **{
        name: getattr(RigPlant(), name)._replace(white=0.0, hum=0.0, resolution=0.0)
        for name in ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
    }
)
SEARCHED = [effect for effect in candidates(RigPlant()) if effect.searched]


def both(configuration: Configuration, name: str = "imposed") -> tuple[np.ndarray, np.ndarray]:
    """Sensors of the twin and of the reduced plant under the twin's own commands, shape (4, ticks)
    each."""
    timing = configuration.timing._replace(duration=SECONDS)
    free = configuration._replace(safety=Safety(1e3, 1e9, 1e3), timing=timing)
    demands = EXPERIMENTS[name].demands(free, 3)
    blocks = list(run_compiled(Twin(free, float(demands[0, 0]), 0), free, demands))
    commands = np.concatenate([block.commands for block in blocks])
    measured = np.concatenate([block.measurements for block in blocks]).T
    ground, structure, _, voltage = commands.T
    model = QuarterCarModel(ground, structure, voltage, free, 8)
    return measured, model.predict(free.plant)


def apart(configuration: Configuration, name: str = "imposed") -> tuple[float, float]:
    """rms of the difference in m, of the worst motion, and in N, spikes of a tick apart."""
    measured, reduced = both(configuration, name)
    difference = measured - reduced
    despike(difference[3], 6.0)
    rms = np.sqrt(np.mean(difference**2, axis=1))
    return float(max(rms[:3])), float(rms[3])


def reduced_of(recording: RecordedTest) -> QuarterCarModel:
    ground, structure, voltage = (
        recording.column("/command", name) for name in ("ground", "structure", "voltage")
    )
    return QuarterCarModel(ground, structure, voltage, EXPERIMENTS["imposed"].configuration, 4)


@pytest.mark.parametrize("name", ["imposed", "drop", "road10"])
def test_the_nominal_plants_agree_far_below_the_sensors_noise(name):
    configuration = EXPERIMENTS[name].configuration._replace(plant=QUIET)
    motion, force = apart(configuration, name)
    assert motion < 0.1 * 6e-5
    assert force < 0.5 * 1.5


@pytest.fixture(scope="module")
def swing():
    return swings(RIG, (recorded("imposed", seconds=SECONDS),))


def size_of(effect: Effect, swing: dict[str, Swing]) -> tuple[float, ...]:
    # The load at which a cylinder was set to zero is the only start here that depends on a motion.
    scales = Scales(0.03, (-0.03, 0.03), 0.05, 0.2, 1.0, force=230.0, period=1e-3)
    starts = effect.starts(RIG.plant, swing.get(effect.component, Swing()), lambda: scales).values
    return starts[len(starts) // 2]


LOOSE = {"compliance", "backlash", "stribeck", "cogging", "deadband"}
"""Kinds whose events fall a step earlier or later in one of two schemes: a few noise levels."""


@pytest.mark.slow
@pytest.mark.parametrize("effect", SEARCHED, ids=lambda effect: effect.name)
def test_every_effect_does_the_same_to_both(effect, swing):
    values = size_of(effect, swing)
    configuration = EXPERIMENTS["imposed"].configuration._replace(
        plant=with_values(QUIET, (effect,), (values,))
    )
    motion, force = apart(configuration)
    loose = 4.0 if effect.kind.name in LOOSE else 1.0
    assert motion < loose * 0.5 * 6e-5
    assert force < loose * 1.5


@pytest.mark.parametrize("cylinder", ["structure_cylinder", "ground_cylinder"])
def test_a_plate_that_was_set_to_zero_under_load_yields_to_the_rest(cylinder):
    """In both models alike; at rest it stands at compliance·(load − zero load)."""
    stiff = getattr(QUIET, cylinder)._replace(compliance=5e-6, zero_load=150.0)
    configuration = EXPERIMENTS["imposed"].configuration._replace(
        plant=QUIET._replace(**{cylinder: stiff})
    )
    motion, force = apart(configuration)
    assert motion < 4.0 * 0.5 * 6e-5
    assert force < 4.0 * 1.5
    ground, structure = initial_yield(configuration.plant, preload=200.0)
    expected = 5e-6 * (200.0 - 150.0)
    assert (-ground, structure) == (
        pytest.approx((expected, 0.0) if cylinder == "ground_cylinder" else (0.0, expected))
    )


@pytest.mark.parametrize("rhs", [-3.0, -0.5, -0.01, 0.0, 0.01, 0.5, 3.0])
@pytest.mark.parametrize("plate", [-0.7, 0.0, 0.7])
def test_the_inclusion_is_solved_exactly(rhs, plate):
    rail, motor, inertia = (0.3, 0.2), (0.1, 0.4), 1.5
    velocity = solve_velocity(rhs, inertia, rail, motor, plate)
    dry = motor_friction(rhs, inertia, rail, motor, plate, velocity)
    assert -motor[1] <= dry <= motor[0]
    # What is left is the rail's, which must lie within its bounds, and at one of them while it
    # slides.
    left = rhs + dry - inertia * velocity
    assert -rail[1] - 1e-12 <= left <= rail[0] + 1e-12
    if velocity != 0.0:
        assert left == pytest.approx(rail[0] if velocity > 0 else -rail[1])
    if velocity != plate:
        assert dry == (motor[0] if velocity < plate else -motor[1])


def test_a_disturbance_acts_where_it_enters():
    recording = recorded("imposed", seconds=SECONDS)
    plant = RigPlant()
    reduced = reduced_of(recording)
    nothing = np.zeros(recording.ticks)
    shift = np.full(recording.ticks, 1e-3)
    before = reduced.predict_true(plant)
    assert np.array_equal(
        reduced.predict_true(plant, Disturbances(nothing, nothing, nothing, nothing)), before
    )
    moved = reduced.predict_true(plant, Disturbances(nothing, shift, nothing, nothing))
    assert np.allclose(moved[1] - before[1], 1e-3)
    assert np.array_equal(moved[0], before[0])


def test_a_finer_step_changes_little():
    recording = recorded("imposed", seconds=SECONDS)
    reduced = reduced_of(recording)
    change = np.abs(reduced.predict(RigPlant()) - reduced.double_steps().predict(RigPlant()))
    assert np.max(change[:3]) < 6e-5
    assert float(np.median(change[3])) < 0.3
