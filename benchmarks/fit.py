"""`rigtwin.fit` beside `mujoco.sysid`: the same parameters, the same data, one run.

python -m benchmarks.fit [--data FOLDER] [--rounds N] [--out TABLE.md]

Three machines: an arm of two joints moved as measured (the referee's own equations made the data),
an arm of two joints that its servos move freely (equations of this file made the data), and EMPS, a
real drive, where FOLDER holds its data (docs/tutorial.md says where they are). Each tool fits once
unmeasured, the toolbox with both of its optimisers, of which the faster takes part; then they take
turns. Imports, reading the data and posing the problem are not timed.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

import rigtwin
from benchmarks.toolbox import (
    InverseProblem,
    Optimizer,
    Residual,
    RolloutTest,
    ToolboxParameter,
    find_missing,
    fit_toolbox,
    harden_friction,
    list_stribeck,
    measure_inverse,
    pose_rollout,
    residual_error,
    set_constant_force,
    set_joint,
    set_mass,
)
from referee.arm_cases import MACHINES, ArmCase
from referee.arm_recordings import build_arm, record_arm
from rigtwin.components.library import find
from rigtwin.description.catalogue import SHIPPED
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.fit import with_values
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import RecordedTest

GOALS = {"emps": 0.2, "free": 0.5, "moved": 0.1}
"""Largest ratio of the times that is aimed at."""
FREE_ARM = """
<mujoco model="free_arm">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="upper_arm">
      <joint name="shoulder" axis="0 -1 0" armature="0.12" damping="0.8"/>
      <inertial pos="0 0 -0.18" mass="3.2" diaginertia="0.04 0.04 0.002"/>
      <body name="forearm" pos="0 0 -0.4">
        <joint name="elbow" axis="0 -1 0" armature="0.05" damping="0.3"/>
        <inertial pos="0 0 -0.13" mass="1.8" diaginertia="0.016 0.016 0.001"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="servo_1" joint="shoulder" kp="120" kv="6"/>
    <position name="servo_2" joint="elbow" kp="50" kv="2"/>
  </actuator>
  <sensor>
    <jointpos name="angle_1" joint="shoulder"/>
    <jointpos name="angle_2" joint="elbow"/>
  </sensor>
</mujoco>
"""
EMPS = """
<mujoco model="emps">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="carriage">
      <inertial pos="0 0 0" mass="95.1" diaginertia="1 1 1"/>
      <joint name="carriage" type="slide" axis="1 0 0" damping="203.5"/>
    </body>
  </worldbody>
</mujoco>
"""
BAND = 25.0
"""Band in which the toolbox compares forces of joints that move as measured, Hz."""
TICK, SECONDS, STEP = 2e-3, 10.0, 2e-5
"""Period and length of a test of the free arm, and integration step of its data, s."""
GRAVITY, SLOW = 9.81, 1e-3
"""Gravity, m/s², and the speed below which the free arm's dry friction fades, rad/s."""
NOISE = 5e-5
"""White noise of the free arm's encoders, rad."""
HIDDEN = {
    "coulomb@shoulder": 0.9,
    "viscous@shoulder": 1.1,
    "coulomb@elbow": 0.4,
    "viscous@elbow": 0.42,
    "mass@forearm": 2.1,
}
"""True values of the free arm."""


@dataclass(frozen=True)
class Contest:
    """One problem for both tools.

    Attributes
    ----------
    name, title : str
        Word of `GOALS`, and what the machine is.
    machine : Machine
        Machine of the recordings.
    fitted, held_out : Recording
        Recording that is fitted, and one that judges.
    parameters : tuple of ToolboxParameter
        Parameters of both tools.
    residual, residual_held_out : callable
        The toolbox's residual of both recordings.
    truth : mapping
        True values by effect, where they are known.
    """

    name: str
    title: str
    machine: rigtwin.Machine
    fitted: RecordedTest
    held_out: RecordedTest
    parameters: tuple[ToolboxParameter, ...]
    residual: Residual
    residual_held_out: Residual
    truth: Mapping[str, float] = field(default_factory=dict)


def _recording(
    machine: rigtwin.Machine, columns: Mapping[str, Mapping[str, Array]]
) -> RecordedTest:
    ticks = len(next(iter(next(iter(columns.values())).values())))
    times = np.arange(ticks) * TICK
    tables = {topic: dict(fields) for topic, fields in columns.items()}
    return RecordedTest(Path("test"), machine.name, "", TICK, times, tables, {})


def friction_parameters(
    joints: Sequence[str], nominal: Mapping[str, float], most: Mapping[str, float]
) -> list[ToolboxParameter]:
    """Return Coulomb and viscous friction of joints; `most` is the upper bound by effect."""
    attributes = {"coulomb": "frictionloss", "viscous": "damping"}
    return [
        ToolboxParameter(
            name := f"{kind}@{joint}",
            nominal.get(name, 0.0),
            0.0,
            most[name],
            set_joint(joint, attribute),
        )
        for joint in joints
        for kind, attribute in attributes.items()
    ]


