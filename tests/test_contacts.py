"""Geoms that touch while a recording is made are named with the time for which they touch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.diagnosis.contacts import find_contacts
from tests.helpers.described import TOML, recording_of

WALLED = """<mujoco><worldbody>
<geom name="wall" type="box" size="0.05 0.5 0.5" pos="0.3 0 0"/>
<body name="arm"><joint name="axis" type="slide" axis="1 0 0" damping="6"/>
<geom name="block" type="sphere" size="0.05" mass="2"/></body></worldbody>
<actuator><motor name="drive" joint="axis"/></actuator>
<sensor><jointpos name="encoder" joint="axis"/></sensor></mujoco>"""


@pytest.fixture
def machine(tmp_path: Path) -> rigtwin.Machine:
    (tmp_path / "bench.xml").write_text(WALLED)
    (tmp_path / "bench.toml").write_text(TOML)
    return rigtwin.machine(tmp_path / "bench.toml")


def test_geoms_that_touch_are_named_with_their_time(machine: rigtwin.Machine) -> None:
    # The block is at the wall from 0.2 m on: from 1 s to the end.
    position = np.minimum(0.2 * np.arange(4000) * 1e-3, 0.21)
    lines = find_contacts(machine, recording_of(machine, 0.0 * position, position))
    assert len(lines) == 1
    assert "geom 'block' and geom 'wall' touch for 3 s of 4 s, first at 1 s" in lines[0]


def test_a_recording_without_contact_has_no_such_line(machine: rigtwin.Machine) -> None:
    position = 0.1 * np.sin(np.arange(4000) * 1e-2)
    assert find_contacts(machine, recording_of(machine, 0.0 * position, position)) == []


@pytest.mark.slow
def test_a_comparison_and_a_diagnosis_say_what_touches(machine: rigtwin.Machine) -> None:
    time, noise = np.arange(4000) * 1e-3, np.random.default_rng(3).normal(0.0, 1e-5, 4000)
    position = 0.12 + 0.1 * np.sin(3.0 * time) + noise
    recording = recording_of(machine, 5.0 * np.cos(3.0 * time), position)
    assert any("touch for" in note for note in rigtwin.compare(recording, machine=machine).notes)
    assert any(
        "touch for" in note for note in rigtwin.diagnose(recording, machine=machine).answer.notes
    )
