"""Copies of recordings: they add nothing, and judge nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import rigtwin
from rigtwin.diagnosis.copies import digest, drop_copies, refuse_copies
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest
from tests.helpers.twin import recorded

Trio = tuple[RecordedTest, RecordedTest, RecordedTest]


@pytest.fixture(scope="module")
def trio() -> Trio:
    """A recording, its copy, and another recording."""
    one = recorded("imposed", seconds=2.0)
    copy = replace(one, path=Path("copy.mcap"), time=one.time + 5.0)
    return one, copy, recorded("imposed", seconds=2.0, seed=9)


def test_a_copy_is_known_by_its_content(trio: Trio):
    one, copy, other = trio
    assert digest(copy) == digest(one)
    assert digest(other) != digest(one)


def test_a_copy_adds_nothing_to_a_fit(trio: Trio):
    one, copy, other = trio
    kept, notes = drop_copies([one, copy, other, copy])
    assert kept == [one, other]
    assert len(notes) == 2
    assert notes[0].startswith("copy.mcap holds the same data as ")


def test_a_copy_is_refused_as_held_out_data(trio: Trio):
    one, copy, other = trio
    refuse_copies([other], [one])
    with pytest.raises(RigtwinError, match=r"copy.mcap cannot judge .* the same data as"):
        rigtwin.diagnose([one], held_out=[copy])
