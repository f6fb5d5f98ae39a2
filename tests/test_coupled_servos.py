"""Two servos of an arm, known by commands and angles alone: what MuJoCo hides in them is found."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import pytest

import rigtwin
from rigtwin.numerics.arrays import Array

ARM = """<mujoco model="arm"><compiler angle="radian"/>
<option timestep="0.0005" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.2" armature="0.02" {spring}/>
<inertial pos="0 0 -0.15" mass="{upper}" diaginertia="0.012 0.012 0.001"/>
<body name="fore" pos="0 0 -0.3"><joint name="elbow" axis="0 1 0" damping="0.1" armature="0.01"/>
<inertial pos="0 0 -0.12" mass="0.8" diaginertia="0.006 0.006 0.0005"/></body></body></worldbody>
<actuator><position name="m1" joint="shoulder" kp="{kp1}" kv="{kv1}" forcerange="-{f1} {f1}"/>
<position name="m2" joint="elbow" kp="{kp2}" kv="{kv2}" forcerange="-20 20"/></actuator></mujoco>"""
NOMINAL = {
    "spring": "",
    "upper": 1.2,
    "kp1": 80.0,
    "kv1": 5.0,
    "kp2": 40.0,
    "kv2": 2.0,
    "f1": 40.0,
}
PERIOD, TICKS, NOISE = 0.01, 640, 1e-4
Alter = Callable[[mujoco.MjModel, mujoco.MjData, Array], Array]
"""Function of model, data and commands that returns what the servos see; it may apply forces."""


@dataclass(frozen=True)
class Hidden:
    """What the arm has and its model lacks."""

    effects: Mapping[str, float]
    changes: Mapping[str, float | str] = field(default_factory=dict)
    alter: Alter = lambda model, data, command: command
    steps: bool = False
    reads: float = 0.0


def rub(model: mujoco.MjModel, data: mujoco.MjData, command: Array) -> Array:
    """Rub at the shoulder with a fifth of its servo's torque."""
    torque = 0.2 * abs(data.qfrc_actuator[0])
    data.qfrc_applied[0] = -torque * np.tanh(data.qvel[0] / 0.005)
    return command


def ignore(model: mujoco.MjModel, data: mujoco.MjData, command: Array) -> Array:
    """Ignore errors of the elbow below 0.02 rad."""
    error = command - data.qpos
    error[1] = np.sign(error[1]) * max(abs(error[1]) - 0.02, 0.0)
    return data.qpos + error


def misread(model: mujoco.MjModel, data: mujoco.MjData, command: Array) -> Array:
    """Read the elbow 0.25 rad too high within its loop."""
    return command - np.array([0.0, 0.25])


HIDDEN = {
    "limit": Hidden({"force_limit@m1": 2.2}, {"f1": 2.2}, steps=True),
    "gains": Hidden(
        {"gains@m1": 0.7, "gains@m2": 0.7}, {"kp1": 56.0, "kv1": 3.5, "kp2": 28.0, "kv2": 1.4}
    ),
    "load": Hidden({"load_friction@shoulder": 0.2}, alter=rub),
    "deadband": Hidden({"deadband@m2": 0.02}, alter=ignore),
    "spring": Hidden(
        {"stiffness@shoulder": 6.0, "offset@shoulder": -1.8},
        {"spring": 'stiffness="6" springref="0.3"'},
    ),
    "zero": Hidden({"offset@elbow_position": 0.25}, alter=misread, reads=0.25),
    "mass": Hidden({"mass@upper": 1.8}, {"upper": 1.8}),
}


def log(path: Path, hidden: Hidden, seed: int) -> Path:
    """Write the commands and angles of the arm over 12 s."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(TICKS)
    rates, phases = random.uniform(0.1, 1.2, (2, 5)), random.uniform(0.0, 6.28, (2, 5))
    waves = np.sin(2.0 * np.pi * rates[:, :, None] * time + phases[:, :, None])
    commands = np.array([0.32, 0.4])[:, None] * waves.sum(axis=1)
    if hidden.steps:
        commands = np.repeat(random.uniform(-0.8, 0.8, (2, TICKS // 80)), 80, axis=1)
    commands -= commands[:, :1]
    model = mujoco.MjModel.from_xml_string(ARM.format(**{**NOMINAL, **hidden.changes}))
    data, rows = mujoco.MjData(model), np.empty((TICKS, 5))
    for tick, now in enumerate(time):
        angles = data.qpos + NOISE * random.standard_normal(2)
        angles[1] += hidden.reads
        rows[tick] = [now, *commands[:, tick], *angles]
        for _ in range(round(PERIOD / model.opt.timestep)):
            data.ctrl[:] = hidden.alter(model, data, commands[:, tick].copy())
            mujoco.mj_step(model, data)
    names = "time,shoulder_cmd,elbow_cmd,shoulder_pos,elbow_pos"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.8g")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("hidden", HIDDEN.values(), ids=list(HIDDEN))
def test_what_two_servos_hide_is_found(tmp_path: Path, hidden: Hidden):
    model = tmp_path / "arm.xml"
    model.write_text(ARM.format(**NOMINAL))
    fitted, held_out = (log(tmp_path / f"{seed}.csv", hidden, seed) for seed in (1, 2))
    answer = rigtwin.diagnose(fitted, machine=model, held_out=held_out)
    named = {
        str(effect.name).replace("_actuator", ""): next(iter(effect.parameters.values())).value
        for effect in answer.effects
    }
    assert named == pytest.approx(dict(hidden.effects), rel=0.06), answer.sentence
    assert answer.verdict == "explained"
