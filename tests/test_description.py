"""Descriptions: what they give, every mistake in one line, and a new machine without any Python."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from rigtwin.cli import main
from rigtwin.components import RigPlant, Scales, Swing, with_parameters
from rigtwin.components import find as effect_of
from rigtwin.components.scales import SHARES
from rigtwin.description.catalogue import find, shipped
from rigtwin.description.changes import override
from rigtwin.description.document import examine, load
from rigtwin.description.effects import without_effect
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.fit import is_possible
from rigtwin.errors import RigtwinError
from rigtwin.models.joint import JointModel
from rigtwin.simulation.experiment import find_experiment
from tests.helpers.described import MJCF, TOML, described, recording_of
from tests.helpers.settings import from_assignments


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_machine_has_no_mistakes(name):
    machine, mistakes = examine(shipped()[name])
    assert mistakes == []
    assert machine is not None
    assert machine.name == name
    assert machine.rows
    assert all(row.unit for row in machine.rows)


def test_the_suspension_rig_is_described_like_any_other():
    machine = find("suspension-rig")
    assert machine.plant == RigPlant()
    assert [row.name for row in machine.rows] == [
        "ground_lvdt",
        "structure_lvdt",
        "suspension_lvdt",
        "load_cell",
    ]
    assert len(machine.tolerances) == 20
    tolerance = machine.tolerance_of("motor", "gain")
    assert tolerance is not None
    assert (tolerance.parameter, tolerance.half_width) == ("constant", 0.005)


def test_nominal_values_come_from_the_mjcf_and_then_the_description(tmp_path: Path):
    machine = described(tmp_path)
    assert machine.plant.mass.mass == 2.0
    assert (machine.plant.guide.stiffness, machine.plant.guide.viscous) == (150.0, 6.0)
    text = TOML.replace(
        'joint = "axis"', 'joint = "axis"\nviscous = { value = 9.0, tolerance = "5 %" }'
    )
    machine = described(tmp_path, toml=text)
    assert machine.plant.guide.viscous == 9.0
    tolerance = machine.tolerance_of("guide", "viscous")
    assert tolerance is not None
    assert tolerance.width(machine.plant) == pytest.approx(0.45)


def test_units_follow_the_joint(tmp_path: Path):
    slides, turns = described(tmp_path), described(tmp_path, "pendulum")
    meaning = effect_of("viscous@guide", slides.plant).quantities()["viscous"]
    assert slides.unit("guide", meaning) == "Ns/m"
    assert turns.unit("guide", meaning) == "Nms/rad"
    assert turns.rows[0].unit == "rad"


def test_a_pendulum_has_its_inertia_and_gravity(tmp_path: Path):
    machine = described(tmp_path, "pendulum")
    joint = machine.replays[0].joint
    # A capsule of 1.5 kg hangs at 0.2 m; its inertia about the end is that of a rod and a little
    # more.
    assert joint.inertia == pytest.approx(1.5 * 0.4**2 / 3, rel=0.06)
    load = np.interp(0.5, joint.positions, joint.gravity)
    # What is lost between the places at which it is worked out acts as a spring on a free swing.
    assert load == pytest.approx(1.5 * 9.81 * 0.2 * np.sin(0.5), rel=1e-5)


def test_a_rotor_behind_a_gear_has_inertia_and_no_weight(tmp_path: Path):
    bare = described(tmp_path, "pendulum")
    geared = (tmp_path / "bench.xml").read_text().replace("<joint ", '<joint armature="0.03" ')
    (tmp_path / "bench.xml").write_text(geared)
    machine = load(tmp_path / "bench.toml")
    assert machine.plant.mass == bare.plant.mass
    joint, own = machine.replays[0].joint, bare.replays[0].joint
    assert joint.inertia == pytest.approx(own.inertia + 0.03)
    assert joint.gravity == pytest.approx(own.gravity)
    # Let go at a small angle it swings at sqrt(gravity / whole inertia).
    time = np.arange(4000) * 1e-3
    still = recording_of(machine, np.zeros_like(time), 0.05 * np.cos(time))
    plant = with_parameters(machine.plant, "guide", {"viscous": 0.0})
    model = JointModel(
        machine, machine.replays[0], still.inputs, machine.configuration_of(still), steps=4
    )
    swing = model.predict_true(plant)[0]
    crossings = time[1:][np.diff(np.sign(swing)) != 0]
    expected = np.pi * np.sqrt(joint.inertia / (1.5 * 9.81 * 0.2))
    assert np.mean(np.diff(crossings)) == pytest.approx(expected, rel=0.01)


READ_OFF = {"hum", "noise", "quantisation"}
"""Kinds at a sensor that are not searched for but read off its signal."""


@pytest.mark.parametrize("name", [name for name in shipped() if name != "suspension-rig"])
def test_every_effect_of_a_machine_can_be_searched_for(name):
    machine = find(name)
    scale = Scales(0.03, (-0.03, 0.03), 0.1, 0.25, 0.8, 60.0, 1e-3)
    swing = Swing((1.0,) * len(SHARES), (1.0,) * len(SHARES))
    for effect in machine.effects():
        if effect.kind.name in READ_OFF:
            assert not effect.searched
            continue
        assert effect.searched, effect.name
        found = effect.starts(machine.plant, swing, lambda: scale)
        quantities = list(effect.quantities().values())
        assert len(found.steps) == len(quantities)
        steps = dict(zip(effect.kind.parameters, found.steps, strict=True))
        constants = effect.kind.constants
        assert all(step > 0.0 for name, step in steps.items() if name not in constants)
        for start in found.values:
            for quantity, value in zip(quantities, start, strict=True):
                assert quantity.low <= value <= quantity.high, effect.name


def test_what_acts_through_friction_needs_some():
    machine = find("damper-bench")
    play, dry = (effect_of(name, machine.plant) for name in ("backlash@damper", "coulomb@damper"))
    assert not is_possible((play,), machine.plant)
    assert is_possible((play, dry), machine.plant)


MISTAKES = [
    ('name = "bench"', "", "name is missing"),
    ('name = "bench"', 'name = "b e n"', "expected letters"),
    ('model = "bench.xml"', 'model = "other.xml"', "does not exist"),
    ('model = "bench.xml"', "model = 3", "expected the name of an MJCF file"),
    ('model = "bench.xml"', 'model = "bench.toml"', "model"),
    ("[machine]", "[machin]", "unknown table [machin]; did you mean 'machine'?"),
    ('body = "arm"', 'body = "leg"', "the MJCF has no body 'leg'"),
    ('joint = "axis"', 'joint = "axes"', "did you mean 'axis'?"),
    ('joint = "axis"', 'jiont = "axis"', "expected one of body, joint"),
    ('joint = "axis"', 'joint = "axis"\nviscuos = 3.0', "did you mean 'viscous'?"),
    ('joint = "axis"', 'joint = "axis"\nviscous = "3"', "expected a number"),
    ('joint = "axis"', 'joint = "axis"\nviscous = -3', "expected a number from 0"),
    ('joint = "axis"', 'joint = "axis"\nviscous = nan', "expected a number"),
    (
        'joint = "axis"',
        'joint = "axis"\nviscous = { value = 3.0, tolerance = "much" }',
        "expected a number in Ns/m or a percentage",
    ),
    ('joint = "axis"', 'joint = "axis"\nviscous = { valeu = 3.0 }', "did you mean 'value'?"),
    ('joint = "axis"', 'joint = "axis"\ntype = "gide"', "did you mean 'guide'?"),
    ('joint = "axis"', 'joint = "axis"\neffects = ["coulom"]', "did you mean 'coulomb'?"),
    ('joint = "axis"', 'joint = "axis"\neffects = "coulomb"', "expected a list"),
    ('joint = "axis"', 'joint = "axis"\ncommand = "x"', "command is for actuators"),
    ('sensor = "encoder"', 'sensor = "encoder"\nunit = "mm"', "recordings are in SI"),
    ("[components.mass]", "[components.computer]", "cannot be a component's name"),
    ('moved_by = "drive"', 'moved_by = "dive"', "did you mean 'drive'?"),
    ('moved_by = "drive"', "", "moved_by is missing"),
    ('moved_by = "drive"', 'moved_by = ["drive", "encoder"]', "encoder moves the joint"),
    ('observe = ["encoder"]', 'observe = ["encodr"]', "did you mean 'encoder'?"),
    ('observe = ["encoder"]', "", "observe is missing"),
    ("[[replays]]", "[[replay]]", "did you mean 'replays'?"),
    ('[components.mass]\nbody = "arm"', "", "whose mass is no component"),
    (
        'sensor = "encoder"',
        'sensor = "encoder"\ntype = "force actuator"',
        "type 'force actuator' goes with actuator or joint, not with sensor 'encoder'; expected",
    ),
    (
        'sensor = "encoder"',
        'sensor = "encoder"\ntype = "velocity sensor"',
        "sensor 'encoder' of the MJCF measures a position; expected 'position sensor'",
    ),
    ('joint = "axis"', 'joint = "axis"\ntype = "servo"', "goes with actuator, not with joint"),
    ('body = "arm"', 'body = "arm"\ntype = "guide"', "goes with joint or tendon, not with body"),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "kp *"\n[[replays]]',
        "is not a formula",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "farce"\nformula = "1"\n[[replays]]',
        "did you mean 'force'?",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "1"\nsettings = { kp = 2 }\n[[replays]]',
        "kp not in the formula",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "kp"\nsettings = { kp = nan }\n[[replays]]',
        "settings.kp: nan: expected a number",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "position"\ninputs = 5\n[[replays]]',
        "[controller] inputs: expected a table",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "1e999 * position"\n[[replays]]',
        "a number in the formula is too large",
    ),
    (
        "[[replays]]",
        '[controller]\noutput = "force"\nformula = "0.5 * 2"\n[[replays]]',
        "reads nothing",
    ),
    (
        "[[replays]]",
        f'[controller]\noutput = "force"\nformula = "{"-" * 1500}position"\n[[replays]]',
        "is nested too deeply",
    ),
    ('joint = "axis"', f'joint = "axis"\nviscous = 1{"0" * 400}', "expected 64 at most"),
    ('joint = "axis"', f'joint = "axis"\nviscous = 0x1{"0" * 9000}', "an integer of 36001 bits"),
    ("[machine]", "[machine", "not valid TOML"),
]


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES)
def test_a_mistake_is_one_line(tmp_path: Path, capsys, old: str, new: str, said: str):
    (tmp_path / "bench.xml").write_text(
        MJCF.format(body='<joint name="axis" type="slide"/><geom size="0.05" mass="2"/>')
    )
    path = tmp_path / "bench.toml"
    assert old in TOML
    path.write_text(TOML.replace(old, new, 1))
    machine, mistakes = examine(path)
    assert machine is None
    assert any(said in mistake for mistake in mistakes), mistakes
    assert all("\n" not in mistake for mistake in mistakes)
    assert main(["machine", "check", str(path)]) == 1
    assert said in capsys.readouterr().out


SLIDE = '<joint name="axis" type="slide"/>'
MODEL_MISTAKES = [
    (SLIDE, '<joint name="axis" type="slide" damping="-6"/>', "damping of joint 'axis' is -6"),
    (SLIDE, '<joint name="axis" type="slide" damping="1e300"/>', "viscous of joint 'axis' in the"),
    (SLIDE, '<joint name="axis" type="slide" stiffness="nan"/>', "line 2: stiffness of <joint>"),
    (SLIDE, '<joint name="axis" type="slide" frictionloss="nan"/>', "frictionloss of <joint>"),
    (SLIDE, '<joint name="axis" type="slide" armature="inf"/>', "expected a finite number"),
    (SLIDE, '<joint name="axis" type="slide" axis="nan 0 0"/>', "axis of <joint> is 'nan 0 0'"),
    ('mass="2"', 'mass="NaN"', "mass of <geom> is 'NaN'"),
    ('integrator="RK4"', 'gravity="0 0 nan"', "gravity of <option>"),
    ('integrator="RK4"', 'gravity="0 0 inf"', "option gravity is inf"),
    ('joint="axis"/>', 'joint="axis" gear="0"/>', "gear times gain 0"),
    ("<worldbody>", '<size memory="900P"/><worldbody>', "<size memory='900P'>: expected at most"),
    ("<worldbody>", '<size nkey="100000000"/><worldbody>', "nkey='100000000'"),
    (
        "<worldbody>",
        '<worldbody><replicate count="1000"><replicate count="1000"><geom size="1"/>'
        "</replicate></replicate>",
        "<replicate> makes 1e+06 elements; expected at most 10000",
    ),
    (
        "<worldbody>",
        '<worldbody><flexcomp name="f" type="grid" count="1000 1000 9" radius=".1" mass="1"/>',
        "<flexcomp> makes 9e+06 elements",
    ),
]


@pytest.mark.parametrize(("old", "new", "said"), MODEL_MISTAKES)
def test_a_value_of_the_mjcf_is_checked_like_one_of_the_description(
    tmp_path: Path, capfd, old: str, new: str, said: str
):
    model = MJCF.format(body=f'{SLIDE}<geom size="0.05" mass="2"/>')
    assert old in model
    (tmp_path / "bench.xml").write_text(model.replace(old, new, 1))
    (tmp_path / "bench.toml").write_text(TOML)
    assert main(["machine", "check", str(tmp_path / "bench.toml")]) == 1
    out, err = capfd.readouterr()
    assert said in out
    assert len(out.splitlines()) == 2, "the mistake and how many there are"
    assert err == ""


@pytest.mark.parametrize("declaration", ["", '<?xml version="1.0" encoding="ISO-8859-1"?>'])
def test_a_name_in_latin_1_is_one_clear_line(tmp_path: Path, declaration: str):
    model = declaration + MJCF.format(body='<joint name="axis"/><geom name="größe" size="0.05"/>')
    (tmp_path / "bench.xml").write_bytes(model.encode("latin-1"))
    (tmp_path / "bench.toml").write_text(TOML)
    _, mistakes = examine(tmp_path / "bench.toml")
    assert len(mistakes) == 1
    assert "bench.xml, line 2: byte 0xf6 is not UTF-8" in mistakes[0]


def test_a_demand_that_is_not_finite_is_said(tmp_path: Path):
    demand = '[experiments.x]\nduration = 1.0\n[experiments.x.demands]\nforce = "1e200 * 1e200"\n'
    machine = described(tmp_path, toml=TOML + demand)
    found = find_experiment(machine, "x")
    with pytest.raises(RigtwinError, match=r"demand force: .* is not finite at 0.000 s"):
        found.demands(found.configuration, 0)


def test_a_missing_description_is_said(tmp_path: Path, capsys):
    assert main(["machine", "check", str(tmp_path / "none.toml")]) == 1
    assert "No such file" in capsys.readouterr().out
    with pytest.raises(Exception, match=re.escape("unknown machine 'nonsense'")):
        find("nonsense")


def test_settings_are_checked():
    base = find("emps").configuration
    changed = from_assignments(base, ["guide.viscous=210", "controller.kp=150"])
    assert (changed.plant.guide.viscous, changed.controller.kp) == (210.0, 150.0)
    assert without_effect(base, "viscous@guide").plant.guide.viscous == 0.0
    for changes, said in (
        ({"gide": {}}, "unknown group"),
        ({"guide": {"viscuos": 1}}, "unknown setting guide.viscuos; guide has coulomb"),
        ({"guide": {"viscous": -1}}, "expected a number from 0"),
        ({"controller": {"ki": 1}}, "unknown setting"),
        ({"guide": 3}, "expected a table"),
    ):
        with pytest.raises(Exception, match=said):
            override(base, changes)  # type: ignore[arg-type]


def truth(command: np.ndarray, viscous: float, slip: float) -> np.ndarray:
    """Position of 2 kg on a spring of 150 N/m with a friction that sets in over 0.2 mm/s, by Heun's
    rule in steps of 25 us."""
    fine, step = 40, 2.5e-5

    def acceleration(force: float, x: float, v: float) -> float:
        return (force - 150.0 * x - viscous * v - slip * min(max(v / 2e-4, -1.0), 1.0)) / 2.0

    x = v = 0.0
    out = np.empty(len(command))
    for tick, force in enumerate(command.tolist()):
        out[tick] = x
        for _ in range(fine):
            here = acceleration(force, x, v)
            there = acceleration(force, x + step * v, v + step * here)
            x, v = x + step * (v + 0.5 * step * here), v + 0.5 * step * (here + there)
    return out


@pytest.mark.parametrize(
    ("viscous", "slip", "kind"),
    [
        pytest.param(6.0, 0.0, None, marks=pytest.mark.slow),
        pytest.param(14.0, 0.0, "viscous", marks=pytest.mark.slow),
        (6.0, 2.0, "coulomb"),
    ],
)
def test_a_new_machine_takes_no_python(
    tmp_path: Path, viscous: float, slip: float, kind: str | None
):
    """A description and an MJCF in a folder, data of an independent integration, and the right
    answer."""
    machine = described(tmp_path)
    random = np.random.default_rng(3)
    time = np.arange(5000) * 1e-3
    command = sum(
        8.0 * np.sin(2 * np.pi * f * time + random.uniform(0, 6))
        for f in (0.23, 0.61, 1.13, 1.9, 3.1)
    )
    position = truth(np.asarray(command), viscous, slip) + 1e-5 * random.standard_normal(5000)
    found = diagnose(machine, [recording_of(machine, np.asarray(command), position)])
    if kind is None:
        assert found.verdict == "no gap"
        return
    assert [str(effect.name) for effect in found.effects] == [f"{kind}@guide"]
    value = found.effects[0].parameters[kind].value
    assert value == pytest.approx(viscous if kind == "viscous" else slip, rel=0.03)


def test_load_says_how_many_mistakes_there_are(tmp_path: Path):
    path = tmp_path / "bench.toml"
    path.write_text("[machine]\n")
    with pytest.raises(Exception, match=r"name is missing \(and \d more"):
        load(path)
