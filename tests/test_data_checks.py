"""Faults of the data: each recognised and named, and no physical effect taken for one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments import EXPERIMENTS
from rigtwin.components import RigPlant, candidates
from rigtwin.description.catalogue import find
from rigtwin.description.settings import Timing
from rigtwin.diagnosis.data_checks import find_faults
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.unit_checks import Fault
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest, load
from rigtwin.simulation.runner import record
from tests.helpers.effects import once_a_sort, text
from tests.helpers.recordings import BESIDE, SHIPPED, beside, replace_sensors, shipped
from tests.helpers.twin import RIG


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> dict[str, RecordedTest]:
    folder, found = tmp_path_factory.mktemp("checks"), {}
    for name in ("drop", "imposed", "road10", "single-mass", "semi-active"):
        experiment = EXPERIMENTS[name]
        configuration = experiment.configuration._replace(timing=Timing(duration=8.0))
        record(
            folder / f"{name}.mcap", name, configuration, experiment.demands(configuration, 0), 0
        )
        found[name] = load(folder / f"{name}.mcap")
    return found


def check(recording: RecordedTest) -> tuple[Fault, ...]:
    return find_faults(RIG, recording, RIG.configuration_of(recording))


def faults(recording: RecordedTest) -> dict[str, str]:
    """where → kind."""
    return {fault.where: fault.kind for fault in check(recording)}


def test_sound_recordings_have_no_fault(recordings, example):
    for recording in (*recordings.values(), example):
        assert faults(recording) == {}, recording.experiment


@pytest.mark.parametrize("name", SHIPPED)
def test_recordings_of_the_stand_in_rig_have_no_fault(name):
    assert faults(shipped(name)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in BESIDE.glob("*.mcap")))
def test_longer_recordings_of_the_stand_in_rig_have_no_fault(name):
    assert faults(beside(name)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", once_a_sort([e.name for e in candidates(RigPlant())]))
def test_no_effect_is_taken_for_a_fault_of_the_data(tmp_path, name):
    experiment = EXPERIMENTS["imposed"]
    configuration = experiment.configuration._replace(timing=Timing(duration=2.0))
    record(
        tmp_path / "e.mcap",
        "imposed",
        configuration,
        experiment.demands(configuration, 2),
        2,
        effects=[text(name)],
    )
    found = faults(load(tmp_path / "e.mcap"))
    assert set(found.values()) <= {"clipped"}, "saturation looks like clipping, and is"


@pytest.mark.parametrize("name", ["drop", "imposed", "road10", "single-mass"])
@pytest.mark.parametrize("channel", ["structure_lvdt", "suspension_lvdt", "load_cell"])
def test_units_and_signs(recordings, name, channel):
    recording = recordings[name]
    signal = recording.column("/sensor", channel)
    factor = 1e-3 if channel == "load_cell" else 1e3
    assert faults(replace_sensors(recording, **{channel: factor * signal})) == {
        f"/sensor.{channel}": "unit"
    }
    assert faults(replace_sensors(recording, **{channel: -signal})) == {
        f"/sensor.{channel}": "sign"
    }


def test_all_lvdts_in_millimetres_are_named_as_such(recordings):
    recording = recordings["imposed"]
    scaled = {
        name: 1e3 * recording.column("/sensor", name)
        for name in ("ground_lvdt", "structure_lvdt", "suspension_lvdt")
    }
    found = check(replace_sensors(recording, **scaled))
    assert {fault.kind for fault in found} == {"unit"}
    assert all("as if in mm; expected m" in fault.message for fault in found)


@pytest.mark.parametrize("name", ["drop", "imposed", "road10"])
@pytest.mark.parametrize(
    "pair", [("ground_lvdt", "structure_lvdt"), ("ground_lvdt", "suspension_lvdt")]
)
def test_swapped_channels(recordings, name, pair):
    recording = recordings[name]
    one, other = (recording.column("/sensor", channel) for channel in pair)
    found = check(replace_sensors(recording, **{pair[0]: other, pair[1]: one}))
    assert [fault.kind for fault in found] == ["swapped"]
    assert f"{pair[0]} holds {pair[1]}" in found[0].message


def test_dead_stuck_and_clipped(recordings):
    recording = recordings["imposed"]
    force = recording.column("/sensor", "load_cell")
    assert faults(replace_sensors(recording, load_cell=np.full_like(force, 3.0))) == {
        "/sensor.load_cell": "dead"
    }
    stuck = force.copy()
    stuck[3000:3400] = stuck[3000]
    found = check(replace_sensors(recording, load_cell=stuck))
    assert [fault.kind for fault in found] == ["dead"]
    assert "for 0.4 s from 3.000 s" in found[0].message
    limit = np.quantile(force, 0.97)
    assert faults(replace_sensors(recording, load_cell=np.minimum(force, limit))) == {
        "/sensor.load_cell": "clipped"
    }


def test_gap_missing_short_and_other_machines(recordings):
    recording = recordings["imposed"]
    time = recording.time.copy()
    time[4000:] += 0.25
    assert faults(dataclasses.replace(recording, time=time)) == {"recording": "gap"}
    sensors = {
        name: values for name, values in recording.columns["/sensor"].items() if name != "load_cell"
    }
    assert faults(
        dataclasses.replace(recording, columns={**recording.columns, "/sensor": sensors})
    ) == {"/sensor.load_cell": "missing"}
    assert faults(dataclasses.replace(recording, machine="lathe")) == {"recording": "wrong machine"}
    broken = recording.column("/sensor", "structure_lvdt").copy()
    broken[100] = np.inf
    assert faults(replace_sensors(recording, structure_lvdt=broken)) == {
        "/sensor.structure_lvdt": "not a number"
    }


def test_a_recording_of_another_machine_is_called_that_whatever_settings_it_holds(recordings):
    machine, recording = find("emps"), recordings["imposed"]
    assert recording.controller
    found = diagnose(machine, [recording])
    assert found.verdict == "unusable"
    assert "it is of machine 'suspension-rig'; this twin is 'emps'" in found.sentence


def turn(recording: RecordedTest) -> RecordedTest:
    """The recording as if its time had run backwards."""
    columns = {
        topic: {name: values[::-1].copy() for name, values in fields.items()}
        for topic, fields in recording.columns.items()
    }
    return dataclasses.replace(recording, columns=columns)


def replace_commands(recording: RecordedTest, **commands: Array) -> RecordedTest:
    columns = {**recording.columns["/command"], **commands}
    return dataclasses.replace(recording, columns={**recording.columns, "/command": columns})


@pytest.mark.parametrize("channel", ["ground", "structure", "voltage"])
def test_a_dead_command_is_named_and_not_taken_for_a_fault_of_the_machine(example, channel):
    dead = replace_commands(example, **{channel: np.zeros(example.ticks)})
    assert faults(dead) == {f"/command.{channel}": "dead"}
    assert diagnose(RIG, [dead]).verdict == "unusable"


def test_a_recording_in_which_nothing_changes_is_said_to_hold_nothing(example):
    for value in (0.0, 0.1):
        still = np.full(example.ticks, value)
        columns = {topic: dict.fromkeys(names, still) for topic, names in example.columns.items()}
        assert faults(dataclasses.replace(example, columns=columns)) == {"recording": "dead"}


@pytest.mark.parametrize("name", SHIPPED)
def test_time_that_runs_backwards_is_no_fault_of_the_machine(name):
    assert faults(turn(shipped(name))) == {"recording": "backwards"}


@pytest.mark.parametrize("name", ["hum@ground_lvdt", "compliance@ground_cylinder"])
def test_a_plate_that_is_moved_by_its_load_or_by_noise_has_no_dead_command(tmp_path, name):
    experiment = EXPERIMENTS["single-mass"]
    configuration = experiment.configuration._replace(timing=Timing(duration=4.0))
    demands = experiment.demands(configuration, 2)
    path = tmp_path / "e.mcap"
    record(path, "single-mass", configuration, demands, 2, effects=[text(name)])
    assert set(faults(load(path)).values()) <= {"clipped"}
