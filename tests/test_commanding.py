"""Controllers of joints that act on each other, and limits that end a test."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.signal import cont2discrete

import rigtwin
from rigtwin.cli import main
from rigtwin.description.document import examine

MODEL = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="cart">
      <inertial pos="0 0 0" mass="1.2" diaginertia="0.003 0.003 0.003"/>
      <joint name="rail" type="slide" axis="1 0 0" damping="2.0"/>
      <body name="pole">
        <inertial pos="0 0 0.25" mass="0.25" diaginertia="0.0055 0.0055 0.0001"/>
        <joint name="pivot" type="hinge" axis="0 -1 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="drive" joint="rail"/>
  </actuator>
  <sensor>
    <jointpos name="place" joint="rail"/>
    <jointvel name="pace" joint="rail"/>
    <jointpos name="angle" joint="pivot"/>
    <jointvel name="rate" joint="pivot"/>
  </sensor>
</mujoco>
"""
TABLES = """[machine]
name = "upright"
model = "upright.xml"
nominal = "known"
[components.rail]
joint = "rail"
[components.pivot]
joint = "pivot"
[components.drive]
actuator = "drive"
command = "force"
[components.place]
sensor = "place"
[components.pace]
sensor = "pace"
[components.angle]
sensor = "angle"
[components.rate]
sensor = "rate"
[[replays]]
name = "both"
free = ["rail", "pivot"]
moved_by = ["drive"]
observe = ["place", "angle"]
[experiments.step]
duration = 3.0
period = 1e-3
[experiments.step.demands]
reference = "0.01"
"""
PERIOD, TICKS = 1e-3, 3000
NAMES = ("place", "angle", "pace", "rate")


def linear() -> tuple[np.ndarray, np.ndarray]:
    """Cart and upright pole about rest, worked out by hand: states as NAMES."""
    cart, pole, arm, inertia, damping, gravity = 1.2, 0.25, 0.25, 0.0055, 2.0, 9.81
    # The pole leans towards -x for a positive angle: x_tip = x - arm * angle.
    mass = np.array([[cart + pole, -pole * arm], [-pole * arm, inertia + pole * arm**2]])
    stiff = np.array([[0.0, 0.0], [0.0, -pole * gravity * arm]])
    damp = np.array([[damping, 0.0], [0.0, 0.0]])
    inverse = np.linalg.inv(mass)
    states = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiff, -inverse @ damp]])
    return states, np.concatenate([np.zeros((2, 1)), inverse @ [[1.0], [0.0]]])


STATES, INPUT = linear()
GAIN = np.asarray(control.lqr(STATES, INPUT, np.diag([40.0, 10.0, 1.0, 1.0]), [[0.1]])[0])[0]


def lqr(sensed: dict[str, float], demanded: dict[str, float]) -> float:
    off = [sensed["place"] - demanded["reference"], *(sensed[name] for name in NAMES[1:])]
    return -sum(k * each for k, each in zip(GAIN, off, strict=True))


def machine(folder: Path, more: str = "", tables: str = TABLES) -> rigtwin.Machine:
    (folder / "upright.xml").write_text(MODEL)
    path = folder / "upright.toml"
    path.write_text(tables + more)
    return rigtwin.machine(path)


def by_formula() -> str:
    gains = "\n".join(f"k{number} = {gain!r}" for number, gain in enumerate(map(float, GAIN)))
    terms = "k0 * (reference - place) - k1 * angle - k2 * pace - k3 * rate"
    return f'[controller]\noutput = "force"\nformula = "{terms}"\n[controller.settings]\n{gains}\n'


def step(configuration: rigtwin.Configuration, seed: int) -> dict[str, np.ndarray]:
    return {"reference": np.full(TICKS, 0.01)}


def test_a_pole_is_kept_upright_as_the_linear_loop_has_it(tmp_path: Path) -> None:
    made = rigtwin.run(machine(tmp_path), step, controller=lqr)
    system: Any = (STATES, INPUT, np.eye(4), np.zeros((4, 1)))
    sampled: Any = cont2discrete(system, PERIOD)
    ahead, push = sampled[:2]
    state, expected = np.zeros(4), np.zeros((4, TICKS))
    for tick in range(TICKS):
        expected[:, tick] = state
        state = ahead @ state + push[:, 0] * (-GAIN @ (state - [0.01, 0.0, 0.0, 0.0]))
    assert made.end == "completed"
    assert expected[0, -1] == pytest.approx(0.01, rel=0.05)
    for name, signal in zip(NAMES[:2], expected, strict=False):
        error = np.max(np.abs(made[f"/sensor.{name}"] - signal))
        assert error < 0.01 * np.max(np.abs(signal))


