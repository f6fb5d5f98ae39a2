"""Copies of recordings: they add nothing, and judge nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import rigtwin
from rigtwin.diagnosis.copies import digest, drop_copies, refuse_copies
from rigtwin.errors import RigtwinError
from tests.helpers.twin import recorded

ONE = recorded("imposed", seconds=2.0)
COPY = replace(ONE, path=Path("copy.mcap"), time=ONE.time + 5.0)
OTHER = recorded("imposed", seconds=2.0, seed=9)


def test_a_copy_is_known_by_its_content():
    assert digest(COPY) == digest(ONE)
    assert digest(OTHER) != digest(ONE)


def test_a_copy_adds_nothing_to_a_fit():
    kept, notes = drop_copies([ONE, COPY, OTHER, COPY])
    assert kept == [ONE, OTHER]
    assert len(notes) == 2
    assert notes[0].startswith("copy.mcap holds the same data as ")


def test_a_copy_is_refused_as_held_out_data():
    refuse_copies([OTHER], [ONE])
    with pytest.raises(RigtwinError, match=r"copy.mcap cannot judge .* the same data as"):
        rigtwin.diagnose([ONE], held_out=[COPY])
