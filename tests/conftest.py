"""Fixtures of several files of tests."""

from __future__ import annotations

import pytest

from rigtwin.recording import Recording
from tests.helpers.recordings import EXAMPLE, beginning, shipped


@pytest.fixture(scope="session")
def example() -> Recording:
    """8 s of a rig without defects, which is not the twin."""
    return beginning(shipped(EXAMPLE.stem), 8.0)
