"""Run time of a diagnosis of coupled joints, over their number and the length of the recording.

python -m benchmarks.arms

The joints of the arms are in series with crossed axes, and carry an undeclared payload. Every joint
has a guide, a rotor, an encoder with an unknown offset and a current sensor with an unknown gain.
The search cannot be split into parts, which is the most expensive case.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

import rigtwin
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

PERIOD = 1e-3
LENGTHS, MASSES = (0.0, 0.4, 0.35, 0.1, 0.1, 0.08), (6.0, 5.0, 3.5, 1.5, 1.0, 0.6)
"""Distance from one joint to the next, m, and mass of the links, kg."""
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "1 0 0")
ROTORS = (0.36, 0.36, 0.1, 0.03, 0.04, 0.01)
"""Rotor inertia reflected through the gears, kg m²."""
PAYLOAD, PLACE = 0.3, (0.02, 0.0, -0.06)
"""Mass of the payload, kg, and its position in the frame of the last link, m."""
ANGLE_NOISE, TORQUE_NOISE = 1e-5, 0.01
"""Noise of the angles, rad rms, and of the torques, as a share of their standard deviation."""
COULOMB, VISCOUS = 2.0, 1.0
"""Friction at a rotor of 0.1 kg m², Nm and Nms/rad; it scales with the root of the inertia."""
SWEPT_JOINTS, SWEPT_SECONDS = (3, 4, 5, 6), (5.0, 10.0, 20.0)


def friction(joint: int) -> tuple[float, float]:
    """Return Coulomb, Nm, and viscous friction, Nms/rad, of a joint."""
    share = (ROTORS[joint] / 0.1) ** 0.5
    return COULOMB * share, VISCOUS * share


def write_mjcf(joints: int, loaded: bool) -> str:
    """Return the MJCF of an arm, with or without its payload."""
    bodies = sensors = ""
    for joint in range(joints):
        mass, length = MASSES[joint], max(LENGTHS[joint], 0.1)
        inertia = mass * length**2 / 12.0
        bodies += (
            f'<body name="link_{joint}" pos="0 0 {-LENGTHS[joint]}">'
            f'<joint name="joint_{joint}" axis="{AXES[joint]}" armature="{ROTORS[joint]}"/>'
            f'<inertial mass="{mass}" pos="0.01 0.02 {-0.4 * length}" '
            f'diaginertia="{inertia} {inertia} {0.5 * inertia}"/>'
        )
        sensors += (
            f'<jointpos name="angle_{joint}" joint="joint_{joint}"/>'
            f'<jointactuatorfrc name="torque_{joint}" joint="joint_{joint}"/>'
        )
    if loaded:
        place = " ".join(str(coordinate) for coordinate in PLACE)
        bodies += (
            f'<body pos="{place}"><inertial mass="{PAYLOAD}" pos="0 0 0" '
            'diaginertia="1e-9 1e-9 1e-9"/></body>'
        )
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{bodies}{"</body>" * joints}</worldbody>'
        f"<sensor>{sensors}</sensor></mujoco>"
    )


def describe(joints: int, folder: Path) -> rigtwin.Machine:
    """Return the described machine: an arm without payload."""
    (folder / "arm.xml").write_text(write_mjcf(joints, loaded=False))
    lines = ["[machine]", 'name = "arm"', 'model = "arm.xml"', 'nominal = "known"']
    for joint in range(joints):
        coulomb, viscous = friction(joint)
        lines += [
            f'[components.joint_{joint}]\njoint = "joint_{joint}"',
            f"coulomb = {coulomb}\nviscous = {viscous}",
            f'[components.rotor_{joint}]\njoint = "joint_{joint}"\ntype = "rotor"',
            f'[components.angle_{joint}]\nsensor = "angle_{joint}"\neffects = ["offset"]',
            f'[components.torque_{joint}]\nsensor = "torque_{joint}"\neffects = ["gain"]',
        ]
    angles, torques = ([f"{word}_{n}" for n in range(joints)] for word in ("angle", "torque"))
    lines += [
        f'[components.tool]\nbody = "link_{joints - 1}"\ntype = "body"',
        f"[[replays]]\nmoved_by = {angles}\nobserve = {torques}\nband = 30.0",
    ]
    (folder / "arm.toml").write_text("\n".join(lines))
    return rigtwin.machine(folder / "arm.toml")


def move(joints: int, seconds: float) -> tuple[Array, Array, Array]:
    """Return angles, rates and accelerations, each of shape (joints, ticks): sums of sines."""
    random = np.random.default_rng([joints, 1])
    t = np.arange(round(seconds / PERIOD)) * PERIOD
    rates = 2.0 * np.pi * np.exp(random.uniform(np.log(0.15), np.log(1.5), (joints, 5, 1)))
    sizes = random.uniform(0.5, 1.0, (joints, 5, 1)) / rates**0.8
    sizes *= 0.8 / np.sum(sizes, axis=1, keepdims=True)
    phases = rates * t + random.uniform(-np.pi, np.pi, (joints, 5, 1))
    return (
        np.sum(sizes * np.sin(phases), axis=1),
        np.sum(sizes * rates * np.cos(phases), axis=1),
        -np.sum(sizes * rates**2 * np.sin(phases), axis=1),
    )


def record(joints: int, seconds: float) -> RecordedTest:
    """Record a test of the loaded arm."""
    model = mujoco.MjModel.from_xml_string(write_mjcf(joints, loaded=True))
    data, travel = mujoco.MjData(model), move(joints, seconds)
    torque = np.empty_like(travel[0])
    for tick in range(torque.shape[1]):
        data.qpos[:], data.qvel[:], data.qacc[:] = (each[:, tick] for each in travel)
        # Inverse dynamics: the torque that makes the arm follow the motion exactly.
        mujoco.mj_inverse(model, data)
        torque[:, tick] = data.qfrc_inverse
    random, sensors = np.random.default_rng([joints, 2]), {}
    for joint in range(joints):
        coulomb, viscous = friction(joint)
        motor_torque = (
            torque[joint] + coulomb * np.sign(travel[1][joint]) + viscous * travel[1][joint]
        )
        noise = random.standard_normal((2, len(motor_torque)))
        sensors[f"angle_{joint}"] = travel[0][joint] + ANGLE_NOISE * noise[0]
        sensors[f"torque_{joint}"] = motor_torque + TORQUE_NOISE * np.std(motor_torque) * noise[1]
    ticks = np.arange(torque.shape[1]) * PERIOD
    return RecordedTest(Path("arm"), "arm", "", PERIOD, ticks, {"/sensor": sensors}, {})


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--joints", type=int, nargs="+", default=SWEPT_JOINTS)
    parser.add_argument("--seconds", type=float, nargs="+", default=SWEPT_SECONDS)
    parsed = parser.parse_args()
    if not all(2 < joints <= len(MASSES) for joints in parsed.joints):
        parser.error(f"--joints: expected 3 to {len(MASSES)}")
    if not all(seconds >= 3.0 for seconds in parsed.seconds):
        parser.error("--seconds: expected at least 3")
    print("joints  recording s  wall s  processor s  said")
    for joints in parsed.joints:
        for seconds in parsed.seconds:
            with tempfile.TemporaryDirectory() as folder:
                machine, data = describe(joints, Path(folder)), record(joints, seconds)
                began, worked = time.perf_counter(), time.process_time()
                answer = rigtwin.diagnose(data, machine=machine)
                wall, processor = time.perf_counter() - began, time.process_time() - worked
            said = ", ".join(
                f"{effect.name} {next(iter(effect.parameters.values())).value:.4g}"
                for effect in answer.effects
            )
            print(
                f"{joints:6d}  {seconds:11g}  {wall:6.1f}  {processor:11.1f}  "
                f"{said or answer.verdict}",
                flush=True,
            )


if __name__ == "__main__":
    main()