def test_a_formula_commands_as_the_same_in_python_does(tmp_path: Path) -> None:
    ours = rigtwin.run(machine(tmp_path), step, controller=lqr)
    formula = rigtwin.run(machine(tmp_path, by_formula()), "step")
    assert formula["/command.force"] == pytest.approx(ours["/command.force"], abs=1e-9)


def test_commands_played_back_move_the_machine_the_same(tmp_path: Path) -> None:
    of = machine(tmp_path)
    led = rigtwin.run(of, step, controller=lqr)
    played = rigtwin.run(of, lambda *_: {"force": led["/command.force"]})
    for name in NAMES:
        assert np.array_equal(played[f"/sensor.{name}"], led[f"/sensor.{name}"])


def test_a_controller_that_gives_no_number_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(
        rigtwin.RigtwinError, match="the controller gave 'much'; expected a finite number"
    ):
        rigtwin.run(machine(tmp_path), step, controller=lambda *_: "much")
    with pytest.raises(
        rigtwin.RigtwinError, match=r"gave \{'push': 1.0\}; expected a finite number"
    ):
        rigtwin.run(machine(tmp_path), step, controller=lambda *_: {"push": 1.0})


def test_where_nothing_can_be_commanded_it_is_said(tmp_path: Path) -> None:
    nothing = "a controller has nothing to command in this test"
    with pytest.raises(rigtwin.RigtwinError, match=nothing):
        rigtwin.run("tx40", step, controller=lambda *_: 0.0)
    with pytest.raises(rigtwin.RigtwinError, match=nothing):
        rigtwin.run(machine(tmp_path), lambda *_: {"force": np.zeros(10)}, controller=lqr)
    (tmp_path / "upright.xml").write_text(
        MODEL.replace('<motor name="drive" joint="rail"/>', '<position name="drive" joint="rail"/>')
    )
    led = TABLES.replace('free = ["rail", "pivot"]', 'free = ["pivot"]') + by_formula()
    (tmp_path / "led.toml").write_text(led)
    with pytest.raises(
        rigtwin.RigtwinError, match="unknown demand .reference.; this test takes force"
    ):
        rigtwin.run(tmp_path / "led.toml", step)


def test_what_prescribes_a_motion_is_read_too() -> None:
    """The road of a quarter car, beside its body's travel."""
    road = 0.004 * np.sin(9.0 * np.arange(500) * PERIOD)
    seen: list[float] = []

    def hold(sensed: dict[str, float], _: dict[str, float]) -> float:
        seen.append(sensed["road"])
        return -20.0 * sensed["travel"]

    made = rigtwin.run("quarter-car-bench", lambda *_: {"road": road}, controller=hold)
    assert made["/sensor.road"] == pytest.approx(seen, abs=1e-12)
    assert made["/sensor.road"] == pytest.approx(road, abs=1e-5)


def test_one_s_own_needs_no_demands_of_the_described_one(tmp_path: Path) -> None:
    of = machine(tmp_path, by_formula())
    assert rigtwin.run(of, lambda *_: {}, controller=lambda *_: 0.0).end == "completed"


LIMITS = "[limits]\nplace = [-0.1, 0.004]\nangle = 0.5\n"


def test_a_limit_ends_the_test_at_the_first_tick_beyond_it(tmp_path: Path) -> None:
    whole = rigtwin.run(machine(tmp_path), step, controller=lqr)["/sensor.place"]
    made = rigtwin.run(machine(tmp_path, LIMITS), step, controller=lqr)
    first = int(np.argmax(whole > 0.004))
    assert made.end == "trip: place above 0.004 m"
    assert made.tripped
    assert np.array_equal(made["/sensor.place"], whole[: first + 1])


def test_a_falling_mass_meets_a_limit_before_it_diverges(tmp_path: Path) -> None:
    of = machine(tmp_path, LIMITS)
    fall = rigtwin.run(of, lambda *_: {"force": np.full(TICKS, -0.5)})
    assert fall.end == "trip: angle below -0.5 rad"
    wider = {"safety": {"angle_low": -50.0}}
    fall = rigtwin.run(of, lambda *_: {"force": np.full(TICKS, -0.5)}, settings=wider)
    assert fall.end == "trip: place below -0.1 m"