def pose_moved() -> Contest:
    """Return the referee's planar arm of two joints, moved as measured."""
    case = ArmCase("arm_2", "pair", (("coulomb", 0), ("viscous", 1), ("rotor", 0)), 0, 44)
    machine = rigtwin.machine(MACHINES["arm_2"])
    tests = [record_arm(case, again) for again in (0, 1)]
    recordings = [_recording(machine, test.columns) for test in tests]
    nominal = {"coulomb@shoulder": 1.8, "viscous@shoulder": 1.2}
    nominal |= {"coulomb@elbow": 0.9, "viscous@elbow": 0.5}
    most = {name: 10.0 * value for name, value in nominal.items()}
    parameters = friction_parameters(("shoulder", "elbow"), nominal, most)
    for number, (joint, inertia) in enumerate((("shoulder", 0.12), ("elbow", 0.05)), start=1):
        parameters.append(
            ToolboxParameter(
                f"armature@rotor_{number}", inertia, 0.0, 1.0, set_joint(joint, "armature")
            )
        )
    spec = mujoco.MjSpec.from_file(str(Path(MACHINES["arm_2"]).with_suffix(".xml")))
    harden_friction(spec)

    def pose(recording: RecordedTest) -> Residual:
        sensors = recording.columns["/sensor"]
        positions, forces = (
            np.stack([sensors[f"{word}_{number}"] for number in (1, 2)])
            for word in ("angle", "torque")
        )
        test = measure_inverse(positions, forces, TICK, BAND)
        return InverseProblem(spec, (test,), added=(list_stribeck(machine, test.motion),))

    arm = build_arm(case).arm
    truth = {}
    for number, joint in enumerate(("shoulder", "elbow")):
        drag = arm.resistances[number]
        truth |= {f"coulomb@{joint}": drag.slip, f"viscous@{joint}": drag.viscous}
        truth |= {f"armature@rotor_{number + 1}": drag.rotor}
    return Contest(
        "moved",
        "arm of two joints, moved as measured, 12 s at 500 Hz",
        machine,
        recordings[0],
        recordings[1],
        tuple(parameters),
        pose(recordings[0]),
        pose(recordings[1]),
        truth,
    )


@kernel
def swing_free_arm(commands: Array, out: Array, parameters: Array, step: float) -> None:
    """Integrate the free arm by its own equations, with Coulomb friction within 1 mrad/s of rest.

    With the angles q from hanging down, M(q) q'' + c(q, q') + g(q) = τ:

        M11 = I1 + m1 c1² + I2 + m2 (l² + c2² + 2 l c2 cos q2) + J1
        M12 = I2 + m2 (c2² + l c2 cos q2),        M22 = I2 + m2 c2² + J2
        c1 = -h (2 w1 w2 + w2²),  c2 = h w1²,     h = m2 l c2 sin q2

    `out` receives the angles at each tick, shape (ticks, 2); `parameters` are Coulomb and viscous
    friction of both joints, Nm and Nms/rad, and the forearm's mass, kg, with which its inertia
    scales.
    """
    dry1, viscous1, dry2, viscous2, m2 = parameters
    m1, reach1, i1, j1, length = 3.2, 0.18, 0.04, 0.12, 0.4
    reach2, i2, j2 = 0.13, 0.016 * m2 / 1.8, 0.05
    q1, q2, w1, w2 = 0.0, 0.0, 0.0, 0.0
    steps = round(TICK / step)
    for tick in range(len(commands)):
        out[tick, 0], out[tick, 1] = q1, q2
        for _ in range(steps):
            torque1 = 120.0 * (commands[tick, 0] - q1) - (6.0 + viscous1) * w1
            torque2 = 50.0 * (commands[tick, 1] - q2) - (2.0 + viscous2) * w2
            h = m2 * length * reach2 * np.sin(q2)
            weight = m2 * reach2 * GRAVITY * np.sin(q1 + q2)
            torque1 += h * (2.0 * w1 * w2 + w2 * w2) - weight
            torque1 -= (m1 * reach1 + m2 * length) * GRAVITY * np.sin(q1)
            torque2 -= h * w1 * w1 + weight
            torque1 -= dry1 * np.tanh(w1 / SLOW)
            torque2 -= dry2 * np.tanh(w2 / SLOW)
            coupling = length * reach2 * np.cos(q2)
            m12 = i2 + m2 * (reach2**2 + coupling)
            m22 = i2 + m2 * reach2**2 + j2
            m11 = i1 + m1 * reach1**2 + j1 + i2 + m2 * (length**2 + reach2**2 + 2.0 * coupling)
            determinant = m11 * m22 - m12 * m12
            w1 += step * (m22 * torque1 - m12 * torque2) / determinant
            w2 += step * (m11 * torque2 - m12 * torque1) / determinant
            q1 += step * w1
            q2 += step * w2


