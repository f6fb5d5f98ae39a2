"""Joints that act on each other, some of them free: against equations written by hand, MuJoCo's
own integrators and closed forms."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigtwin
from rigtwin.components import Guide
from rigtwin.description.document import examine, load
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.stops import find_cut_commands
from rigtwin.errors import RigtwinError
from rigtwin.models.forward_dynamics import ForwardDynamicsModel
from tests.helpers.coupled import ARM, ARM_TOML, PERIOD, arm, described, integrate, recording

TIME = np.arange(1000) * PERIOD
TORQUES = np.stack([3.0 * np.sin(4.0 * TIME), 1.2 * np.sin(7.0 * TIME + 1.0)])
SLIDES = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="one"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<joint name="one" type="slide" axis="1 0 0"/></body>
<body name="two"><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
<joint name="two" type="slide" axis="1 0 0" armature="0.5"/></body></worldbody>
<tendon><fixed name="spring" stiffness="80" damping="1.5">
<joint joint="two" coef="1"/><joint joint="one" coef="-1"/></fixed></tendon>
<actuator><motor name="push" joint="two" gear="2"/><motor name="pull" tendon="spring"/></actuator>
<sensor><jointpos name="x_one" joint="one"/><jointpos name="x_two" joint="two"/>
<tendonpos name="apart" tendon="spring"/><jointactuatorfrc name="force" joint="one"/></sensor>
{extra}</mujoco>"""
SLIDES_TOML = """
[machine]
name = "slides"
model = "slides.xml"
[components]
spring = { tendon = "spring" }
one = { joint = "one" }
two = { joint = "two" }
push = { actuator = "push", effects = [] }
x_one = { sensor = "x_one", effects = [] }
x_two = { sensor = "x_two", effects = [] }
apart = { sensor = "apart", effects = [] }
[[replays]]
"""
FREE = 'free = ["one", "two"]\nmoved_by = ["push"]\nobserve = ["x_one", "x_two", "apart"]\n'
LED = 'free = ["two"]\nmoved_by = ["x_one", "push"]\nobserve = ["x_two"]\n'


def slides(folder: Path, replay: str, extra: str = "") -> Machine:
    return described(folder, "slides", SLIDES.format(extra=extra), SLIDES_TOML + replay)


def coupled(
    machine: Machine, columns: dict[str, dict[str, np.ndarray]], steps: int = 1
) -> ForwardDynamicsModel:
    record = recording(machine, columns)
    model = machine.physics.model(machine, record.inputs, machine.configuration_of(record), steps)
    assert isinstance(model, ForwardDynamicsModel)
    return model


def test_a_pushed_double_pendulum_follows_lagranges_equations(tmp_path: Path) -> None:
    machine = arm(tmp_path)
    assert machine.kind == "free joints"
    expected = integrate(TORQUES, (0.3, -0.2), (0.0, 0.0))[0]
    commands = dict(zip(("drive_1", "drive_2"), TORQUES, strict=True))
    angles = dict(zip(("angle_1", "angle_2"), expected, strict=True))
    record = {"/command": commands, "/sensor": angles}
    errors = []
    for steps in (1, 2, 4):
        found = coupled(machine, record, steps).predict(machine.plant)
        errors.append(float(np.max(np.abs(found - expected))))
    # Of first order: the speed half a step before the start is taken for that at the start.
    assert errors[0] < 5e-3
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.4 * errors[0]


def test_two_masses_and_a_spring_move_in_their_modes(tmp_path: Path) -> None:
    machine = slides(tmp_path, FREE)
    push = np.zeros(1000)
    push[100:] = 1.5
    still = np.zeros(1000)
    record = {
        "/command": {"push": push},
        "/sensor": {"x_one": still, "x_two": still, "apart": still},
    }

    def slope(t: float, y: np.ndarray) -> list[float]:
        pull = 80.0 * (y[1] - y[0]) + 1.5 * (y[3] - y[2])
        force = 3.0 if t >= 100 * PERIOD else 0.0
        return [y[2], y[3], pull / 2.0, (force - pull) / 3.5]

    exact = solve_ivp(
        slope, (0.0, TIME[-1]), np.zeros(4), t_eval=TIME, rtol=1e-10, atol=1e-12, max_step=1e-3
    )
    found = coupled(machine, record).move(machine.plant)[0]
    assert np.max(np.abs(found - exact.y[:2])) < 2e-3 * np.max(np.abs(exact.y[:2]))


