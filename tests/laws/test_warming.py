"""Friction that a cold machine has more of, written out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components import Warming
from rigtwin.components.schedule import scheduled_force
from tests.laws.written import law_of

PERIOD, TICKS = 0.004, 4000
TIME = PERIOD * np.arange(TICKS)
MOTION = np.stack([0.2 * np.sin(2.0 * TIME), 0.4 * np.cos(2.0 * TIME), -0.8 * np.sin(2.0 * TIME)])


@law_of("coulomb", Warming)
@law_of("viscous", Warming)
def test_friction_fades_with_the_time_since_the_log_began() -> None:
    warming = Warming(coulomb=20.0, viscous=3.0, time=5.0)
    level = warming.fade(TICKS, PERIOD)
    force = scheduled_force(warming.schedule, level, MOTION, 1e9)
    speed = MOTION[1]
    true = (20.0 * np.sign(speed) + 3.0 * speed) * np.exp(-TIME / 5.0)
    # Dry friction acts once the joint has moved: a tick after the beginning, and after a reversal.
    turning = (np.abs(speed) < 0.01) | (TIME == 0.0)
    np.testing.assert_allclose(force[~turning], true[~turning], atol=1e-6)


LIFT = """<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1" frictionloss="4"/>
<inertial pos="0 0 0" mass="6" diaginertia="0.1 0.1 0.1"/></body></worldbody>
<actuator><motor joint="lift"/></actuator></mujoco>"""


def log(path: Path, cold: float, time: float, seed: int) -> Path:
    """Write position and force of a lift whose friction fades."""
    random, t = np.random.default_rng(seed), 0.004 * np.arange(5000)
    position, speed, acceleration = np.zeros((3, len(t)))
    for rate, phase in zip(random.uniform(0.8, 5.0, 4), random.uniform(0.0, 6.0, 4), strict=True):
        position += 0.05 * np.sin(rate * t + phase)
        speed += 0.05 * rate * np.cos(rate * t + phase)
        acceleration -= 0.05 * rate**2 * np.sin(rate * t + phase)
    friction = 4.0 + cold * np.exp(-t / time)
    force = 6.0 * (acceleration + 9.81) + friction * np.tanh(speed / 2e-3)
    noise = random.standard_normal((2, len(t)))
    rows = np.stack([t, position + 2e-5 * noise[0], force + 0.3 * noise[1]], axis=1)
    np.savetxt(path, rows, delimiter=",", header="t,lift_pos,lift_force", comments="", fmt="%.8g")
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("cold", "time"), [(10.0, 4.0), (-2.5, 9.0)])
def test_a_cold_machine_is_told_from_a_stiff_one(tmp_path: Path, cold: float, time: float) -> None:
    model = tmp_path / "lift.xml"
    model.write_text(LIFT)
    fitted, held_out = (log(tmp_path / f"{n}.csv", cold, time, n) for n in (1, 2))
    answer = rigtwin.diagnose(fitted, machine=model, held_out=held_out)
    (finding,) = answer.effects
    assert str(finding.name) == "coulomb@lift_warming", answer.sentence
    assert finding.parameters["coulomb"].value == pytest.approx(cold, rel=0.05)
    assert finding.parameters["time"].value == pytest.approx(time, rel=0.1)
    assert answer.verdict == "explained"


@pytest.mark.slow
def test_a_warm_machine_has_no_gap(tmp_path: Path) -> None:
    model = tmp_path / "lift.xml"
    model.write_text(LIFT)
    assert rigtwin.diagnose(log(tmp_path / "1.csv", 0.0, 1.0, 1), machine=model).verdict == "no gap"
