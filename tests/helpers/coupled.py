"""Machines of joints that act on each other: descriptions, and their equations written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from rigtwin.description.document import load
from rigtwin.description.machine import Machine
from rigtwin.recording import RecordedTest
from tests.helpers.arm import (
    BELT,
    CENTRES,
    GRAVITY,
    INERTIAS,
    LENGTH,
    MASSES,
    MJCF,
    ROTORS,
)

PERIOD = 2e-3
ARM = MJCF.replace(
    "<sensor>",
    '<actuator><motor name="drive_1" joint="shoulder"/><motor name="drive_2" joint="elbow"/>'
    "</actuator><sensor>",
)
ARM_TOML = """
[machine]
name = "arm"
model = "arm.xml"

[components]
shoulder = { joint = "shoulder" }
elbow = { joint = "elbow" }
drive_1 = { actuator = "drive_1", effects = [] }
drive_2 = { actuator = "drive_2", effects = [] }
angle_1 = { sensor = "angle_1", effects = [] }
angle_2 = { sensor = "angle_2", effects = [] }

[[replays]]
free = ["shoulder", "elbow"]
moved_by = ["drive_1", "drive_2"]
observe = ["angle_1", "angle_2"]
"""


def described(folder: Path, name: str, mjcf: str, toml: str) -> Machine:
    """The machine of a description written there."""
    (folder / f"{name}.xml").write_text(mjcf)
    (folder / f"{name}.toml").write_text(toml)
    return load(folder / f"{name}.toml")


def arm(folder: Path, toml: str = ARM_TOML, mjcf: str = ARM) -> Machine:
    """Two links, pushed at both joints."""
    return described(folder, "arm", mjcf, toml)


def recording(machine: Machine, columns: dict[str, dict[str, np.ndarray]]) -> RecordedTest:
    """Of a machine, by topic and field."""
    ticks = len(next(iter(next(iter(columns.values())).values())))
    time = np.arange(ticks) * PERIOD
    return RecordedTest(Path("test"), machine.name, "", PERIOD, time, columns, {})


def accelerations(angles: np.ndarray, rates: np.ndarray, torques: np.ndarray) -> np.ndarray:
    """Of the arm with its belt and the elbow's damper, by Lagrange's equations, shape (2,)."""
    (m1, m2), (r1, r2), (i1, i2) = MASSES, CENTRES, INERTIAS
    (q1, q2), (v1, v2) = angles, rates
    coupling, outer = m2 * LENGTH * r2, i2 + m2 * r2**2
    first = i1 + m1 * r1**2 + m2 * LENGTH**2 + outer + 2.0 * coupling * np.cos(q2)
    both = outer + coupling * np.cos(q2) + BELT
    inertia = np.array([[first + ROTORS[0] + BELT, both], [both, outer + ROTORS[1] + BELT]])
    weight = GRAVITY * m2 * r2 * np.sin(q1 + q2)
    centrifugal = coupling * np.sin(q2)
    bias = np.array(
        [
            -centrifugal * (2.0 * v1 + v2) * v2
            + GRAVITY * (m1 * r1 + m2 * LENGTH) * np.sin(q1)
            + weight,
            centrifugal * v1**2 + weight + 0.1 * v2,
        ]
    )
    return np.linalg.solve(inertia, torques - bias)


def integrate(
    torques: np.ndarray, angles: tuple[float, float], rates: tuple[float, float]
) -> np.ndarray:
    """Angles and rates under torques held from tick to tick, shape (2, 2, ticks). torques: Nm,
    shape (2, ticks)."""
    state = np.array([*angles, *rates])
    found = [state]
    for push in torques.T[:-1]:
        run = solve_ivp(
            lambda _, y, push=push: np.concatenate([y[2:], accelerations(y[:2], y[2:], push)]),
            (0.0, PERIOD),
            state,
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
        )
        state = run.y[:, -1]
        found.append(state)
    return np.stack(found, axis=1).reshape(2, 2, -1)