def test_dry_friction_holds_below_its_limit_and_slows_evenly_above(tmp_path: Path) -> None:
    machine = slides(tmp_path, FREE)
    plant = machine.plant._replace(two=Guide(coulomb=4.0), one=Guide(coulomb=6.0))
    still = np.zeros(1000)
    sensors = {"x_one": still, "x_two": still, "apart": still}
    held = coupled(machine, {"/command": {"push": still + 1.9}, "/sensor": sensors}).move(plant)
    assert np.max(np.abs(held[0])) < 1e-4
    alone = plant._replace(spring=Guide(), one=Guide())
    sliding = coupled(machine, {"/command": {"push": still + 3.0}, "/sensor": sensors}).move(alone)
    assert sliding[0, 1, -1] == pytest.approx(0.5 * (6.0 - 4.0) / 3.5 * TIME[-1] ** 2, rel=5e-3)


def test_friction_of_several_guides_on_one_body_adds_up(tmp_path: Path) -> None:
    """Friction at two coordinates of one body holds what neither alone could."""
    machine = slides(tmp_path, LED)
    still = np.zeros(1000)
    record = {"/command": {"push": still + 2.5}, "/sensor": {"x_one": still, "x_two": still}}
    both = machine.plant._replace(spring=Guide(coulomb=3.0), two=Guide(coulomb=2.5))
    one = machine.plant._replace(spring=Guide(coulomb=3.0), two=Guide())
    model = coupled(machine, record)
    assert np.max(np.abs(model.move(both)[0, 0])) < 1e-4
    assert np.max(np.abs(model.move(one)[0, 0])) > 1.0


def test_a_prescribed_joint_needs_the_force_that_mujoco_computes(tmp_path: Path) -> None:
    led = 'free = ["elbow"]\nmoved_by = ["angle_1", "drive_2"]\nobserve = ["angle_2", "torque_1"]\n'
    head = ARM_TOML.split("free =")[0].replace(
        "[[replays]]", 'torque_1 = { sensor = "torque_1", effects = [] }\n[[replays]]'
    )
    machine = arm(tmp_path, head + led)
    lead = 0.6 * np.sin(3.0 * TIME) ** 2
    still = np.zeros(1000)
    record = {
        "/command": {"drive_2": 0.5 * np.sin(5.0 * TIME)},
        "/sensor": {"angle_1": lead, "angle_2": still, "torque_1": still},
    }
    moved = coupled(machine, record).move(machine.plant)
    free, prescribed = moved[0]
    model = mujoco.MjModel.from_xml_string(ARM)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    rates = np.gradient(np.stack([prescribed, free]), PERIOD, axis=1)
    gains = np.gradient(rates, PERIOD, axis=1)
    expected = np.empty((2, 1000))
    for tick in range(1000):
        data.qpos[:] = prescribed[tick], free[tick]
        data.qvel[:], data.qacc[:] = rates[:, tick], gains[:, tick]
        mujoco.mj_inverse(model, data)
        expected[:, tick] = data.qfrc_inverse
    inside = slice(20, -20)
    size = np.max(np.abs(expected[0]))
    assert np.max(np.abs(expected[0] - moved[2, 1])[inside]) < 0.01 * size
    # And the free one takes what pushes it.
    assert np.max(np.abs(expected[1] - record["/command"]["drive_2"])[inside]) < 0.01 * size


