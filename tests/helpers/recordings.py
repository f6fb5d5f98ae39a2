"""Recordings of the stand-in rig, made by other code: what comes with the project, and what a
checkout may have beside it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest, load

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "nominal-imposed.mcap"
SHIPPED = {
    path.stem: path for path in (EXAMPLE, *sorted((ROOT / "tests" / "recordings").glob("*.mcap")))
}
BESIDE = ROOT.parent / "shared" / "recordings"
"""Longer and more of them, where a checkout has them."""


@cache
def shipped(name: str) -> RecordedTest:
    """A recording that comes with the project."""
    return load(SHIPPED[name])


def beside(name: str) -> RecordedTest:
    """A recording beside the checkout; skips the test where it is absent."""
    path = BESIDE / f"{name}.mcap"
    if not path.exists():
        pytest.skip(f"no {path}")
    return load(path)


def rig_recording(name: str) -> RecordedTest:
    """The one that comes with the project, or else the one beside the checkout; skips the test
    where there is neither."""
    return shipped(name) if name in SHIPPED else beside(name)


def beginning(recording: RecordedTest, seconds: float) -> RecordedTest:
    """The recording as if it had ended then."""
    ticks = round(seconds / recording.period)
    columns = {
        topic: {name: values[:ticks] for name, values in fields.items()}
        for topic, fields in recording.columns.items()
    }
    return replace(recording, time=recording.time[:ticks], columns=columns)


def replace_sensors(recording: RecordedTest, **sensors: Array) -> RecordedTest:
    """The recording with other values of these sensors, shape (ticks,) each."""
    return replace(
        recording,
        columns={**recording.columns, "/sensor": {**recording.columns["/sensor"], **sensors}},
    )
