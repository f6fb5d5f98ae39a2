"""A propeller's thrust, which grows with the square of its command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from tests.helpers.logs import write_log

BEAM = """
<mujoco>
  <worldbody>
    <body name="beam">
      <joint name="pitch" axis="0 -1 0" damping="0.03"/>
      <inertial pos="0.02 0 -0.08" mass="0.35" diaginertia="0.001 0.01 0.01"/>
    </body>
  </worldbody>
  <actuator><motor name="propeller" joint="pitch" gear="0.17" ctrlrange="0 1"/></actuator>
</mujoco>
"""
PERIOD, STEPS = 0.01, 10
THRUST = 0.4
"""Torque at a command of 1, Nm."""


def beam(commands: np.ndarray, seed: int) -> np.ndarray:
    """Return angles by semi-implicit Euler steps of a tenth of the period, shape (ticks,)."""
    inertia, h = 0.01 + 0.35 * (0.02**2 + 0.08**2), PERIOD / STEPS
    angle = speed = 0.0
    angles = np.empty(len(commands))
    for tick, command in enumerate(commands):
        angles[tick] = angle
        for _ in range(STEPS):
            # The centre of mass is 0.02 m ahead of the hinge and 0.08 m below it.
            weight = -0.35 * 9.81 * (0.02 * np.cos(angle) + 0.08 * np.sin(angle))
            speed += h / inertia * (THRUST * command**2 + weight - 0.03 * speed)
            angle += h * speed
    return angles + 5e-4 * np.random.default_rng(seed).standard_normal(len(angles))


@pytest.mark.slow
def test_a_thrust_that_grows_with_the_square_of_its_command_is_named(tmp_path: Path):
    (tmp_path / "beam.xml").write_text(BEAM)
    logs = []
    for seed in (1, 2):
        random = np.random.default_rng(seed)
        commands = np.clip(0.42 + np.repeat(random.uniform(-0.2, 0.2, 30), 60), 0.0, 1.0)
        time = PERIOD * np.arange(len(commands))
        columns = {"t": time, "throttle": commands, "pitch_rad": beam(commands, seed)}
        logs.append(write_log(tmp_path / f"{seed}.csv", columns))
    answer = rigtwin.diagnose(logs[0], machine=tmp_path / "beam.xml", held_out=logs[1])
    (effect,) = answer.effects
    assert str(effect.name) == "curvature@propeller"
    values = {name: value.value for name, value in effect.parameters.items()}
    assert values["curvature"] == pytest.approx(1.0, abs=0.05)
    thrust = 0.17 * values["gain"] * values["curvature"] / values["full_command"]
    assert thrust == pytest.approx(THRUST, rel=0.05)