def test_a_tied_joint_moves_with_its_coordinate(tmp_path: Path) -> None:
    tied = '<equality><joint joint1="two" joint2="one" polycoef="0 2 0 0 0"/></equality>'
    replay = 'free = ["one"]\nmoved_by = ["push"]\nobserve = ["x_one", "x_two"]\n'
    machine = slides(tmp_path, replay, tied)
    still = np.zeros(1000)
    record = {"/command": {"push": still + 1.0}, "/sensor": {"x_one": still, "x_two": still}}
    loose = machine.plant._replace(spring=Guide())
    found = coupled(machine, record).predict(loose)
    # 2 N at twice the way, against 2 kg and 4 · 3.5 kg.
    assert found[0, -1] == pytest.approx(0.5 * 4.0 / 16.0 * TIME[-1] ** 2, rel=3e-3)
    assert np.allclose(found[1], 2.0 * found[0])


CHAIN = """<mujoco><option gravity="0 0 0"/><worldbody>
<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="a" type="slide"/></body>
<body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint name="b" type="slide"/></body>
<body><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/><joint name="c" type="slide"/></body>
</worldbody><actuator><motor name="push" joint="c"/></actuator>
<sensor><jointpos name="x_a" joint="a"/><jointpos name="x_c" joint="c"/></sensor>
<equality>{ties}</equality></mujoco>"""
CHAIN_TOML = """
[machine]
name = "chain"
model = "chain.xml"
[components]
push = {{ actuator = "push", effects = [] }}
x_a = {{ sensor = "x_a", effects = [] }}
x_c = {{ sensor = "x_c", effects = [] }}
[[replays]]
free = ["{free}"]
moved_by = ["push"]
observe = ["x_a", "x_c"]
"""
C_OF_B = '<joint joint1="c" joint2="b" polycoef="0 2 0 0 0"/>'
B_OF_A = '<joint joint1="b" joint2="a" polycoef="0.1 3 0 0 0"/>'


@pytest.mark.parametrize("free", ["a", "b", "c"])
@pytest.mark.parametrize("ties", [C_OF_B + B_OF_A, B_OF_A + C_OF_B])
def test_a_chain_of_equalities_is_followed_in_any_order(
    tmp_path: Path, free: str, ties: str
) -> None:
    machine = described(tmp_path, "chain", CHAIN.format(ties=ties), CHAIN_TOML.format(free=free))
    assert not any("equality" in each for each in machine.overlooked)
    still = np.zeros(1000)
    sensors = {"x_a": still, "x_c": still + 0.2}
    record = {"/command": {"push": still + 1.0}, "/sensor": sensors}
    found = coupled(machine, record).predict(machine.plant)
    # 6 N along a, against 1, 9 · 2 and 36 · 3 kg.
    assert found[0, -1] == pytest.approx(0.5 * 6.0 / 127.0 * TIME[-1] ** 2, rel=3e-3)
    assert np.allclose(found[1], 0.2 + 6.0 * found[0])


def test_a_free_joint_at_the_far_end_of_a_chain_is_refused(tmp_path: Path) -> None:
    (tmp_path / "chain.xml").write_text(CHAIN.format(ties=C_OF_B + B_OF_A))
    path = tmp_path / "chain.toml"
    path.write_text(CHAIN_TOML.format(free='a", "c'))
    _, mistakes = examine(path)
    assert len(mistakes) == 1
    assert "an equality ties c to b, so it follows b; leave c out" in mistakes[0]


def test_a_motor_on_a_joint_that_stands_still_is_refused(tmp_path: Path) -> None:
    (tmp_path / "chain.xml").write_text(CHAIN.format(ties=B_OF_A))
    path = tmp_path / "chain.toml"
    path.write_text(CHAIN_TOML.format(free="a").replace('"x_a", "x_c"', '"x_a"'))
    _, mistakes = examine(path)
    assert "moved_by push: it pushes c, which stands still; expected a joint" in mistakes[0]


