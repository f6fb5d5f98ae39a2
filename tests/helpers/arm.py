"""A planar arm of two joints and a belt between them: its description, and its torques by equations
written by hand, without MuJoCo."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigtwin.description.document import load
from rigtwin.description.machine import Machine
from rigtwin.recording import RecordedTest

PERIOD = 2e-3
LENGTH, MASSES, CENTRES, INERTIAS = 0.4, (2.0, 1.2), (0.2, 0.15), (0.03, 0.012)
"""m of link 1; kg, m from the joint, kg m² about the centre of mass, of both links."""
ROTORS, BELT = (0.05, 0.02), 0.04
"""kg m² at each joint, and on the sum of both."""
GRAVITY = 9.81
MJCF = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 -1 0" armature="0.05"/>
<inertial mass="2" pos="0 0 -0.2" diaginertia="0.03 0.03 0.001"/>
<body name="lower" pos="0 0 -0.4"><joint name="elbow" axis="0 -1 0" armature="0.02" damping="0.1"/>
<inertial mass="1.2" pos="0 0 -0.15" diaginertia="0.012 0.012 0.001"/></body></body></worldbody>
<tendon><fixed name="belt" armature="0.04"><joint joint="shoulder" coef="1"/>
<joint joint="elbow" coef="1"/></fixed></tendon>
<sensor><jointpos name="angle_1" joint="shoulder"/><jointpos name="angle_2" joint="elbow"/>
<jointactuatorfrc name="torque_1" joint="shoulder"/>
<jointactuatorfrc name="torque_2" joint="elbow"/></sensor></mujoco>
"""
LINK = """<link name="{name}"><inertial><origin xyz="0 0 {centre}"/><mass value="{mass}"/>
<inertia ixx="{about}" iyy="{about}" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{joint}" type="continuous"><parent link="{parent}"/><child link="{name}"/>
<origin xyz="0 0 {place}"/><axis xyz="0 -1 0"/></joint>"""
URDF = (
    '<robot name="arm"><link name="stand"/>'
    + LINK.format(
        name="upper", joint="shoulder", parent="stand", place=0, centre=-0.2, mass=2, about=0.03
    )
    + LINK.format(
        name="lower", joint="elbow", parent="upper", place=-0.4, centre=-0.15, mass=1.2, about=0.012
    )
    + '<link name="tool"/><joint name="flange" type="fixed"><parent link="lower"/>'
    '<child link="tool"/></joint></robot>'
)
"""The same arm, without rotors, belt and damper, and with a tool that has no mass."""
TOML = """
[machine]
name = "arm"
model = "arm.xml"

[components.shoulder]
joint = "shoulder"
effects = ["coulomb", "viscous", "offset"]

[components.elbow]
joint = "elbow"
effects = ["coulomb", "viscous", "offset"]

[components.angle_1]
sensor = "angle_1"
effects = []

[components.angle_2]
sensor = "angle_2"
effects = []

[components.torque_1]
sensor = "torque_1"
effects = []

[components.torque_2]
sensor = "torque_2"
effects = []

[[replays]]
moved_by = ["angle_1", "angle_2"]
observe = ["torque_1", "torque_2"]
band = 25.0
"""
COUPLED = """
[components.belt]
tendon = "belt"
effects = ["coulomb", "viscous"]
"""


def described_arm(folder: Path, toml: str = TOML) -> Machine:
    """The machine of a description written there."""
    (folder / "arm.xml").write_text(MJCF)
    (folder / "arm.toml").write_text(toml)
    return load(folder / "arm.toml")


def motion(seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, rates and accelerations of a test, shape (2, ticks) each."""
    time = np.arange(round(seconds / PERIOD)) * PERIOD
    position, rate, acceleration = (np.zeros((2, len(time))) for _ in range(3))
    for joint, waves in enumerate((((0.9, 0.31), (0.25, 1.13)), ((0.8, 0.47), (0.3, 0.89)))):
        for size, frequency in waves:
            w = 2.0 * np.pi * frequency
            position[joint] += size * np.sin(w * time)
            rate[joint] += size * w * np.cos(w * time)
            acceleration[joint] -= size * w**2 * np.sin(w * time)
    return position, rate, acceleration


def torques(position: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Of the arm without friction but the elbow's 0.1 Nms/rad, by Lagrange's equations, shape (2,
    ticks)."""
    (m1, m2), (r1, r2), (i1, i2) = MASSES, CENTRES, INERTIAS
    (q1, q2), (v1, v2), (a1, a2) = position, rate, acceleration
    coupling = m2 * LENGTH * r2
    outer = i2 + m2 * r2**2
    h11 = i1 + m1 * r1**2 + m2 * LENGTH**2 + outer + 2.0 * coupling * np.cos(q2)
    h12 = outer + coupling * np.cos(q2)
    weight = GRAVITY * m2 * r2 * np.sin(q1 + q2)
    first = (h11 + ROTORS[0]) * a1 + h12 * a2 - coupling * np.sin(q2) * (2.0 * v1 + v2) * v2
    first += GRAVITY * (m1 * r1 + m2 * LENGTH) * np.sin(q1) + weight + BELT * (a1 + a2)
    second = h12 * a1 + (outer + ROTORS[1]) * a2 + coupling * np.sin(q2) * v1**2
    second += weight + BELT * (a1 + a2) + 0.1 * v2
    return np.stack([first, second])


def recording(position: np.ndarray, torque: np.ndarray, noise: tuple[float, float]) -> RecordedTest:
    """Of the arm. noise: white, rms, of the angles, rad, and of the torques, Nm."""
    random = np.random.default_rng(5)
    ticks = position.shape[1]
    sensors = {
        f"{name}_{joint + 1}": signal[joint] + level * random.standard_normal(ticks)
        for name, signal, level in (("angle", position, noise[0]), ("torque", torque, noise[1]))
        for joint in range(2)
    }
    time = np.arange(ticks) * PERIOD
    return RecordedTest(Path("arm"), "arm", "", PERIOD, time, {"/sensor": sensors}, {})
