"""Whole diagnoses: what is named, how surely, what is not, and what other programs read of it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import rigtwin
from experiments import EXPERIMENTS
from rigtwin.cli import main
from rigtwin.components import Motion, RigPlant, find
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import without_effect
from rigtwin.diagnosis.controller import ControllerReplay, Deviation
from rigtwin.diagnosis.cross_validation import reject_worsening
from rigtwin.diagnosis.fit import with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.localisation import region
from rigtwin.diagnosis.next_test import propose_test
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.sampling import find_outstanding
from rigtwin.diagnosis.shrinkage import Blocks, interval, shrinkage
from rigtwin.diagnosis.unknown_input import locate_disturbance
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest
from tests.helpers.recordings import SHIPPED, beginning, beside, replace_sensors, shipped
from tests.helpers.twin import RIG, answer, evidence_of, recorded, rig_effect

SLOW = pytest.mark.slow
"""Of every sort of answer one is always tried."""


def names(outcome: Diagnosis) -> set[str]:
    return {str(effect.name) for effect in outcome.effects}


def explains_nothing(outcome: Diagnosis) -> bool:
    return outcome.verdict == "no gap" and not outcome.effects and not outcome.where


def test_a_rig_without_defects_has_no_gap(example):
    assert explains_nothing(answer(beginning(example, 5.0)))


@SLOW
@pytest.mark.parametrize("name", ["nominal-imposed", "nominal-road10", "nominal-drop"])
def test_a_rig_without_defects_has_no_gap_in_twenty_seconds(name):
    assert explains_nothing(answer(beside(name)))


KNOWN = {
    "known-coulomb-motor": ("coulomb@motor", "coulomb", 24.0, 14.0),
    "known-viscous-rail": ("viscous@rail", "viscous", 450.0, 0.0),
    "known-gain-load_cell": ("gain@load_cell", "gain", 1.05, 1.0),
    "known-delay-structure_cylinder": ("delay@structure_cylinder", "delay", 0.010, 0.0),
}


def assert_named(outcome: Diagnosis, name: str) -> None:
    """Asserts that the answer is this one alone, with its magnitude, and closes the gap as it
    says."""
    effect, parameter, value, nominal = KNOWN[name]
    assert outcome.verdict == "explained"
    assert names(outcome) == {effect}
    found = outcome.effects[0]
    assert found.confidence > 0.9
    assert found.parameters[parameter].value - nominal == pytest.approx(value - nominal, rel=0.05)
    assert found.parameters[parameter].nominal == nominal
    assert outcome.where[0].component == effect.partition("@")[2]
    gap = outcome.gap
    assert gap is not None
    assert gap.after < 1.1 < gap.before
    assert gap.shrinkage_held_out.value == pytest.approx(gap.shrinkage_predicted, abs=0.05)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=SLOW) for name in KNOWN if name in SHIPPED],
)
def test_a_known_effect_is_named_with_its_magnitude(name):
    assert_named(answer(shipped(name)), name)


@SLOW
@pytest.mark.parametrize("name", [name for name in KNOWN if name not in SHIPPED])
def test_a_known_effect_is_named_in_twenty_seconds(name):
    assert_named(answer(beside(name)), name)


@pytest.mark.slow
def test_a_friction_taken_out_of_the_twin_is_found():
    base = without_effect(Configuration(), "coulomb@rail")
    assert base.plant.rail.coulomb == 0.0
    outcome = answer(recorded("imposed", seconds=3.0), base=base)
    assert names(outcome) == {"coulomb@rail"}
    estimate = outcome.effects[0].parameters["coulomb"]
    assert estimate.value == pytest.approx(50.0, rel=0.05)
    assert estimate.nominal == 0.0


def test_what_is_not_there_cannot_be_taken_out():
    with pytest.raises(
        RigtwinError, match=r"the twin has none of it; it has coulomb@rail, coulomb@motor"
    ):
        without_effect(Configuration(), "viscous@rail")
    with pytest.raises(RigtwinError, match="unknown effect"):
        without_effect(Configuration(), "nonsense@rail")


@SLOW
def test_a_model_in_the_loop_is_diagnosed_too():
    outcome = answer(recorded("road10", ("coulomb@rail=80",), 12.0))
    assert names(outcome) == {"coulomb@rail"}


@SLOW
def test_three_seconds_are_enough_for_a_large_effect():
    assert names(answer(recorded("imposed", ("gain@load_cell=1.08",), 3.0))) == {"gain@load_cell"}


@SLOW
def test_the_same_data_give_the_same_answer():
    recording = recorded("imposed", ("gain@load_cell=1.08",), 3.0)
    outcome, again = answer(recording), answer(recording)
    assert replace(again.answer, seconds=0.0) == replace(outcome.answer, seconds=0.0)


@SLOW
def test_several_recordings_are_explained_together():
    effects = ("viscous@rail=150",)
    outcome = answer(recorded("imposed", effects, 6.0), recorded("road10", effects, 6.0, 8))
    assert names(outcome) == {"viscous@rail"}
    assert len(outcome.answer.recordings) == 2


def test_held_out_recordings_judge_the_correction():
    effects = ("coulomb@rail=75",)
    outcome = answer(
        recorded("imposed", effects, 3.0), held_out=(recorded("imposed", effects, 3.0, 9),)
    )
    gap = outcome.gap
    assert gap is not None
    assert gap.held_out == "1 held-out recording"
    assert gap.shrinkage_held_out.value > 0.9
    assert gap.shrinkage_held_out.low <= gap.shrinkage_held_out.value <= gap.shrinkage_held_out.high


@SLOW
def test_a_correction_that_worsens_held_out_data_is_rejected():
    outcome = answer(
        recorded("imposed", ("coulomb@rail=75",)), held_out=(recorded("imposed", (), 8.0, 9),)
    )
    assert not outcome.effects
    assert outcome.verdict == "unknown"
    assert any("rejected" in note for note in outcome.answer.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [
        "coulomb@rail=80",
        pytest.param("gain@motor=1.06", marks=SLOW),
        "delay@structure_cylinder=0.008",
        pytest.param("gain@ground_lvdt=0.95", marks=SLOW),
    ],
)
def test_a_free_disturbance_finds_the_component_without_the_library(effect):
    evidence = evidence_of(recorded("imposed", (effect,)))
    name = effect.partition("=")[0].partition("@")[2]
    assert locate_disturbance(evidence, evidence.plant)[0].component == name


def drifting(recording: RecordedTest, rate: float) -> RecordedTest:
    """Its suspension LVDT's zero moving, m/s."""
    moved = recording["/sensor.suspension_lvdt"] + rate * recording.time
    return replace_sensors(recording, suspension_lvdt=moved)