def test_a_motor_on_a_tendon_pulls_both_ends(tmp_path: Path) -> None:
    replay = 'free = ["one", "two"]\nmoved_by = ["pull"]\nobserve = ["x_one", "x_two"]\n'
    toml = SLIDES_TOML.replace(
        "[[replays]]", 'pull = { actuator = "pull", effects = [] }\n[[replays]]'
    )
    machine = described(tmp_path, "slides", SLIDES.format(extra=""), toml + replay)
    still = np.zeros(1000)
    record = {"/command": {"pull": still + 1.0}, "/sensor": {"x_one": still, "x_two": still}}
    found = coupled(machine, record).predict(machine.plant._replace(spring=Guide()))
    assert found[0, -1] == pytest.approx(-0.25 * TIME[-1] ** 2, rel=3e-3)
    assert found[1, -1] == pytest.approx(0.5 / 3.5 * TIME[-1] ** 2, rel=3e-3)


def test_an_actuator_takes_no_command_beyond_its_range_whatever_its_gain(tmp_path: Path) -> None:
    toml = SLIDES_TOML + FREE
    model = SLIDES.format(extra="").replace(
        '<motor name="push" joint="two" gear="2"/>',
        '<motor name="push" joint="two" gear="2" ctrllimited="true" ctrlrange="-0.5 1"/>',
    )
    machine = described(tmp_path, "slides", model, toml)
    still = np.zeros(1000)
    for command, force in ((3.0, 2.0), (-3.0, -1.0)):
        sensors = {"x_one": still, "x_two": still, "apart": still}
        record = {"/command": {"push": still + command}, "/sensor": sensors}
        plant = machine.plant._replace(spring=Guide())
        plant = plant._replace(push=plant.push._replace(gain=0.8))
        found = coupled(machine, record).predict(plant)
        assert found[1, -1] == pytest.approx(0.5 * 0.8 * force / 3.5 * TIME[-1] ** 2, rel=3e-3)
        (said,) = find_cut_commands(machine, [recording(machine, record)])
        assert "push takes commands from -0.5 to 1, and 100 % of the ticks" in said


@pytest.mark.parametrize(
    ("replay", "said"),
    [
        ('free = "one"\nmoved_by = ["push"]\nobserve = ["x_two"]', "expected a list of joints"),
        ('free = ["ones"]\nmoved_by = ["push"]\nobserve = ["x_two"]', "'ones' is no joint"),
        ('free = ["one", "one"]\nmoved_by = ["push"]\nobserve = ["x_one"]', "is listed twice"),
        ('free = ["one"]\nmoved_by = ["x_one"]\nobserve = ["x_two"]', "which is free"),
        ('free = ["one"]\nmoved_by = ["push"]\nobserve = ["x_two"]', "cannot be observed"),
        ('free = ["one"]\nmoved_by = ["apart"]\nobserve = ["x_one"]', "is of no single joint"),
        (
            'free = ["two"]\nmoved_by = ["push"]\nobserve = ["x_two"]\nband = 3.0',
            "band is for joints that all move as measured",
        ),
    ],
)
def test_an_impossible_replay_is_refused(tmp_path: Path, replay: str, said: str) -> None:
    (tmp_path / "slides.xml").write_text(SLIDES.format(extra=""))
    (tmp_path / "slides.toml").write_text(SLIDES_TOML + replay)
    with pytest.raises(RigtwinError, match=said):
        load(tmp_path / "slides.toml")


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        (
            "command_low = 3.0, command_high = -3.0",
            "command_low 3: expected less than command_high",
        ),
        ("command_low = nan", "command_low"),
        ('command_high = "wide"', "command_high"),
        ("constant = 0.0", "constant 0: expected another number"),
    ],
)
def test_impossible_command_limits_are_refused(tmp_path: Path, limits: str, said: str) -> None:
    push = f'push = {{ actuator = "push", {limits} }}'
    toml = "\n".join(
        push if line.startswith("push = ") else line for line in SLIDES_TOML.splitlines()
    )
    assert push in toml
    (tmp_path / "slides.xml").write_text(SLIDES.format(extra=""))
    (tmp_path / "slides.toml").write_text(toml + "\n" + FREE)
    with pytest.raises(RigtwinError, match=said):
        load(tmp_path / "slides.toml")


