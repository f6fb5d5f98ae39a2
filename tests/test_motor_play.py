"""A play between a motor, whose torque is commanded, and its joint, against an own integrator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin

PENDULUM = """<mujoco model="pendulum"><option timestep="0.001"/><worldbody>
<body name="arm"><joint name="hinge" axis="0 1 0" damping="0.05" armature="0.06"/>
<inertial pos="0 0 -0.3" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"""
ROTOR, LINK, WEIGHT, DAMPER = 0.06, 0.1, 9.81 * 0.3, 0.05
"""Inertia of rotor and link, kg m²; largest gravity torque, Nm; damping of the link, Nms/rad."""
PLAY, STIFFNESS, IMPACT = 0.05, 4e3, 6.1
"""Width of the play, rad; its contact, Nm/rad and Nms/rad."""
PERIOD, STEPS, ROWS, NOISE = 0.005, 100, 2400, 2e-4


def log(path: Path, seed: int) -> Path:
    """Write torques and angles of the link over 12 s."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(ROWS)
    rates, phases = random.uniform(0.2, 1.6, 5), random.uniform(0.0, 6.28, 5)
    torques = 0.45 * np.sin(6.28 * rates[:, None] * time + phases[:, None]).sum(axis=0)
    torques *= np.minimum(time, 1.0)
    angle = speed = motor = spin = 0.0
    h, rows = PERIOD / STEPS, np.empty((ROWS, 3))
    for row in range(ROWS):
        rows[row] = time[row], torques[row], angle + NOISE * random.standard_normal()
        for _ in range(STEPS):
            beyond, side = abs(motor - angle) - 0.5 * PLAY, np.sign(motor - angle)
            pressed = max(STIFFNESS * beyond + side * IMPACT * (spin - speed), 0.0)
            contact = side * pressed if beyond > 0.0 else 0.0
            spin += h * (torques[row] - contact) / ROTOR
            speed += h * (contact - DAMPER * speed - WEIGHT * np.sin(angle)) / LINK
            motor, angle = motor + h * spin, angle + h * speed
    np.savetxt(path, rows, delimiter=",", header="t,torque_cmd,angle", comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """Return the model, a log to fit and one to judge on."""
    folder = tmp_path_factory.mktemp("pendulum")
    model = folder / "pendulum.xml"
    model.write_text(PENDULUM)
    return model, log(folder / "fit.csv", 1), log(folder / "held.csv", 2)


def test_the_motion_behind_a_motors_play_is_that_of_two_masses(
    pendulum: tuple[Path, Path, Path],
) -> None:
    model, fitted, held_out = pendulum
    fit = rigtwin.fit(fitted, ["backlash@motor"], machine=model, held_out=held_out)
    assert fit["backlash@motor backlash"].value == pytest.approx(PLAY, rel=0.06)
    assert fit["backlash@motor rotor_share"].value == pytest.approx(
        ROTOR / (ROTOR + LINK), rel=0.05
    )
    assert fit.held_out_after[0] < 0.02


@pytest.mark.slow
def test_a_play_behind_a_motor_is_named(pendulum: tuple[Path, Path, Path]) -> None:
    model, fitted, held_out = pendulum
    answer = rigtwin.diagnose(fitted, machine=model, held_out=held_out)
    (finding,) = answer.effects
    assert str(finding.name) == "backlash@motor"
    assert finding.parameters["backlash"].value == pytest.approx(PLAY, rel=0.08)
    assert answer.verdict == "explained"
