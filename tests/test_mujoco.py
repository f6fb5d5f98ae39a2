"""Every effect of a joint, by the fast model and by MuJoCo itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigtwin.components import Effect, candidates, with_parameters
from rigtwin.description.machine import Machine
from rigtwin.models.joint import JointModel
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from tests.helpers.described import TOML, described
from tests.helpers.mujoco_joint import MujocoModel

PERIOD, STEPS = 1e-3, 20
TIME = np.arange(1000) * PERIOD
COMMAND = 20.0 * np.sin(2 * np.pi * 1.1 * TIME) + 12.0 * np.sin(2 * np.pi * 2.3 * TIME)
MOTION = 0.1 * np.sin(2 * np.pi * 0.9 * TIME) + 0.03 * np.sin(2 * np.pi * 2.7 * TIME)
FRICTION = {"coulomb": 4.0, "viscous": 6.0, "stiffness": 150.0}
TURNED = TOML.replace(
    "[components.drive]", '[components.rotor]\njoint = "axis"\ntype = "rotor"\n\n[components.drive]'
)
CARRIED = TURNED.replace(
    'moved_by = "drive"\nobserve = ["encoder"]', 'moved_by = "encoder"\nobserve = ["cell"]'
).replace("[[replays]]", '[components.cell]\nsensor = "cell"\n\n[[replays]]')
SIZES = {
    "coulomb": 7.0,
    "viscous": 15.0,
    "stiffness": 240.0,
    "slack": 0.02,
    "cubic_stiffness": 900.0,
    "stribeck": 3.0,
    "asymmetry": 3.0,
    "backlash": 0.01,
    "compliance": 2e-3,
    "mount": 2e-3,
    "offset": 3.0,
    "viscous_asymmetry": 6.0,
    "drag": 8.0,
    "relaxation": 0.03,
    "cogging": 3.0,
    "position_force": 3.0,
    "end_stops": 300.0,
    "load_friction": 0.3,
    "mass": 3.0,
    "armature": 0.8,
    "gain": 1.3,
    "gain_asymmetry": 0.5,
    "curvature": 0.5,
    "lag": 0.03,
    "delay": 0.02,
    "saturation": 14.0,
    "deadband": 3.0,
    "deadband_asymmetry": 6.0,
    "rate_limit": 120.0,
}
"""Each effect's magnitude; large, so that a law that is not there is seen."""
SHAPES = {
    "curvature": {"full_command": 20.0},
    "end_stops": {"stop_damping": 5.0, "stop_low": -0.03, "stop_high": 0.06},
    "slack": {"stiffness": 240.0},
    "cubic_stiffness": {"stiffness": 240.0},
}
"""Other parameters of an effect that has none at their nominal values."""


def models(machine: Machine, column: dict[str, dict[str, Array]]) -> tuple[JointModel, MujocoModel]:
    recording = RecordedTest(Path("bench"), machine.name, "", PERIOD, TIME, column, {})
    configuration = machine.configuration_of(recording)
    replay = machine.replays[0]
    return (
        JointModel(machine, replay, recording.inputs, configuration, STEPS),
        MujocoModel(machine, replay, recording.inputs, configuration, STEPS),
    )


def rubbed(machine: Machine):
    return with_parameters(machine.plant, "guide", FRICTION)


def with_effect(plant, effect: Effect, size: float):
    changes = {effect.kind.parameters[0]: size, **SHAPES.get(effect.kind.name, {})}
    return with_parameters(plant, effect.group, changes)


def mechanical(machine: Machine) -> list[Effect]:
    groups = ("guide", "mass", "rotor", "drive")
    known = [e for e in candidates(machine.plant) if e.searched and e.group in groups]
    # Play behind a motor takes a second body, which laws/test_play.py has.
    return [e for e in known if (e.group, e.kind.name) != ("drive", "backlash")]


def rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))


@pytest.mark.parametrize("sort", ["slide", pytest.param("pendulum", marks=pytest.mark.slow)])
def test_every_effect_of_a_pushed_joint_moves_it_as_in_mujoco(tmp_path, sort):
    machine = described(tmp_path, sort, TURNED)
    column = {"/command": {"force": COMMAND}, "/sensor": {"position": np.zeros_like(TIME)}}
    if sort == "pendulum":
        column["/command"]["force"] = 0.15 * COMMAND
    fast, reference = models(machine, column)
    scale = 0.15 if sort == "pendulum" else 1.0
    plain = with_parameters(machine.plant, "guide", {k: scale * v for k, v in FRICTION.items()})
    assert {e.kind.name for e in mechanical(machine)} <= set(SIZES), "every kind has a size here"
    unmoved = reference.move(plain)[0]
    for effect in mechanical(machine):
        size = SIZES[effect.kind.name]
        if sort == "pendulum" and effect.quantities()[effect.kind.parameters[0]].unit in (
            "N",
            "Ns/m",
            "N/m",
            "Ns^2/m^2",
        ):
            size *= scale
        if sort == "pendulum" and effect.kind.name in (
            "saturation",
            "deadband",
            "deadband_asymmetry",
            "rate_limit",
        ):
            size *= scale
        if sort == "pendulum" and effect.kind.name in ("mass", "armature"):
            size = 1.5 * machine.plant.mass.mass
        plant = with_effect(plain, effect, size)
        ours, theirs = fast.move(plant)[0], reference.move(plant)[0]
        felt = rms(theirs - unmoved)
        assert felt > 1e-3 * rms(unmoved), f"{effect.name} is not felt"
        apart = rms(ours - theirs)
        assert apart < max(0.03 * felt, 0.004 * rms(theirs)), (
            f"{effect.name}: {apart:.3g} of {felt:.3g}"
        )


def test_every_effect_of_a_carried_joint_takes_the_force_that_mujoco_says(tmp_path):
    (tmp_path / "x").mkdir()
    machine = described(tmp_path / "x", "slide", CARRIED)
    column = {"/sensor": {"position": MOTION, "cell": np.zeros_like(TIME)}}
    fast, reference = models(machine, column)
    plain = rubbed(machine)
    unmoved = reference.move(plain)[2]
    for effect in mechanical(machine):
        if effect.group == "drive":
            continue
        plant = with_effect(plain, effect, SIZES[effect.kind.name])
        ours, theirs = fast.move(plant)[2], reference.move(plant)[2]
        felt = rms(theirs - unmoved)
        assert felt > 1e-3 * rms(unmoved), f"{effect.name} is not felt"
        apart = rms(ours - theirs)
        assert apart < 0.02 * felt, f"{effect.name}: {apart:.3g} of {felt:.3g}"