@pytest.mark.slow
def test_a_free_disturbance_is_judged_beside_the_tolerances_that_the_plant_uses():
    evidence = evidence_of(drifting(recorded("imposed", (), 8.0), 1e-4))
    offset = find("offset@suspension_lvdt", evidence.plant)
    plant = with_values(evidence.plant, (offset,), ((4e-4,),))
    first = locate_disturbance(evidence, plant, (offset,))[0]
    assert first.component == "suspension_lvdt"
    assert first.forms[0] in ("a constant", "time")
    assert first.gained > 0.03 * evidence.expected
    nominal = evidence_of(recorded("imposed", (), 8.0))
    assert locate_disturbance(nominal, nominal.plant)[0].gained < 0.01 * nominal.expected


def deviation_of(recording: RecordedTest) -> Deviation | None:
    assert RIG.control is not None
    settings = RIG.configuration_of(recording).controller
    return ControllerReplay(RIG.control, recording, settings).deviation()


def test_a_setting_that_only_makes_the_commands_small_is_not_named():
    machine = rigtwin.machine("emps")
    short = {"timing": {"duration": 2.5}}
    recording = rigtwin.run(machine, "positioning", settings=short)
    turned = {
        topic: {name: values[::-1] for name, values in columns.items()}
        for topic, columns in recording.columns.items()
    }
    assert machine.control is not None
    settings = machine.configuration_of(recording).controller
    assert ControllerReplay(machine.control, recording, settings).deviation() is None
    backwards = replace(recording, columns=turned)
    deviation = ControllerReplay(machine.control, backwards, settings).deviation()
    assert deviation is not None
    assert deviation.kind == "unknown"


SETTINGS = {"kp": 0.45, "ki": 5.0, "kff": 0.9, "filter_force": 0.013, "preload": 220.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param(*item, marks=() if item[0] in ("kp", "preload") else SLOW)
        for item in SETTINGS.items()
    ],
)
def test_a_setting_that_is_not_as_told_is_named_exactly(name, value):
    recording = recorded("road1.6", (f"setting@controller={name}:{value}",), 3.0)
    told = EXPERIMENTS["road1.6"].configuration.controller
    recording = replace(recording, controller={**recording.controller, name: getattr(told, name)})
    deviation = deviation_of(recording)
    assert deviation is not None
    assert (deviation.kind, deviation.name) == ("setting", name)
    assert deviation.used == pytest.approx(value, rel=1e-3)


@pytest.mark.slow
def test_a_setting_without_consequence_is_a_note_and_no_gap():
    recording = recorded("road1.6", (), 3.0)
    told = EXPERIMENTS["road1.6"].configuration.controller.start - 1e-7
    recording = replace(recording, controller={**recording.controller, "start": told})
    outcome = answer(recording)
    assert explains_nothing(outcome)
    (note,) = (note for note in outcome.answer.notes if "start" in note)
    assert "instead of -0.00" in note
    assert note.endswith("no gap")


