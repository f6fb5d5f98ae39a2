"""Waves of a force along the stroke: their pitch is read off the force, whatever their phase."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.diagnosis.waves import repeating_pitches

STROKE = 0.4


def swept(seed: int) -> np.ndarray:
    """Return positions that pass the stroke several times, m, shape (ticks,)."""
    random = np.random.default_rng(seed)
    time = np.arange(12000) / 1000.0
    rates, phases = random.uniform(0.1, 0.5, 4), random.uniform(0.0, 6.28, 4)
    wave = np.sin(6.28 * rates[:, None] * time + phases[:, None]).sum(axis=0)
    return STROKE * (wave - wave.min()) / np.ptp(wave)


@pytest.mark.parametrize("phase", [0.0, 1.6, 3.2, 4.8])
@pytest.mark.parametrize("waves", [7.3, 31.0, 161.7, 480.0])
def test_the_pitch_is_that_of_the_highest_peak(waves: float, phase: float):
    position = swept(3)
    random = np.random.default_rng(4)
    force = 20.0 * np.sin(2.0 * np.pi * waves * position / STROKE + phase)
    # Friction and a spring are three times as large, and must not be taken for waves.
    force += 60.0 * np.sign(np.gradient(position)) + 300.0 * position
    force += 5.0 * random.standard_normal(len(position))
    pitch = repeating_pitches(force, position, 3)[0]
    # Half a wave more or less along the stroke: a fit from there finds the pitch.
    assert STROKE / pitch == pytest.approx(waves, abs=0.5)


def test_without_motion_there_is_no_pitch():
    assert repeating_pitches(np.ones(100), np.full(100, 0.2), 3) == ()


AXIS = """<mujoco model="axis"><worldbody><body name="slide">
<joint name="x" type="slide" axis="1 0 0" damping="20"/>
<inertial pos="0 0 0" mass="6" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor name="m" joint="x"/></actuator></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("phase", [0.7, 3.6])
def test_cogging_of_a_screw_is_found_beside_dry_friction(tmp_path: Path, phase: float):
    model = tmp_path / "axis.xml"
    model.write_text(AXIS)
    pitch, logs = 0.0025, [tmp_path / "fit.csv", tmp_path / "held.csv"]
    for seed, path in enumerate(logs):
        position, random = swept(seed), np.random.default_rng(seed)
        speed = np.gradient(position, 1e-3)
        force = 6.0 * np.gradient(speed, 1e-3) + 20.0 * speed + 12.0 * np.sign(speed)
        force += 9.0 * np.sin(2.0 * np.pi * position / pitch + phase)
        noisy = force + 0.5 * random.standard_normal(len(force))
        rows = np.stack([1e-3 * np.arange(len(force)), position, noisy], axis=1)
        names = "time_s,x_pos_m,x_force_N"
        np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.9g")
    answer = rigtwin.diagnose(logs[0], machine=model, held_out=logs[1])
    named = {str(effect.name): effect.parameters for effect in answer.effects}
    assert set(named) == {"coulomb@x", "cogging@x"}, answer.sentence
    assert named["cogging@x"]["cogging"].value == pytest.approx(9.0, rel=0.03)
    assert named["cogging@x"]["cogging_pitch"].value == pytest.approx(pitch, rel=1e-3)
    assert answer.verdict == "explained"