def test_the_model_predicts_the_twins_recording_to_the_noise(tmp_path: Path) -> None:
    machine = rigtwin.machine("cart-pole")
    record = rigtwin.run(machine, "pushes", path=tmp_path / "run.mcap")
    configuration = machine.configuration_of(record)
    model = machine.physics.model(machine, record.inputs, configuration, configuration.substeps)
    predicted = model.predict(machine.plant)
    for row, signal, noise in zip(machine.rows, predicted, (2e-5, 1e-4), strict=True):
        left = signal - record.column(*row.channel)
        assert np.std(left) < 1.2 * noise


def test_a_search_uses_longer_steps_only_where_they_change_little(tmp_path: Path) -> None:
    machine = rigtwin.machine("cart-pole")
    record = rigtwin.run(machine, "pushes", path=tmp_path / "run.mcap")
    configuration = machine.configuration_of(record)
    model = machine.physics.model(machine, record.inputs, configuration, 8)
    thinned, own = model.thin(2.5e-3), model.predict(machine.plant)
    assert thinned is not model
    change = thinned.predict(machine.plant) - own[:, :: thinned.every]
    assert np.all(np.std(change, axis=1) <= 5e-3 * np.std(own, axis=1))
    # No steps shorter than the model's own are taken.
    same = model.thin(1e-5)
    assert same.every == 1
    assert np.all(np.std(same.predict(machine.plant) - own, axis=1) <= 5e-3 * np.std(own, axis=1))


@pytest.mark.slow
def test_a_fit_leaves_the_minima_of_stick_and_slip(tmp_path: Path) -> None:
    machine, shorter = rigtwin.machine("cart-pole"), {"timing": {"duration": 6.0}}
    record = rigtwin.run(machine, "pushes", settings=shorter, effects=["coulomb@rail=1.5"])
    fitted = rigtwin.fit(record, ["coulomb@rail"], machine=machine)
    assert fitted["coulomb@rail"].value == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "instead"),
    [
        ({"mass": 2.0}, 'mass="2" pos="0 0 -0.15" diaginertia="0.02 0.02 0.00166666667"'),
        ({"centre_x": 0.1}, 'mass="1.2" pos="0.1 0 -0.15" diaginertia="0.012 0.012 0.001"'),
    ],
)
def test_a_changed_body_moves_as_in_a_changed_mjcf(
    tmp_path: Path, values: dict[str, float], instead: str
) -> None:
    body = '[components.lower]\nbody = "lower"\ntype = "body"\n[components.floor]\nbody = "upper"\n'
    toml = ARM_TOML.replace("[[replays]]", body + 'type = "base"\n[[replays]]')
    written = 'mass="1.2" pos="0 0 -0.15" diaginertia="0.012 0.012 0.001"'
    still = np.zeros(1000)
    record = {
        "/command": dict(zip(("drive_1", "drive_2"), TORQUES, strict=True)),
        "/sensor": {"angle_1": still, "angle_2": still},
    }
    (tmp_path / "one").mkdir()
    (tmp_path / "other").mkdir()
    told = arm(tmp_path / "one", toml)
    found = coupled(told, record).predict(
        told.plant._replace(lower=told.plant.lower._replace(**values))
    )
    assert written in ARM
    other = arm(tmp_path / "other", toml, ARM.replace(written, instead))
    expected = coupled(other, record).predict(other.plant)
    assert np.max(np.abs(expected - coupled(told, record).predict(told.plant))) > 0.05
    assert found == pytest.approx(expected, abs=1e-6)
    # A base that is turned about the joints' own axis is a shoulder that is turned.
    tilted = told.plant._replace(floor=told.plant.floor._replace(tilt_y=0.2))
    hanging = coupled(told, record).predict(tilted)
    assert np.max(np.abs(hanging - coupled(told, record).predict(told.plant))) > 0.05
