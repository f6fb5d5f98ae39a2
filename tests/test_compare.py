"""Component replays: noise alone where twin and recording agree, and the guilty component where
they do not."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

import rigtwin
from controllers import Measurements
from experiments import EXPERIMENTS
from rigtwin.components import RigPlant, candidates
from rigtwin.description.catalogue import find
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import apply_effects
from rigtwin.description.settings import Timing
from rigtwin.diagnosis.compare import compare, compare_recordings, differences
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest, load
from rigtwin.rig.component_replays import REPLAYS, ComponentReplays, Undetermined
from rigtwin.rig.simulated import simulate_recording
from rigtwin.simulation.runner import record
from tests.helpers.effects import once_a_component, text
from tests.helpers.recordings import SHIPPED, beside, replace_sensors, shipped
from tests.helpers.settings import from_assignments
from tests.helpers.twin import RIG, rig_effect

LIMITS = {
    "motor": 3.0,
    "carriage": 1.1,
    "mechanics": 1.15,
    "structure_cylinder": 1.1,
    "ground_cylinder": 1.1,
    "controller": 5.0,
}
COMPONENTS = tuple(LIMITS)


def ratios(recording: RecordedTest) -> dict[str, float]:
    return {name: result.ratio for name, result in compare(RIG, recording).replays.items()}


def ratio(replays: ComponentReplays, component: str) -> float:
    """Of one replay to noise; 0 where it cannot be made."""
    try:
        return REPLAYS[component](replays).ratio
    except Undetermined:
        return 0.0


@pytest.fixture(scope="module")
def nominal(example) -> dict[str, float]:
    return ratios(example)


def test_the_shipped_rig_recording_leaves_noise_alone(nominal):
    assert set(nominal) == set(REPLAYS)
    for name, limit in LIMITS.items():
        assert nominal[name] <= limit, name
    assert nominal["closed_loop"] < 1.1


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) for name in ("nominal-road10", "nominal-drop")],
)
def test_nominal_recordings_leave_noise_alone(name):
    found = ratios(beside(name))
    for component, limit in LIMITS.items():
        assert found[component] <= limit, component


TOUCHED = {
    "known-coulomb-motor": {"motor", "mechanics"},
    "known-viscous-rail": {"carriage", "mechanics"},
    "known-gain-load_cell": {"motor", "carriage", "mechanics"},
    "known-delay-structure_cylinder": {"structure_cylinder"},
}


def assert_stands_out(
    name: str, found: dict[str, float], nominal: dict[str, float], elsewhere: float
) -> None:
    """Asserts that the components touched are off, and that no other is by so many times."""
    for component in COMPONENTS:
        times = found[component] / nominal[component]
        if component in TOUCHED[name]:
            assert times > 1.5, component
        elif component != "controller":
            assert times < elsewhere, component


@pytest.mark.parametrize("name", [name for name in TOUCHED if name in SHIPPED])
def test_faults_of_the_stand_in_rig_stand_out_where_they_are(name, nominal):
    assert_stands_out(name, ratios(shipped(name)), nominal, 1.35)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TOUCHED if name not in SHIPPED])
def test_faults_of_the_stand_in_rig_stand_out_alone_in_twenty_seconds(name):
    assert_stands_out(name, ratios(beside(name)), ratios(shipped("nominal-imposed")), 1.15)


OWN_FAULTS = {
    "motor.coulomb=24": {"motor", "mechanics"},
    "rail.coulomb=80": {"carriage", "mechanics"},
    "carriage.mass=40": {"carriage", "mechanics"},
    "tyre.stiffness=42000": {"carriage", "mechanics"},
    "motor.constant=196": {"motor", "mechanics"},
    "ground_cylinder.a1=110000": {"ground_cylinder"},
    "structure_cylinder.a2=9000": {"structure_cylinder"},
}
ALSO_EFFECTS = ("rail", "carriage", "tyre", "motor")
"""Components whose faults are tried as effects too."""


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fault, marks=pytest.mark.slow if fault.startswith(ALSO_EFFECTS) else ())
        for fault in OWN_FAULTS
    ],
)
def test_a_fault_of_the_twin_stands_out_where_it_is(fault):
    experiment = EXPERIMENTS["imposed"]
    faulty = from_assignments(
        experiment.configuration._replace(timing=Timing(duration=10.0)), [fault]
    )
    recording = simulate_recording(RIG.name, "imposed", faulty, experiment.demands(faulty, 11), 11)
    replays = ComponentReplays(recording, RIG.configuration_of(recording))
    found = {component: ratio(replays, component) for component in COMPONENTS}
    for component in ("motor", "carriage", "mechanics", "structure_cylinder", "ground_cylinder"):
        if component in OWN_FAULTS[fault]:
            assert found[component] > 1.5, component
        else:
            # With another tyre the plate starts elsewhere, which its cylinder's replay sees for
            # half a second.
            assert found[component] < (1.35 if component == "structure_cylinder" else 1.2), (
                component
            )
    assert found["controller"] < 1e-3
    # With the fault in the twin too, noise is left.
    known = RIG.configuration_of(recording, from_assignments(Configuration(), [fault]))
    assert all(result.ratio < 1.2 for result in compare(RIG, recording, known).replays.values())


def without(recording: RecordedTest, topic: str, name: str) -> RecordedTest:
    columns = {
        t: {n: v for n, v in fields.items() if (t, n) != (topic, name)}
        for t, fields in recording.columns.items()
    }
    return dataclasses.replace(recording, columns=columns)


@pytest.mark.parametrize("name", Measurements._fields)
def test_a_missing_sensor_is_named(example, name):
    with pytest.raises(RigtwinError, match=f"/sensor.{name} is missing"):
        compare(RIG, without(example, "/sensor", name))


def test_a_value_that_is_no_number_is_named_with_its_time(example):
    broken = example.column("/sensor", "load_cell").copy()
    broken[1234] = np.nan
    with pytest.raises(RigtwinError, match=r"/sensor.load_cell is not a number at 1.234 s"):
        compare(RIG, replace_sensors(example, load_cell=broken))


def test_without_the_operators_settings_the_controller_is_left_out(example):
    silent = dataclasses.replace(example, controller={})
    comparison = compare(RIG, silent)
    assert set(comparison.left_out) == {"controller", "closed_loop"}
    assert comparison.replays["carriage"].ratio < 1.1


def test_settings_unknown_here_are_refused(example):
    with pytest.raises(RigtwinError, match=r"unknown setting controller\.kd"):
        RIG.configuration_of(
            dataclasses.replace(example, controller={**example.controller, "kd": 1.0})
        )


def test_too_short_a_recording_is_refused(example):
    columns = {t: {n: v[:100] for n, v in fields.items()} for t, fields in example.columns.items()}
    with pytest.raises(RigtwinError, match="at least 200"):
        compare(RIG, dataclasses.replace(example, columns=columns, time=example.time[:100]))


def test_two_recordings_of_one_test(example, tmp_path):
    experiment = EXPERIMENTS["imposed"]
    configuration = experiment.configuration._replace(timing=Timing(duration=3.0))
    demands = experiment.demands(configuration, 1)
    recordings = []
    for seed in (1, 2):
        record(tmp_path / f"{seed}.mcap", "imposed", configuration, demands, seed)
        recordings.append(load(tmp_path / f"{seed}.mcap"))
    same = compare_recordings(RIG, *recordings)
    assert all(0.8 < result.ratio < 1.3 for result in same.values())
    different = compare_recordings(RIG, recordings[0], example)
    assert different["load_cell"].ratio > 5
    with pytest.raises(RigtwinError, match="periods differ"):
        compare_recordings(RIG, example, dataclasses.replace(example, period=2e-3))
    with pytest.raises(RigtwinError, match="it is of machine 'emps'; expected 'suspension-rig'"):
        compare_recordings(RIG, example, dataclasses.replace(example, machine="emps"))


LEFT_OVER = {
    "missed_ticks@controller": "which ticks were missed is not known",
    "compliance@structure_cylinder": "the load that bends it is measured; noise shakes the plate",
    "saturation@structure_cylinder": "while the plate stands, the motor's friction is not known",
    "deadband@structure_cylinder": "while the plate stands, the motor's friction is not known",
    "backlash@structure_cylinder": "while the plate stands, the motor's friction is not known",
}
"""Effects that a twin which has them explains only in part, and why."""


@pytest.mark.parametrize(
    "name",
    once_a_component([e.name for e in candidates(RigPlant()) if e.kind.name != "quantisation"]),
)
def test_a_twin_with_the_effect_explains_a_rig_with_it(name):
    """The law behind every diagnosis: record with an effect, replay with the same effect, and noise
    is left."""
    experiment = EXPERIMENTS["imposed"]
    nothing = experiment.configuration._replace(timing=Timing(duration=5.0))
    configuration = apply_effects(nothing, [text(name)])
    demands = experiment.demands(nothing, 5)
    recording = simulate_recording(RIG.name, "imposed", configuration, demands, 5)
    nominal = ComponentReplays(recording, RIG.configuration_of(recording))
    known = ComponentReplays(
        recording, RIG.configuration_of(recording, apply_effects(Configuration(), [text(name)]))
    )
    if name not in LEFT_OVER:
        for component in COMPONENTS:
            left = ratio(known, component)
            assert left < 1.3 or left < 0.25 * ratio(nominal, component), component
    loud = any(ratio(nominal, component) > 1.5 for component in reversed(COMPONENTS))
    assert loud or rig_effect(name).kind.name in ("hum", "noise"), (
        "the nominal twin does not explain it"
    )


def test_a_recording_that_is_all_but_zero_has_no_signal_to_compare(example):
    """Numbers near the smallest that a computer has are no motion, and no ratio says anything."""
    for machine, recording in ((find("emps"), None), (RIG, example)):
        taken = recording or rigtwin.run(machine, "positioning")
        columns = {
            topic: {name: 1e-300 * values for name, values in names.items()}
            for topic, names in taken.columns.items()
        }
        still = dataclasses.replace(taken, columns=columns)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(RigtwinError, match="there is no signal"):
                compare(machine, still)


def test_the_same_data_are_no_two_tests(example):
    assert "both hold the same data" in differences(example, example)[0]