def simulate_free_arm(seed: int) -> tuple[Array, Array]:
    """Return commands and measured angles of the free arm, rad, shape (ticks, 2) each."""
    random = np.random.default_rng(seed)
    time_of = np.arange(round(SECONDS / TICK)) * TICK
    commands = np.zeros((len(time_of), 2))
    for joint in range(2):
        for _ in range(5):
            frequency, phase = random.uniform(0.1, 1.5), random.uniform(0.0, 2.0 * np.pi)
            wave = np.sin(2.0 * np.pi * frequency * time_of + phase) - np.sin(phase)
            commands[:, joint] += random.uniform(0.1, 0.3) * wave
    angles = np.empty_like(commands)
    swing_free_arm(commands, angles, np.array(list(HIDDEN.values())), STEP)
    return commands, angles + NOISE * random.standard_normal(angles.shape)


def pose_free(folder: Path) -> Contest:
    """Return an arm of two joints that position servos move; the positions are predicted."""
    path = folder / "free_arm.xml"
    path.write_text(FREE_ARM)
    machine = rigtwin.machine(path)
    nominal = {"viscous@shoulder": 0.8, "viscous@elbow": 0.3}
    most = dict.fromkeys(HIDDEN, 5.0)
    parameters = friction_parameters(("shoulder", "elbow"), nominal, most)
    parameters.append(ToolboxParameter("mass@forearm", 1.8, 0.5, 5.0, set_mass("forearm")))
    spec = mujoco.MjSpec.from_file(str(path))
    recordings, residuals = [], []
    for seed in (1, 2):
        commands, angles = simulate_free_arm(seed)
        recordings.append(
            _recording(
                machine,
                {
                    "/command": {"servo_1": commands[:, 0], "servo_2": commands[:, 1]},
                    "/sensor": {"angle_1": angles[:, 0], "angle_2": angles[:, 1]},
                },
            )
        )
        time_of = np.arange(len(angles)) * TICK
        test = RolloutTest(
            time_of,
            commands,
            time_of,
            angles,
            ("shoulder_qpos", "elbow_qpos"),
            np.zeros(2),
            np.zeros(2),
        )
        residuals.append(pose_rollout(spec, [test]))
    return Contest(
        "free",
        "arm of two joints on position servos, 10 s at 500 Hz",
        machine,
        recordings[0],
        recordings[1],
        tuple(parameters),
        residuals[0],
        residuals[1],
        HIDDEN,
    )


def pose_emps(data: Path, folder: Path) -> Contest:
    """Return the real drive, whose force is predicted from its motion.

    A rollout of the toolbox in a closed loop was tried too: it takes as long, and its mass is 13 %
    off.
    """
    machine = rigtwin.machine("emps")
    recordings = [
        rigtwin.import_data(
            data / f"DATA_{name}.mat", SHIPPED / "maps" / f"{name.lower()}.toml", folder / name
        )
        for name in ("EMPS", "EMPS_PULSES")
    ]
    spec, joint = mujoco.MjSpec.from_string(EMPS), "carriage"
    harden_friction(spec)
    parameters = (
        ToolboxParameter("mass@carriage", 95.1, 50.0, 200.0, set_mass("carriage")),
        ToolboxParameter("viscous@guide", 203.5, 0.0, 1000.0, set_joint(joint, "damping")),
        ToolboxParameter("coulomb@guide", 0.0, 0.0, 200.0, set_joint(joint, "frictionloss")),
        ToolboxParameter("offset@guide", 0.0, -100.0, 100.0, set_constant_force(joint)),
    )
    residuals = []
    for recording in recordings:
        position = np.asarray(recording.columns["/sensor"]["position"])[None]
        force = np.asarray(recording.columns["/command"]["force"])[None]
        test = measure_inverse(position, force, recording.period, BAND)
        residuals.append(InverseProblem(spec, (test,)))
    return Contest(
        "emps",
        "EMPS, a real drive in its closed loop, 25 s at 1 kHz",
        machine,
        recordings[0],
        recordings[1],
        parameters,
        residuals[0],
        residuals[1],
    )


@dataclass(frozen=True)
class Entry:
    """Result of one tool.

    Attributes
    ----------
    values : mapping
        Fitted values by effect.
    wall, cpu : float
        Medians over the rounds, s.
    held_out : float
        Error of the held-out recording by rigtwin's model, share of the signals' swing.
    held_out_mujoco : float
        The same by MuJoCo's rollout or inverse dynamics.
    """

    values: Mapping[str, float]
    wall: float
    cpu: float
    held_out: float
    held_out_mujoco: float


