"""Models that strangers made: four of dm_control's suite, described as docs/machines.md says, run
by plain MuJoCo with something changed in the model itself, and diagnosed."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.diagnosis.stops import find_stops

SPEC = find_spec("dm_control")
assert SPEC is not None
assert SPEC.origin is not None
SUITE = Path(SPEC.origin).parent / "suite"
PERIOD, DURATION, FINE = 4e-3, 4.0, 8


@dataclass(frozen=True)
class Stranger:
    """toml: its description; joints: that are measured; start: positions of the coordinates;
    command: what moves it at a time, shape (actuators,); noise: of the encoders."""

    toml: str
    joints: tuple[str, ...]
    start: tuple[float, ...]
    command: Callable[[float], tuple[float, ...]]
    noise: float


CARTPOLE = Stranger(
    """
[components]
rail = { joint = "slider", effects = ["coulomb", "viscous", "asymmetry", "stiffness"] }
hinge = { joint = "hinge_1", effects = ["coulomb", "viscous"] }
drive = { actuator = "slide", command = "slide", unit = "1", effects = ["gain", "delay", "lag"] }
[[replays]]
free = ["slider", "hinge_1"]
moved_by = ["drive"]
observe = ["slider_position", "hinge_1_position"]
""",
    ("slider", "hinge_1"),
    (0.0, np.pi),
    lambda t: (0.2 * np.cos(2.0 * t) + 0.3 * np.cos(5.3 * t),),
    1e-4,
)
ACROBOT = Stranger(
    """
[components]
shoulder = { joint = "shoulder", effects = ["coulomb", "viscous", "stiffness"] }
elbow = { joint = "elbow", effects = ["coulomb", "viscous", "stiffness"] }
motor = { actuator = "elbow", command = "elbow", unit = "1", effects = ["gain", "delay"] }
[[replays]]
free = ["shoulder", "elbow"]
moved_by = ["motor"]
observe = ["shoulder_position", "elbow_position"]
""",
    ("shoulder", "elbow"),
    (np.pi, 0.0),
    lambda t: (0.6 * np.sin(2.4 * t) + 0.4 * np.sin(5.1 * t),),
    2e-4,
)
POINT_MASS = Stranger(
    """
[components]
x = { joint = "root_x", effects = ["coulomb", "viscous", "stiffness"] }
y = { joint = "root_y", effects = ["coulomb", "viscous", "stiffness"] }
pull_x = { actuator = "t1", command = "t1", unit = "1", effects = ["gain", "delay"] }
pull_y = { actuator = "t2", command = "t2", unit = "1", effects = ["gain", "delay"] }
[[replays]]
free = ["root_x", "root_y"]
moved_by = ["pull_x", "pull_y"]
observe = ["root_x_position", "root_y_position"]
""",
    ("root_x", "root_y"),
    (0.0, 0.0),
    lambda t: (0.6 * np.sin(1.9 * t) + 0.3 * np.sin(6.0 * t), 0.7 * np.sin(2.7 * t)),
    2e-5,
)
PENDULUM = Stranger(
    """
