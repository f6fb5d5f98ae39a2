"""Servos: their law beside MuJoCo's own position actuators, alone and where joints act on each
other; what is other about one is found in data of plain MuJoCo."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.components import Servo
from rigtwin.components.servo import push, push_law
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.prices import Prices
from rigtwin.diagnosis.thresholds import STANDARD
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from tests.helpers.mujoco_joint import MujocoModel

ARM = """
<mujoco>
  <option gravity="0 0 -9.81" timestep="1.25e-4" integrator="implicitfast"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.6"/>
      {forearm}
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder_servo" joint="shoulder" kp="{kp}" kv="{kv}" {limit}/>
    {elbow}
  </actuator>
  <sensor><jointpos name="shoulder_angle" joint="shoulder"/>{elbow_sensor}</sensor>
</mujoco>
"""
FOREARM = """<body name="lower" pos="0 0 -0.3">
  <joint name="elbow" axis="0 1 0" damping="0.03"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.3"/>
</body>"""
ELBOW = '<position name="elbow_servo" joint="elbow" kp="6" kv="0.4"/>'
ELBOW_SENSOR = '<jointpos name="elbow_angle" joint="elbow"/>'
ONE = """
[machine]
name = "servo-arm"
title = "an arm on a servo"
model = "arm.xml"
nominal = "known"
[components]
arm = { body = "upper", effects = [] }
bearing = { joint = "shoulder", effects = ["coulomb", "viscous"] }
servo = { actuator = "shoulder_servo", type = "servo", command = "shoulder" }
encoder = { sensor = "shoulder_angle", channel = "shoulder", white = 1e-4, effects = [] }
[[replays]]
name = "held"
moved_by = "servo"
observe = ["encoder"]
"""
TWO = """
[machine]
name = "servo-arm"
title = "an arm on two servos"
model = "arm.xml"
nominal = "known"
[components]
shoulder = { joint = "shoulder", effects = ["coulomb"] }
elbow = { joint = "elbow", effects = [] }
shoulder_encoder = { sensor = "shoulder_angle", channel = "shoulder", white = 1e-4, effects = [] }
elbow_encoder = { sensor = "elbow_angle", channel = "elbow", white = 1e-4, effects = [] }
[components.shoulder_servo]
actuator = "shoulder_servo"
type = "servo"
command = "shoulder"
effects = ["position_gain", "damping_gain", "delay"]
[components.elbow_servo]
actuator = "elbow_servo"
type = "servo"
command = "elbow"
effects = ["position_gain"]
[[replays]]
free = ["shoulder", "elbow"]
moved_by = ["shoulder_servo", "elbow_servo"]
observe = ["shoulder_encoder", "elbow_encoder"]
"""
PERIOD, DURATION = 2e-3, 8.0


def model_text(two: bool, kp: float = 20.0, kv: float = 1.0, limit: float = 0.0) -> str:
    return ARM.format(
        kp=kp,
        kv=kv,
        limit=f'forcerange="-{limit} {limit}"' if limit else "",
        forearm=FOREARM if two else "",
        elbow=ELBOW if two else "",
        elbow_sensor=ELBOW_SENSOR if two else "",
    )


def machine_in(folder: Path, toml: str, text: str) -> rigtwin.Machine:
    (folder / "arm.xml").write_text(text)
    (folder / "arm.toml").write_text(toml)
    return rigtwin.machine(folder / "arm.toml")


def commanded(time: Array) -> dict[str, Array]:
    return {
        "shoulder": 0.5 * np.sin(2.1 * time) + 0.2 * np.sign(np.sin(3.7 * time)),
        "elbow": 0.6 * np.sin(1.7 * time + 0.4) + 0.1 * np.sign(np.sin(2.9 * time)),
    }


def recorded(text: str, noise: float = 1e-4, seed: int = 5) -> RecordedTest:
    """What MuJoCo's own actuators do."""
    model = mujoco.MjModel.from_xml_string(text)
    data, joints = mujoco.MjData(model), ("shoulder", "elbow")[: model.nu]
    time = np.arange(round(DURATION / PERIOD)) * PERIOD
    commands = {name: commanded(time)[name] for name in joints}
    places = np.zeros((len(joints), len(time)))
    fine = round(PERIOD / model.opt.timestep)
    for tick in range(len(time)):
        places[:, tick] = data.qpos
        data.ctrl[:] = [commands[name][tick] for name in joints]
        mujoco.mj_step(model, data, fine)
    random = np.random.default_rng(seed)
    places += noise * random.standard_normal(places.shape)
    sensors = dict(zip(joints, places, strict=True))
    return RecordedTest(
        path=Path("arm.mcap"),
        machine="servo-arm",
        experiment="steps and sines",
        period=PERIOD,
        time=time,
        columns={"/command": commands, "/sensor": sensors},
        controller={},
    )


