"""Fixtures of several files of tests."""

from __future__ import annotations

import signal

import pytest

from rigtwin.diagnosis import threads
from rigtwin.recording import RecordedTest
from tests.helpers.recordings import EXAMPLE, beginning, shipped

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell's background job hands down an ignored Ctrl-C, which a user's terminal does not.
    signal.signal(signal.SIGINT, signal.default_int_handler)


# Every core has a worker of its own already: a second thread would only take time to change to.
threads.THREADS = 1

FIRST = ("test_supervised.py", "test_load_friction.py", "test_mujoco.py", "test_referee.py")
"""Files that compile the rig, coupled joints, single joints and the referee. The workers take them
one after another, so that each compiles something else and no other file waits for it."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests first whose compiled functions most others need."""
    order = {name: place for place, name in enumerate(FIRST)}
    items.sort(key=lambda item: order.get(item.path.name, len(FIRST)))


@pytest.fixture(scope="session")
def example() -> RecordedTest:
    """8 s of a rig without defects, which is not the twin."""
    return beginning(shipped(EXAMPLE.stem), 8.0)