def judge(contest: Contest, values: Mapping[str, float], times: Array) -> Entry:
    """Judge fitted values on the held-out recording, by the models of both tools."""
    machine = contest.machine
    configuration = machine.configuration_of(contest.held_out, None)
    evidence = Evidence(machine, [contest.held_out], [configuration])
    effects = [find(name, machine.plant) for name in values]
    plant = with_values(evidence.plant, effects, [(value,) for value in values.values()])
    return Entry(
        values,
        float(statistics.median(times[:, 0])),
        float(statistics.median(times[:, 1])),
        float(relative_errors(evidence, plant)[0]),
        residual_error(contest.parameters, contest.residual_held_out, values),
    )


def measure(contest: Contest, rounds: int) -> tuple[Entry, Entry]:
    """Fit with both tools in turn, and return the results of rigtwin and of the toolbox."""
    names = [parameter.effect for parameter in contest.parameters]

    def fit() -> dict[str, float]:
        fitted = rigtwin.fit(contest.fitted, names, machine=contest.machine)
        return {p.name: p.value for p in fitted.parameters}

    def fit_with(optimizer: Optimizer) -> dict[str, float]:
        return fit_toolbox(contest.parameters, contest.residual, optimizer)

    # The toolbox takes part with the faster of its optimisers.
    costs: dict[Optimizer, float] = {}
    for optimizer in ("mujoco", "scipy"):
        begun = time.process_time()
        fit_with(optimizer)
        costs[optimizer] = time.process_time() - begun
    faster = min(costs, key=lambda optimizer: costs[optimizer])
    print(", ".join(f"{name} backend {cost:.2f} s" for name, cost in costs.items()))
    tools: list[Callable[[], dict[str, float]]] = [fit, lambda: fit_with(faster)]
    values = [tool() for tool in tools]
    times = np.empty((2, rounds, 2))
    for number in range(rounds):
        for place, tool in enumerate(tools):
            wall, cpu = time.perf_counter(), time.process_time()
            tool()
            times[place, number] = time.perf_counter() - wall, time.process_time() - cpu
    first, second = (judge(contest, v, t) for v, t in zip(values, times, strict=True))
    return first, second


def lines_of(contest: Contest, entries: tuple[Entry, Entry]) -> list[str]:
    """Return the Markdown of one contest."""
    ours, other = entries
    lines = [f"### {contest.title}", "", "| | rigtwin.fit | mujoco.sysid |", "|---|---|---|"]
    for title, form in (
        ("wall clock, s", lambda e: f"{e.wall:.3f}"),
        ("CPU, s", lambda e: f"{e.cpu:.3f}"),
        ("held-out error by rigtwin's model", lambda e: f"{100 * e.held_out:.3f} %"),
        ("held-out error by MuJoCo's", lambda e: f"{100 * e.held_out_mujoco:.3f} %"),
    ):
        lines.append(f"| {title} | {form(ours)} | {form(other)} |")
    for name in ours.values:
        true = f" (true {contest.truth[name]:.4g})" if name in contest.truth else ""
        lines.append(f"| `{name}`{true} | {ours.values[name]:.4g} | {other.values[name]:.4g} |")
    goal = GOALS[contest.name]
    lines += [
        "",
        f"Time ratio {ours.wall / other.wall:.2f} by the clock, {ours.cpu / other.cpu:.2f} of CPU; "
        f"goal {goal}.",
        "",
    ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder with DATA_EMPS.mat")
    parser.add_argument("--rounds", type=int, default=5, help="timed rounds (5)")
    parser.add_argument("--only", choices=sorted(GOALS), help="one of the machines")
    parser.add_argument("--out", type=Path, help="file of the tables, Markdown")
    parsed = parser.parse_args()
    if missing := find_missing():
        parser.exit(1, f"mujoco.sysid needs {missing}; pip install 'rigtwin[peers]'\n")
    lines: list[str] = []
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        poses: dict[str, Callable[[], Contest]] = {
            "moved": pose_moved,
            "free": lambda: pose_free(folder),
            "emps": lambda: pose_emps(parsed.data, folder),
        }
        for name, pose in poses.items():
            if parsed.only not in (None, name):
                continue
            if name == "emps" and (
                parsed.data is None or not (parsed.data / "DATA_EMPS.mat").is_file()
            ):
                print("EMPS is left out: --data names no folder with DATA_EMPS.mat")
                continue
            contest = pose()
            more = lines_of(contest, measure(contest, parsed.rounds))
            print("\n".join(more), flush=True)
            lines += more
    if parsed.out is not None:
        parsed.out.write_text("\n".join(lines))


if __name__ == "__main__":
    main()