def predict(machine: rigtwin.Machine, recording: RecordedTest) -> dict[str, Array]:
    configuration = machine.configuration_of(recording)
    model = machine.physics.model(machine, recording.inputs, configuration, 16)
    rows = model.predict(machine.plant)
    return {row.channel[1]: each for row, each in zip(model.rows, rows, strict=True)}


def test_a_servo_pushes_by_its_error_less_its_damping_up_to_its_limit() -> None:
    law = push_law(Servo(position_gain=100.0, damping_gain=2.0, force_limit=5.0, deadband=0.01))
    assert push(law, 0.03, 0.0, 0.5) == pytest.approx(100.0 * (0.03 - 0.01) - 1.0)
    assert push(law, 0.005, 0.0, 0.0) == 0.0
    assert push(law, 1.0, 0.0, 0.0) == 5.0
    assert push(law, -1.0, 0.0, 0.0) == -5.0


@pytest.mark.parametrize("limit", [0.0, 2.0])
@pytest.mark.parametrize("two", [False, True], ids=["alone", "coupled"])
def test_prediction_is_that_of_mujocos_own_position_actuators(
    tmp_path: Path, two: bool, limit: float
) -> None:
    text = model_text(two, limit=limit)
    recording = recorded(text, noise=0.0)
    machine = machine_in(tmp_path, TWO if two else ONE, text)
    for name, found in predict(machine, recording).items():
        true = recording["/sensor." + name]
        assert np.sqrt(np.mean((found - true) ** 2)) < 0.002 * np.std(true)


def test_the_joint_alone_goes_as_in_mujoco_and_so_does_its_twin(tmp_path: Path) -> None:
    text = model_text(two=False, limit=2.0)
    recording = recorded(text, noise=0.0)
    machine = machine_in(tmp_path, ONE, text)
    (replay,) = machine.replays
    reference = MujocoModel(machine, replay, recording.inputs, machine.configuration, 16)
    found = reference.move(machine.plant)[0]
    assert np.std(found - recording["/sensor.shoulder"]) < 0.002 * np.std(found)
    demanded = {"shoulder": commanded(recording.time)["shoulder"]}
    twin = rigtwin.run(machine, lambda *_: demanded, settings={"timing": {"period": PERIOD}})
    assert np.std(twin["/sensor.shoulder"] - found) < 0.002 * np.std(found) + 2e-4


CHANGED: Mapping[str, tuple[Callable[[], str], str, float]] = {
    "position_gain": (lambda: model_text(two=False, kp=15.0), "position_gain", 15.0),
    "damping_gain": (lambda: model_text(two=False, kv=1.4), "damping_gain", 1.4),
    "force_limit": (lambda: model_text(two=False, limit=3.0), "force_limit", 3.0),
}


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=() if kind == "position_gain" else pytest.mark.slow)
        for kind in CHANGED
    ],
)
def test_what_is_other_about_a_servo_is_found(tmp_path: Path, kind: str) -> None:
    changed, parameter, value = CHANGED[kind]
    # A bearing that may be anything takes the place of damping in the servo.
    toml = ONE.replace('["coulomb", "viscous"]', '["coulomb"]')
    machine = machine_in(tmp_path, toml, model_text(two=False))
    answer = rigtwin.diagnose(recorded(changed()), machine=machine)
    (found,) = answer.effects
    assert str(found.name) == f"{kind}@servo"
    assert found.parameters[parameter].value == pytest.approx(value, rel=0.02)


def test_a_servo_as_told_leaves_no_gap(tmp_path: Path) -> None:
    machine = machine_in(tmp_path, ONE, model_text(two=False))
    assert rigtwin.diagnose(recorded(model_text(two=False)), machine=machine).verdict == "no gap"


@pytest.mark.slow
def test_the_gain_of_one_of_two_servos_is_found(tmp_path: Path) -> None:
    machine = machine_in(tmp_path, TWO, model_text(two=True))
    answer = rigtwin.diagnose(recorded(model_text(two=True, kp=15.0)), machine=machine)
    (found,) = answer.effects
    assert str(found.name) == "position_gain@shoulder_servo"
    assert found.parameters["position_gain"].value == pytest.approx(15.0, rel=0.02)


def test_the_users_mjcf_gets_the_gains_that_were_found(tmp_path: Path) -> None:
    machine = machine_in(tmp_path, ONE, model_text(two=False))
    changes = [Change("servo", "position_gain", 15.0), Change("servo", "damping_gain", 1.4)]
    left = write_mjcf(tmp_path / "new.xml", machine, [*changes, Change("servo", "delay", 0.01)])
    assert left == ()
    before, after = (
        mujoco.MjModel.from_xml_path(str(tmp_path / n)) for n in ("arm.xml", "new.xml")
    )
    assert before.actuator_gainprm[0, 0] == 20.0
    assert after.actuator_gainprm[0, 0] == 15.0
    assert after.actuator_biasprm[0, 1:3].tolist() == [-15.0, -1.4]
    assert after.actuator_delay[0] == 0.01
    assert after.actuator_history[0, 0] * after.opt.timestep >= 0.01


