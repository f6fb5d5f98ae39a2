"""Fixtures of several files of tests."""

from __future__ import annotations

import signal

import pytest

from rigtwin.recording import RecordedTest
from tests.helpers.recordings import EXAMPLE, beginning, shipped

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell's background job hands down an ignored Ctrl-C, which a user's terminal does not.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def example() -> RecordedTest:
    """8 s of a rig without defects, which is not the twin."""
    return beginning(shipped(EXAMPLE.stem), 8.0)