def test_limits_the_wrong_way_round_are_said(tmp_path: Path) -> None:
    wrong = {"safety": {"place_high": -0.2}}
    with pytest.raises(rigtwin.RigtwinError, match="place_high = -0.2: expected low"):
        rigtwin.run(machine(tmp_path, LIMITS), step, controller=lqr, settings=wrong)


FILTERED = """
[controller]
output = "force"
formula = "low_pass(reference - place, tau)"
[controller.settings]
tau = 0.01
"""


def test_a_setting_that_a_filter_cannot_work_with_is_said(tmp_path: Path) -> None:
    of = machine(tmp_path, FILTERED)
    wrong = {"controller": {"tau": -0.01}}
    with pytest.raises(rigtwin.RigtwinError, match="of force: low_pass: expected a time constant"):
        rigtwin.run(of, "step", settings=wrong)
    with pytest.raises(rigtwin.RigtwinError, match="low_pass: expected a time constant"):
        machine(tmp_path, FILTERED.replace("tau = 0.01", "tau = 0.0"))


def test_limits_go_to_other_processes(tmp_path: Path) -> None:
    safety = machine(tmp_path, LIMITS).configuration.safety
    assert pickle.loads(pickle.dumps(safety)) == safety
    assert safety._asdict()["angle_low"] == -0.5


def test_a_trip_has_an_exit_code_of_its_own(tmp_path: Path, capsys) -> None:
    path = machine(tmp_path, by_formula() + LIMITS).path
    out = tmp_path / "step.mcap"
    assert main(["run", "step", "--machine", str(path), "--out", str(out)]) == 3
    assert "trip: place above 0.004 m" in capsys.readouterr().out
    assert main(["run", "step", "--machine", str(path), "--set", "safety.place_high=0.1"]) == 0


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "plaice = 1",
            "[limits] plaice: no sensor or actuator of that name; did you mean 'place'?",
        ),
        ("place = [1, 2, 3]", "expected [low, high], or a number"),
        ("place = [0.1, -0.1]", "expected low below high"),
        ("place = -0.1", "expected a number above 0"),
        ('place = ["a", 1]', "expected a number from"),
        ("rail = 1", "[limits] rail: no sensor or actuator of that name"),
    ],
)
def test_a_limit_that_cannot_be_is_refused(tmp_path: Path, line: str, said: str) -> None:
    (tmp_path / "upright.xml").write_text(MODEL)
    path = tmp_path / "upright.toml"
    path.write_text(f"{TABLES}[limits]\n{line}\n")
    _, mistakes = examine(path)
    assert len(mistakes) >= 1
    assert said in mistakes[0]