def test_the_users_mjcf_gets_both_gains_by_their_factor(tmp_path: Path) -> None:
    machine = machine_in(tmp_path, ONE, model_text(two=False))
    changes = [Change("servo", "gains", 2.0), Change("servo", "damping_gain", 1.4)]
    assert write_mjcf(tmp_path / "new.xml", machine, changes) == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert model.actuator_gainprm[0, 0] == 40.0
    assert model.actuator_biasprm[0, 1:3].tolist() == [-40.0, -2.8]


def test_the_users_mjcf_gets_the_timing_and_the_limit_of_a_servo(tmp_path: Path) -> None:
    machine = machine_in(tmp_path, ONE, model_text(two=False))
    values = {"delay": 0.0101, "lag": 0.03, "force_limit": 4.0, "deadband": 0.01}
    changes = [Change("servo", name, value) for name, value in values.items()]
    assert write_mjcf(tmp_path / "new.xml", machine, changes) == ("servo.deadband = 0.01",)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert model.actuator_delay[0] == 0.0101
    assert model.actuator_dynprm[0, 0] == 0.03
    assert model.actuator_dyntype[0] == mujoco.mjtDyn.mjDYN_FILTEREXACT
    assert model.actuator_forcerange[0].tolist() == [-4.0, 4.0]
    # And the description of the written model has them as its nominal values.
    servo = machine_in(tmp_path, ONE, (tmp_path / "new.xml").read_text()).plant.servo
    assert (servo.delay, servo.lag, servo.force_limit) == (0.0101, 0.03, 4.0)


def test_delay_and_time_constant_of_the_mjcf_act_as_in_mujoco(tmp_path: Path) -> None:
    """MuJoCo itself runs the servo, on the same ticks, and the model predicts the same angle."""
    text = model_text(two=False).replace(
        'kv="1.0" ', 'kv="1.0" timeconst="0.05" delay="0.02" nsample="200" '
    )
    machine = machine_in(tmp_path, ONE, text)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    steps = round(1e-3 / model.opt.timestep)
    command, angle = 0.4 * np.sin(9.0 * np.arange(2000) * 1e-3), np.empty(2000)
    for tick in range(2000):
        angle[tick], data.ctrl[0] = data.qpos[0], command[tick]
        for _ in range(steps):
            mujoco.mj_step(model, data)
    columns = {"/command": {"shoulder": command}, "/sensor": {"shoulder": angle}}
    time = np.arange(2000) * 1e-3
    recording = RecordedTest(Path("servo"), machine.name, "", 1e-3, time, columns, {})
    configuration = machine.configuration_of(recording)
    predicted = machine.physics.model(machine, recording.inputs, configuration, 8).predict(
        machine.plant
    )[0]
    assert np.max(np.abs(predicted - angle)) < 0.02 * np.ptp(angle)
    plain = machine.plant._replace(servo=machine.plant.servo._replace(delay=0.0, lag=0.0))
    off = machine.physics.model(machine, recording.inputs, configuration, 8).predict(plain)[0]
    assert np.max(np.abs(off - angle)) > 0.2 * np.ptp(angle)


@pytest.mark.parametrize("name", ["forcerange", "ctrlrange"])
def test_a_range_the_wrong_way_round_is_refused(tmp_path: Path, name: str) -> None:
    text = model_text(two=False).replace('kv="1.0" />', f'kv="1.0" {name}="5 -5"/>')
    said = f"{name} of actuator 'shoulder_servo' is 5 -5; expected the lower end first"
    with pytest.raises(RigtwinError, match=said):
        machine_in(tmp_path, ONE, text)


def test_an_actuator_that_is_no_servo_is_refused(tmp_path: Path) -> None:
    text = model_text(two=False).replace('kp="20.0" kv="1.0"', 'kp="20" gear="2"')
    with pytest.raises(RigtwinError, match="is no servo; expected a position actuator"):
        machine_in(tmp_path, ONE, text)


def test_friction_of_a_joint_is_likelier_than_another_damping_of_its_servo(tmp_path: Path) -> None:
    text = model_text(two=False)
    machine, recording = machine_in(tmp_path, ONE, text), recorded(text)
    evidence = Evidence(machine, [recording], [machine.configuration_of(recording)])
    prices = Prices(Fitter(evidence), STANDARD, 10, 1000.0, 1, 0.0)
    effects = {str(effect.name): effect for effect in machine.effects()}
    friction, damping = (
        prices.price_effect(effects[name]) for name in ("viscous@bearing", "damping_gain@servo")
    )
    # A ratio of e to one.
    assert damping - friction == pytest.approx(1.0)
