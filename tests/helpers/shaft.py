"""A kind of machine that the package does not know: a shaft with a torsional spring.

Everything a new kind needs stands in this one file: its model, its physics and its description.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import cont2discrete, dlsim

from rigtwin.components import ForceActuator, Guide, Mass, PositionSensor
from rigtwin.components.plant import Plant
from rigtwin.components.scales import Motion
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf
from rigtwin.joints.physics import IndependentJoints
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs

TYPES = {"disc": Mass, "shaft": Guide, "motor": ForceActuator, "encoder": PositionSensor}
MJCF = """<mujoco model="shaft"><option integrator="RK4" gravity="0 0 0"/>
<worldbody><light pos="0 0 2"/><body name="disc">
<joint name="shaft" type="hinge" axis="0 0 1" stiffness="8" damping="0.05" range="-1 1"/>
<geom type="cylinder" size="0.15 0.02" mass="4"/></body></worldbody>
<actuator><motor name="motor" joint="shaft"/></actuator>
<sensor><jointpos name="encoder" joint="shaft"/></sensor></mujoco>
"""
TOML = """
[machine]
name = "shaft"
model = "shaft.xml"

[components.disc]
body = "disc"
effects = ["mass"]

[components.shaft]
joint = "shaft"
effects = ["viscous", "stiffness"]

[components.motor]
actuator = "motor"
command = "torque"
unit = "Nm"
effects = []

[components.encoder]
sensor = "encoder"
channel = "angle"
white = 1e-5
effects = []

[[replays]]
moved_by = "motor"
observe = ["encoder"]

[limits]
motor = [-5.0, 5.0]
encoder = [-1.0, 1.0]

[experiments.shake]
summary = "two tones"
duration = 4.0
period = 1e-3
[experiments.shake.demands]
torque = "0.8 * sin(7 * time) + 0.4 * sin(17 * time)"
"""
CARD = """
[card]
enable = "port0/line0"
device = "Dev1"
timing = "hardware"
[plausible]
stuck = 0
[inputs.encoder]
line = "ai0"
unit = "rad"
scale = 0.2
sign_checked = false
[outputs.motor]
line = "ao0"
unit = "Nm"
scale = 1.0
sign_checked = false
"""


class ShaftModel(Model[Plant]):
    """J·θ″ + d·θ′ + k·θ = τ under a held torque, by its exact discretisation."""

    def __init__(self, inputs: Inputs, inertia: float) -> None:
        self._inputs, self._inertia = inputs, inertia

    def _move(self, plant: Any) -> Array:
        inertia, shaft = plant.disc.mass, plant.shaft
        matrices = (
            np.array([[0.0, 1.0], [-shaft.stiffness / inertia, -shaft.viscous / inertia]]),
            np.array([[0.0], [1.0 / inertia]]),
            np.eye(2),
            np.zeros((2, 1)),
        )
        system = cont2discrete(matrices, self._inputs.period)
        torque = self._inputs.column("/command", "torque")
        start = [self._inputs.column("/sensor", "angle")[0], 0.0]
        return dlsim(system, torque, x0=start)[1].T

    def predict_true(self, plant: Plant) -> Array:
        return self._move(plant)[:1]

    def predict(self, plant: Any) -> Array:
        return apply_sensor(plant.encoder, self._move(plant)[0], self._inputs.period)[np.newaxis]

    def motion(self, component: str, plant: Plant) -> Motion:
        angle, rate = self._move(plant)
        return Motion(angle, rate, self._inputs.column("/command", "torque"))


class Shaft(IndependentJoints):
    """A disc on a shaft, turned by a motor."""

    name = "shaft"
    title = "a disc on an elastic shaft"

    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        return dict(types) == TYPES

    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> ShaftModel:
        return ShaftModel(inputs, machine.replays[0].joint.inertia)


def write_shaft(folder: Path) -> Path:
    """Write the description into a folder and return its path."""
    (folder / "shaft.xml").write_text(MJCF)
    (folder / "shaft.toml").write_text(TOML)
    return folder / "shaft.toml"