def test_missed_ticks_are_counted():
    deviation = deviation_of(recorded("imposed", ("missed_ticks@controller=0.04",)))
    assert deviation is not None
    assert deviation.kind == "missed_ticks"
    assert deviation.used == pytest.approx(0.04, rel=0.2)


def test_a_controller_as_told_has_no_deviation():
    assert deviation_of(recorded("imposed")) is None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("noise@load_cell=9", 9.0),
        ("hum@structure_lvdt=0.0015", 0.0015),
        ("quantisation@suspension_lvdt=0.0006", 0.0006),
    ],
)
def test_what_a_sensor_shows_by_itself_is_read_off(text, value):
    evidence = evidence_of(recorded("imposed", (text,)))
    predicted = evidence.predict(RIG.plant)
    (found,) = find_outstanding(RIG, evidence.recordings, predicted, RIG.plant)
    assert f"{found.kind}@{found.component}" == text.partition("=")[0]
    assert found.value == pytest.approx(value, rel=0.1)


def test_a_coarse_bit_is_not_taken_for_hum():
    """It makes more of a line that lies within it, or less, by where the signal stands."""
    recording = rigtwin.run(
        "suspension-rig",
        "road10",
        effects={"quantisation@load_cell": 24.3},
        settings={"timing": {"duration": 8.0}},
    )
    evidence = evidence_of(recording)
    predicted = evidence.predict(RIG.plant)
    (found,) = find_outstanding(RIG, evidence.recordings, predicted, RIG.plant)
    assert f"{found.kind}@{found.component}" == "quantisation@load_cell"


@SLOW
def test_noise_that_all_sensors_share_is_the_laboratorys():
    louder = [
        f"noise@{name}={3 * getattr(RigPlant(), name).white}"
        for name in RigPlant()._fields
        if hasattr(getattr(RigPlant(), name), "white")
    ]
    outcome = answer(recorded("imposed", tuple(louder)))
    assert outcome.verdict == "no gap"


def test_shrinkage_is_of_the_gap_above_the_floor():
    assert shrinkage(5.0, 1.0) == 1.0
    assert shrinkage(5.0, 2.0) == 0.5
    assert shrinkage(2.0, 5.0) == -1.0
    assert shrinkage(0.9, 0.8) == 0.0


def test_the_interval_covers_the_value_and_narrows_with_more_blocks():
    random = np.random.default_rng(1)
    few = Blocks(3.0 + random.random(10), 1.2 + 0.1 * random.random(10))
    many = Blocks(3.0 + random.random(400), 1.2 + 0.1 * random.random(400))
    for blocks in (few, many):
        found = interval(blocks)
        assert found.low <= found.value <= found.high
    assert interval(many).high - interval(many).low < interval(few).high - interval(few).low


def test_the_gate_keeps_what_helps_and_drops_what_harms():
    good, bad = rig_effect("coulomb@rail"), rig_effect("viscous@rail")

    def across(kept):
        left = 5.0 - 3.0 * (good in kept) + 1.0 * (bad in kept)
        return Blocks(np.full(4, 5.0), np.full(4, left))

    assert reject_worsening((good, bad), across) == ((good,), (bad,))


def test_regions_are_told_apart():
    time = np.arange(8000) * 1e-3
    speed = np.sin(2 * np.pi * time)
    force = np.cos(2 * np.pi * 0.7 * time)
    quiet = 1e-3 * np.ones_like(time)
    assert (
        region(quiet + (np.abs(speed) < 0.1), Motion(speed, speed, force), 1e-3)
        == "velocity reversal"
    )
    assert region(quiet + speed**9, Motion(speed, speed, force), 1e-3) == "high speed"
    assert region(quiet, Motion(speed, speed, force), 1e-3) == "throughout"
    assert region(time**2, Motion(speed, speed, force), 1e-3) == "growing with time"
    assert (
        region(quiet + ((time > 3.0) & (time < 4.0)), Motion(speed, speed, force), 1e-3)
        == "3.0 to 4.0 s"
    )


@pytest.mark.parametrize(
    ("unit", "said"), [("m", "within 33 mm after"), ("rad", "within 1.9° after")]
)
def test_a_way_after_a_reversal_is_in_the_unit_of_the_joint(unit, said):
    time = np.arange(8000) * 1e-3
    way = 1.0 - np.cos(2 * np.pi * 0.5 * time)
    since = np.where(np.sin(2 * np.pi * 0.5 * time) > 0.0, way, 2.0 - way)
    near = (since < 0.05).astype(float)
    motion = Motion(way, np.gradient(way, 1e-3), np.ones_like(time))
    assert region(near * (1.0 + since), motion, 1e-3, unit).startswith(said)