MOTOR = '<motor name="drive" joint="rail"/>'
TIED = """<equality><joint joint1="rail" joint2="pivot" polycoef="0 1 0 0 0"/></equality>
  <actuator>"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'sensor = "angle"',
            'sensor = "angle"\nchannel = "place"',
            "[components.angle]: its channel 'place' is that of place",
        ),
        (
            'free = ["rail", "pivot"]',
            'free = ["place", "angle"]',
            "free: 'place', 'angle' are components; expected joints of the MJCF: rail (of place), "
            "pivot (of angle)",
        ),
        (
            'free = ["rail", "pivot"]',
            'free = ["rial", "pivot"]',
            "free: 'rial' is no joint; did you mean 'rail'?",
        ),
        (
            'free = ["rail", "pivot"]',
            "free = { rail = true, pivot = true }",
            "expected a list of joints that nothing prescribes",
        ),
        (
            'moved_by = ["drive"]',
            'moved_by = ["drive", "drive"]',
            "moved_by: drive is listed twice",
        ),
        (
            "[[replays]]",
            "[limits]\nplace = true\n[[replays]]",
            "[limits] place: True: expected a number",
        ),
    ],
)
def test_a_mistake_of_a_coupled_machine_is_one_line(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    (tmp_path / "upright.xml").write_text(MODEL)
    path = tmp_path / "upright.toml"
    assert old in TABLES
    path.write_text(TABLES.replace(old, new, 1))
    _, mistakes = examine(path)
    assert len(mistakes) == 1
    assert said in mistakes[0]


def test_a_joint_that_an_equality_ties_to_another_is_not_free(tmp_path: Path) -> None:
    (tmp_path / "upright.xml").write_text(MODEL.replace("<actuator>", TIED))
    path = tmp_path / "upright.toml"
    path.write_text(TABLES)
    _, mistakes = examine(path)
    assert "an equality ties rail to pivot, so it follows pivot; leave rail out" in mistakes[0]


@pytest.mark.parametrize(
    ("actuator", "said"),
    [
        (
            '<general name="drive" joint="rail" biastype="affine" biasprm="0 0 3"/>',
            "its force grows with speed, 3 (biasprm); expected 0 or a negative number",
        ),
        (
            '<general name="drive" joint="rail" biastype="affine" biasprm="5 0 0"/>',
            "its constant force is 5 (biasprm); expected 0",
        ),
        (
            '<general name="drive" joint="rail" biastype="user" biasprm="5 0 0"/>',
            "its biastype is user; expected <motor>, <position>, <velocity>, or <general> with a",
        ),
        (
            '<general name="drive" joint="rail" gaintype="affine" gainprm="5 0 2"/>',
            "its gaintype is affine, force per command by position and speed; expected <motor>",
        ),
        (
            '<general name="drive" joint="rail" gaintype="user" gainprm="5"/>',
            "its gaintype is user, force per command by a law of its own; expected <motor>",
        ),
        (
            '<dcmotor name="drive" joint="rail" motorconst="0.5" resistance="4" '
            'inductance="0.01"/>',
            "it is a <dcmotor> with more than a resistance and a motor constant; expected these",
        ),
        (
            '<general name="drive" joint="rail" dyntype="integrator"/>',
            "its activation dynamics are dyntype integrator; expected none, filter or filterexact",
        ),
        (
            '<motor name="drive" joint="rail" delay="0.1" nsample="2"/>',
            "its nsample 2 holds 0.004 s of its delay of 0.1 s; expected nsample at least 50",
        ),
        (
            '<motor name="drive" joint="rail" damping="2"/>',
            "its damping is 2; expected 0, and the damping at the joint that it moves",
        ),
    ],
)
def test_a_force_law_that_no_component_has_is_refused_by_name(
    tmp_path: Path, actuator: str, said: str
) -> None:
    (tmp_path / "upright.xml").write_text(MODEL.replace(MOTOR, actuator))
    path = tmp_path / "upright.toml"
    path.write_text(TABLES)
    _, mistakes = examine(path)
    assert len(mistakes) == 1
    assert f"actuator 'drive': {said}" in mistakes[0]


@pytest.mark.parametrize("name", ["_k", "__class__", "1k", ""])
def test_a_setting_has_a_name_that_can_be_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "upright.xml").write_text(MODEL)
    path = tmp_path / "upright.toml"
    tables = (
        f'[controller]\noutput = "force"\nformula = "place"\n[controller.settings]\n"{name}" = 1'
    )
    path.write_text(f"{TABLES}{tables}\n")
    _, mistakes = examine(path)
    assert f"{name!r} cannot be a setting's name" in mistakes[0]


def test_what_a_machine_can_never_show_is_worked_out_with_a_controller_too(tmp_path: Path) -> None:
    tables = '[controller]\noutput = "force"\nformula = "kp * (reference - place)"\n'
    of = machine(tmp_path, f"{tables}[controller.settings]\nkp = 1.0\n")
    assert rigtwin.identifiability(of).motions == ()


def test_a_controller_of_sensors_alone_needs_no_demands(tmp_path: Path) -> None:
    (tmp_path / "upright.xml").write_text(MODEL)
    path = tmp_path / "upright.toml"
    head = TABLES[: TABLES.index("[experiments.step]")]
    path.write_text(
        f'{head}[controller]\noutput = "force"\nformula = "-5 * place - 5 * pace"\n'
        "[experiments.rest]\nduration = 0.5\n[experiments.rest.demands]\n"
    )
    assert rigtwin.run(rigtwin.machine(path), "rest").ticks == 500


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, None, "x", [1.0, 2.0]])
@pytest.mark.parametrize("of", ["emps", "upright"])
def test_a_command_is_a_finite_number(tmp_path: Path, of: str, value: Any) -> None:
    name = "positioning" if of == "emps" else step
    where = of if of == "emps" else machine(tmp_path)
    demands = (lambda *_: {}) if of == "emps" else name
    short = {"timing": {"duration": 0.1}}
    with pytest.raises(rigtwin.RigtwinError, match="expected a finite number"):
        rigtwin.run(where, demands, controller=lambda *_: value, settings=short)


@pytest.mark.parametrize(
    "value", [None, [1, 2], {3: [0.0]}, {"reference": ["a"]}, {"reference": 5}]
)
def test_demands_are_signals_by_channel(tmp_path: Path, value: Any) -> None:
    with pytest.raises(rigtwin.RigtwinError, match="demand"):
        rigtwin.run(machine(tmp_path, by_formula()), lambda *_: value)
