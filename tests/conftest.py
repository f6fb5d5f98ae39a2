"""Recordings of a stand-in rig, made by other code, where a checkout has them beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigtwin.recording import Recording, load

RECORDINGS = Path(__file__).parents[2] / "shared" / "recordings"
EXAMPLE = Path(__file__).parents[1] / "examples" / "nominal-imposed.mcap"


def rig_recording(name: str) -> Recording:
    """A recording of the stand-in rig; skips the test where it is absent."""
    path = RECORDINGS / f"{name}.mcap"
    if not path.exists():
        pytest.skip(f"no {path}")
    return load(path)


@pytest.fixture(scope="session")
def example() -> Recording:
    """The recording that the project ships."""
    return load(EXAMPLE)