@SLOW
def test_the_fast_multisine_tells_a_delay_from_a_lag():
    evidence = evidence_of(recorded("imposed", ("delay@motor=0.0012",), 4.0))
    fitter = Fitter(evidence)
    fits = [
        fitter.fit_one(fitter.screen(rig_effect(name))) for name in ("delay@motor", "lag@motor")
    ]
    tests = [EXPERIMENTS["imposed-fast"], EXPERIMENTS["drop"]]
    found = propose_test(RIG, fits, tests)
    assert found is not None
    assert found.experiment == "imposed-fast"
    assert found.command.startswith("rigtwin run imposed-fast")


def spoilt(change: str) -> RecordedTest:
    recording = recorded("imposed")
    sensors = dict(recording.columns["/sensor"])
    machine, time = recording.machine, recording.time
    match change:
        case "missing":
            del sensors["load_cell"]
        case "swapped":
            sensors["ground_lvdt"], sensors["structure_lvdt"] = (
                sensors["structure_lvdt"],
                sensors["ground_lvdt"],
            )
        case "unit":
            sensors["suspension_lvdt"] = 1e3 * sensors["suspension_lvdt"]
        case "dead":
            sensors["ground_lvdt"] = np.full(recording.ticks, 0.001)
        case "gap":
            time = time + 0.5 * (time > 4.0)
        case "machine":
            machine = "another"
    return replace(
        recording, machine=machine, time=time, columns={**recording.columns, "/sensor": sensors}
    )


FAULTS = {
    "missing": "load_cell is missing",
    "swapped": "swapped",
    "unit": "as if in mm",
    "dead": "dead",
    "gap": "gaps in time",
    "machine": "machine",
}


@pytest.mark.parametrize("change", FAULTS)
def test_data_that_are_not_fit_are_named_and_not_diagnosed(change):
    outcome = answer(spoilt(change))
    assert outcome.verdict == "unusable"
    assert not outcome.effects
    assert FAULTS[change] in outcome.answer.faults[0]


@SLOW
def test_a_sensor_cut_off_is_named_and_its_ticks_left_out():
    recording = recorded("imposed", ("coulomb@rail=75",))
    cell = recording.column("/sensor", "load_cell")
    clipped = np.minimum(cell, float(np.quantile(cell, 0.97)))
    columns = {
        **recording.columns,
        "/sensor": {**recording.columns["/sensor"], "load_cell": clipped},
    }
    outcome = answer(replace(recording, columns=columns))
    assert names(outcome) == {"coulomb@rail"}
    assert any("cut off" in note for note in outcome.answer.notes)


def test_the_command_writes_what_it_says(tmp_path, capsys):
    rig = tmp_path / "rig.mcap"
    assert (
        main(
            [
                "run",
                "imposed",
                "--set",
                "timing.duration=3",
                "--effect",
                "viscous@rail=200",
                "--out",
                str(rig),
            ]
        )
        == 0
    )
    report, answer, twin = tmp_path / "r.html", tmp_path / "a.json", tmp_path / "t.toml"
    assert (
        main(
            [
                "diagnose",
                str(rig),
                "--html",
                str(report),
                "--json",
                str(answer),
                "--save-twin",
                str(twin),
            ]
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "viscous@rail" in said
    assert json.loads(answer.read_text())["effects"][0]["kind"] == "viscous"
    assert main(["compare", str(rig), "--config", str(twin)]) == 0
    assert (
        main(
            [
                "run",
                "drop",
                "--config",
                str(twin),
                "--set",
                "timing.duration=1",
                "--out",
                str(tmp_path / "d.mcap"),
            ]
        )
        == 0
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{rig}", "{rig}"], "named twice"),
        (["{rig}", "--held-out", "{rig}"], "named twice"),
        (["{rig}", "--json", "{rig}"], "is the input"),
        (["{rig}", "--html", "{folder}/none/r.html"], "folder does not exist"),
        (["{rig}", "--set", "controller.kp=1"], "recording's own"),
        (["{rig}", "--without", "viscous@rail"], "cannot take out viscous@rail"),
        (["{folder}/none.mcap"], "none.mcap"),
    ],
)
def test_wrong_use_is_one_clear_line(arguments, message, tmp_path, capsys):
    rig = tmp_path / "rig.mcap"
    main(["run", "imposed", "--set", "timing.duration=1", "--out", str(rig)])
    filled = [a.format(rig=rig, folder=tmp_path) for a in arguments]
    capsys.readouterr()
    assert main(["diagnose", *filled]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1