[components]
hinge = { joint = "hinge", effects = ["coulomb", "viscous", "stiffness"] }
motor = { actuator = "torque", command = "torque", unit = "1", effects = ["gain", "delay"] }
[[replays]]
free = ["hinge"]
moved_by = ["motor"]
observe = ["hinge_position"]
""",
    ("hinge",),
    (0.9 * np.pi,),
    lambda t: (0.8 * np.sin(2.1 * t) + 0.5 * np.sin(3.7 * t),),
    1e-4,
)
"""Nearly upright; its command is more than its actuator takes, at times."""
STRANGERS = {
    "cartpole": CARTPOLE,
    "acrobot": ACROBOT,
    "point_mass": POINT_MASS,
    "pendulum": PENDULUM,
}


def described(name: str, folder: Path) -> Path:
    """The description of a model, its positions measured."""
    stranger = STRANGERS[name]
    sensors = "".join(
        f'[components.{joint}_position]\njoint = "{joint}"\ntype = "position sensor"\n'
        f"white = {stranger.noise}\neffects = []\n"
        for joint in stranger.joints
    )
    toml, _, replay = stranger.toml.partition("[[replays]]")
    path = folder / f"{name}.toml"
    path.write_text(
        f'[machine]\nname = "{name}"\nmodel = "{SUITE / name}.xml"\nnominal = "known"\n'
        f'{toml}{sensors}[[replays]]\nname = "{name}"\n{replay}'
    )
    return path


def log(name: str, folder: Path, change: Callable[[mujoco.MjModel], None], late: int = 0) -> Path:
    """What a logger writes of a run of the model, changed, in plain MuJoCo; late: ticks by which
    commands arrive."""
    stranger, random = STRANGERS[name], np.random.default_rng(7)
    model = mujoco.MjModel.from_xml_path(str(SUITE / f"{name}.xml"))
    change(model)
    model.opt.timestep = PERIOD / FINE
    data = mujoco.MjData(model)
    data.qpos[:] = stranger.start
    path = folder / "log.csv"
    commands = [stranger.command(tick * PERIOD) for tick in range(round(DURATION / PERIOD))]
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        actuators = [model.actuator(n).name for n in range(model.nu)]
        rows.writerow(["time", *stranger.joints, *(f"u_{each}" for each in actuators)])
        for tick, command in enumerate(commands):
            seen = data.qpos + stranger.noise * random.standard_normal(model.nq)
            rows.writerow([tick * PERIOD, *seen, *command])
            data.ctrl[:] = commands[max(tick - late, 0)]
            mujoco.mj_step(model, data, FINE)
    return path


def imported(name: str, folder: Path, table: Path) -> rigtwin.Recording:
    """The log as a recording."""
    stranger = STRANGERS[name]
    columns = table.read_text().splitlines()[0].split(",")[1 + len(stranger.joints) :]
    actuators = [column.removeprefix("u_") for column in columns]
    lines = [
        f'machine = "{name}"',
        "[time]",
        'column = "time"',
        "[channels]",
        *(f'"/sensor.{joint}_position" = {{ column = "{joint}" }}' for joint in stranger.joints),
        *(f'"/command.{each}" = {{ column = "u_{each}" }}' for each in actuators),
    ]
    (folder / "map.toml").write_text("\n".join(lines))
    return rigtwin.import_data(table, folder / "map.toml", folder / "log.mcap")


def rub(joint: str, force: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        model.dof_frictionloss[model.joint(joint).dofadr[0]] = force

    return change


def damp(joint: str, damping: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        model.dof_damping[model.joint(joint).dofadr[0]] = damping

    return change


def weaken(actuator: str, share: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        model.actuator(actuator).gear[0] *= share

    return change


def spring(joint: str, stiffness: float) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        model.jnt_stiffness[model.joint(joint).id] = stiffness

    return change


def both(*changes: Callable[[mujoco.MjModel], None]) -> Callable[[mujoco.MjModel], None]:
    def change(model: mujoco.MjModel) -> None:
        for each in changes:
            each(model)

    return change


def leave(_: mujoco.MjModel) -> None:
    """Nothing is changed."""


HIDDEN = [
    ("cartpole", leave, 0, {}),
    (
        "cartpole",
        both(weaken("slide", 0.9), damp("slider", 1.0)),
        0,
        {"viscous@rail": 1.0, "gain@drive": 0.9},
    ),
    ("acrobot", damp("shoulder", 0.15), 0, {"viscous@shoulder": 0.15}),
    ("acrobot", leave, 0, {}),
    ("point_mass", spring("root_y", 0.4), 0, {"stiffness@y": 0.4}),
    ("point_mass", weaken("t1", 1.15), 0, {"gain@pull_x": 1.15}),
    ("point_mass", leave, 0, {}),
    ("pendulum", weaken("torque", 0.8), 0, {"gain@motor": 0.8}),
    ("pendulum", leave, 0, {}),
]
"""Model, what is changed, ticks by which commands are late, the effects that it is, and their
sizes."""


def test_a_stop_that_nothing_predicts_is_said(tmp_path: Path):
    def push(model: mujoco.MjModel) -> None:
        model.opt.gravity[:] = (1.0, 0.0, -9.81)

    record = imported("cartpole", tmp_path, log("cartpole", tmp_path, push))
    machine = rigtwin.machine(described("cartpole", tmp_path))
    (said,) = find_stops(machine, [record])
    assert "slider_position is at 1." in said
    assert "joint slider ends at 1.8" in said
    still = imported("cartpole", tmp_path, log("cartpole", tmp_path, leave))
    assert find_stops(machine, [still]) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "change", "late", "effects"), HIDDEN)
def test_what_is_changed_in_a_strangers_model_is_found(
    tmp_path: Path,
    name: str,
    change: Callable[[mujoco.MjModel], None],
    late: int,
    effects: dict[str, float],
):
    record = imported(name, tmp_path, log(name, tmp_path, change, late))
    answer = rigtwin.diagnose(record, machine=described(name, tmp_path))
    if not effects:
        assert answer.verdict == "no gap", answer.sentence
        return
    found = {str(each.name): next(iter(each.parameters.values())).value for each in answer.effects}
    assert found == pytest.approx(effects, rel=0.03), answer.sentence
    assert answer.verdict in ("explained", "partly explained")
