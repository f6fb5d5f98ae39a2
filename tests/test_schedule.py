"""Forces that follow a recorded channel: their description, and what a diagnosis finds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.description.document import examine

PERIOD = 1e-3
TIME = np.arange(8000) * PERIOD
POSITION = 0.02 * np.sin(2 * np.pi * 1.3 * TIME) + 0.008 * np.sin(2 * np.pi * 3.1 * TIME)
SPEED = np.gradient(POSITION, PERIOD)
MODEL = """<mujoco model="mr"><worldbody><body name="rod">
<joint name="piston" type="slide" axis="1 0 0"/><geom type="sphere" size="0.01" mass="0.001"/>
</body></worldbody>
<sensor><jointpos name="displacement" joint="piston"/></sensor></mujoco>"""
DESCRIPTION = """[machine]
name = "mr"
model = "model.xml"
nominal = "rough"

[components.piston]
joint = "piston"

[components.position]
sensor = "displacement"
effects = []

[components.force]
joint = "piston"
type = "force sensor"
effects = []

[[replays]]
moved_by = "position"
observe = ["force"]
"""
FOLLOWED = """
[components.voltage]
joint = "piston"
type = "schedule"
unit = "V"
"""


def voltage() -> np.ndarray:
    """Steps of 0.3 s between 0 and 2 V, drawn at random."""
    return np.repeat(np.random.default_rng(4).uniform(0.0, 2.0, 27), 300)[: len(TIME)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "model.xml").write_text(MODEL)
    (tmp_path / "machine.toml").write_text(DESCRIPTION + FOLLOWED)
    (tmp_path / "plain.toml").write_text(DESCRIPTION)
    return tmp_path


def record(path: Path, lag: float) -> rigtwin.Recording:
    """Record a damper whose friction is 30 N + 20 N/V behind a lag, and whose damping is 400."""
    random = np.random.default_rng(5)
    level, late = voltage(), voltage()
    for tick in range(1, len(late)):
        late[tick] = late[tick - 1] + PERIOD / (lag + PERIOD) * (level[tick] - late[tick - 1])
    force = (30.0 + 20.0 * late) * np.sign(SPEED) + 400.0 * SPEED
    columns = {
        "/sensor.position": POSITION + 1e-6 * random.standard_normal(len(TIME)),
        "/sensor.force": force + 0.5 * random.standard_normal(len(TIME)),
        "/sensor.voltage": level,
    }
    lines = [",".join(("time", *columns))]
    lines += [
        ",".join(f"{value:.9g}" for value in row)
        for row in zip(TIME, *columns.values(), strict=True)
    ]
    path.write_text("\n".join(lines))
    table = path.with_suffix(".toml")
    channels = "\n".join(f'"{name}" = {{ column = "{name}" }}' for name in columns)
    table.write_text(f'machine = "mr"\n[time]\ncolumn = "time"\n[channels]\n{channels}\n')
    return rigtwin.import_data(path, table, path.with_suffix(".mcap"))


@pytest.mark.slow
def test_friction_that_follows_a_voltage_is_found(folder: Path):
    recording = record(folder / "log.csv", 0.05)
    answer = rigtwin.diagnose(recording, machine=rigtwin.machine(folder / "machine.toml"))
    found = {str(e.name): next(iter(e.parameters.values())) for e in answer.effects}
    assert set(found) == {
        "coulomb@piston",
        "viscous@piston",
        "coulomb@voltage",
        "lag@voltage",
    }, answer.sentence
    assert found["coulomb@voltage"].value == pytest.approx(20.0, rel=0.05)
    assert found["coulomb@voltage"].unit == "N/V"
    assert found["coulomb@piston"].value == pytest.approx(30.0, rel=0.05)
    assert found["viscous@piston"].value == pytest.approx(400.0, rel=0.05)
    assert found["lag@voltage"].value == pytest.approx(0.05, rel=0.1)


@pytest.mark.slow
def test_an_unused_channel_is_named_where_the_residual_changes_with_it(folder: Path):
    recording = record(folder / "log.csv", 0.0)
    answer = rigtwin.diagnose(recording, machine=rigtwin.machine(folder / "plain.toml"))
    assert any("/sensor.voltage" in note and "schedule" in note for note in answer.answer.notes)


def test_a_schedule_of_a_joint_that_is_pushed_is_refused(folder: Path):
    model = MODEL.replace(
        "<sensor>", '<actuator><motor name="drive" joint="piston"/></actuator><sensor>'
    )
    (folder / "model.xml").write_text(model)
    pushed = DESCRIPTION.replace('[[replays]]\nmoved_by = "position"\nobserve = ["force"]', "")
    pushed += """
[components.rod]
body = "rod"

[components.drive]
actuator = "drive"

[[replays]]
moved_by = "drive"
observe = ["position"]
"""
    (folder / "machine.toml").write_text(pushed + FOLLOWED)
    _, mistakes = examine(folder / "machine.toml")
    assert any("'schedule' goes with a joint that moves as measured" in m for m in mistakes)
