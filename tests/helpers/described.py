"""Machines written into a folder for tests: one TOML and one MJCF each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigtwin.description.document import load
from rigtwin.description.machine import Machine
from rigtwin.recording import RecordedTest

BODIES = {
    "slide": '<joint name="axis" type="slide" axis="1 0 0" stiffness="150" '
    'damping="6"/><geom size="0.05" mass="2"/>',
    "pendulum": '<joint name="axis" type="hinge" axis="0 1 0" damping="0.3"/>'
    '<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="1.5"/>',
}
MJCF = """<mujoco model="bench"><option integrator="RK4"/>
<worldbody><body name="arm">{body}</body></worldbody>
<actuator><motor name="drive" joint="axis"/></actuator>
<sensor><jointpos name="encoder" joint="axis"/>
<jointactuatorfrc name="cell" joint="axis"/></sensor></mujoco>
"""
TOML = """
[machine]
name = "bench"
model = "bench.xml"

[components.mass]
body = "arm"

[components.guide]
joint = "axis"

[components.drive]
actuator = "drive"
command = "force"

[components.encoder]
sensor = "encoder"
channel = "position"
effects = []

[[replays]]
moved_by = "drive"
observe = ["encoder"]
"""


def described(folder: Path, sort: str = "slide", toml: str = TOML) -> Machine:
    """The machine of a description written there."""
    (folder / "bench.xml").write_text(MJCF.format(body=BODIES[sort]))
    (folder / "bench.toml").write_text(toml)
    return load(folder / "bench.toml")


def recording_of(
    machine: Machine, command: np.ndarray, position: np.ndarray, period: float = 1e-3
) -> RecordedTest:
    """A recording of it."""
    columns = {"/command": {"force": command}, "/sensor": {"position": position}}
    return RecordedTest(
        Path("bench"), machine.name, "", period, np.arange(len(command)) * period, columns, {}
    )


EXPERIMENT = """
[experiments.shake]
summary = "to and fro"
duration = 4.0
period = 1e-3
[experiments.shake.demands]
force = "30 * sin(7 * time) + 12 * sin(17 * time)"
"""
NOISY = TOML.replace('channel = "position"', 'channel = "position"\nwhite = 2e-5') + EXPERIMENT
