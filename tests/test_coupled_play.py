"""A play between a servo and one of two coupled joints, against an integrator of this file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin

CARTS = """<mujoco model="carts"><option timestep="0.001" gravity="0 0 0"/><worldbody>
<body name="lower"><joint name="x" type="slide" axis="1 0 0" damping="1" armature="2"/>
<inertial pos="0 0 0" mass="0.3" diaginertia="1 1 1"/>
<body name="upper"><joint name="y" type="slide" axis="1 0 0" damping="1" armature="0.2"/>
<inertial pos="0 0 0" mass="0.2" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><position name="m1" joint="x" kp="900" kv="40"/>
<position name="m2" joint="y" kp="200" kv="10"/></actuator></mujoco>"""
GAINS, DAMPERS = np.array([900.0, 200.0]), np.array([40.0, 10.0])
ROTOR, PLAY, STIFFNESS, IMPACT = 2.0, 0.004, 2e4, 60.0
"""Inertia of the first servo's rotor, kg; width of the play, m; its contact, N/m and Ns/m."""
PERIOD, STEPS, ROWS, LATE, NOISE = 0.01, 200, 800, 3, 2e-5


def log(path: Path, seed: int) -> Path:
    """Write commands and positions over 8 s; the first servo's motor drives through a play."""
    random = np.random.default_rng(seed)
    time = PERIOD * np.arange(ROWS)
    rates, phases = random.uniform(0.3, 2.0, (2, 4)), random.uniform(0.0, 6.28, (2, 4))
    commands = 0.01 * np.sin(6.28 * rates[:, :, None] * time + phases[:, :, None]).sum(axis=1)
    commands -= commands[:, :1]
    inverse = np.linalg.inv(np.array([[0.5, 0.2], [0.2, 0.4]]))
    place, speed, motor, spin, h = np.zeros(2), np.zeros(2), 0.0, 0.0, PERIOD / STEPS
    rows = np.empty((ROWS, 5))
    for row in range(ROWS):
        rows[row] = [time[row], *commands[:, row], *place + NOISE * random.standard_normal(2)]
        wanted = commands[:, max(row - LATE, 0)]
        for _ in range(STEPS):
            beyond = max(abs(motor - place[0]) - 0.5 * PLAY, 0.0)
            side = np.sign(motor - place[0])
            contact = side * max(STIFFNESS * beyond + side * IMPACT * (spin - speed[0]), 0.0)
            contact *= beyond > 0.0
            drive = GAINS[0] * (wanted[0] - motor) - DAMPERS[0] * spin
            hold = GAINS[1] * (wanted[1] - place[1]) - DAMPERS[1] * speed[1]
            spin += h * (drive - contact) / ROTOR
            motor += h * spin
            speed = speed + h * inverse @ (np.array([contact, hold]) - speed)
            place = place + h * speed
    names = "time,x_cmd,y_cmd,x_pos,y_pos"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def carts(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """Return the model, a log to fit and one to judge on."""
    folder = tmp_path_factory.mktemp("carts")
    model = folder / "carts.xml"
    model.write_text(CARTS)
    return model, log(folder / "fit.csv", 1), log(folder / "held.csv", 2)


def test_the_motion_behind_a_play_is_that_of_two_masses(carts: tuple[Path, Path, Path]):
    model, fitted, held_out = carts
    fit = rigtwin.fit(fitted, ["delay@controller", "backlash@m1"], machine=model, held_out=held_out)
    assert fit["backlash@m1 backlash"].value == pytest.approx(PLAY, rel=0.01)
    # Where the upper cart moves freely, the lower one weighs 0.5 - 0.2²/0.4 = 0.4 kg.
    assert fit["backlash@m1 rotor_share"].value == pytest.approx(ROTOR / (ROTOR + 0.4), rel=0.01)
    assert fit["delay@controller"].value == pytest.approx(LATE * PERIOD, rel=0.01)
    assert fit.held_out_after[0] < 0.003


@pytest.mark.slow
def test_play_and_delay_are_named(carts: tuple[Path, Path, Path]):
    model, fitted, held_out = carts
    answer = rigtwin.diagnose(fitted, machine=model, held_out=held_out)
    named = {str(effect.name): next(iter(effect.parameters.values())) for effect in answer.effects}
    assert set(named) == {"delay@controller", "backlash@m1"}, answer.sentence
    assert named["backlash@m1"].value == pytest.approx(PLAY, rel=0.05)
    assert answer.verdict == "explained"
