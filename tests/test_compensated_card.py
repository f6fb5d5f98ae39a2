"""A test whose plate's delay is compensated, on the virtual card."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.hardware.daq import CARD

SHORT = {"timing": {"duration": 2.0}, "safety": {"ramp": 0.3, "hold": 0.1}}
NAMES = ("drop-compensated", "motorcycle-road10-compensated")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_card_commands_byte_for_byte_what_the_twin_does(name: str, tmp_path: Path) -> None:
    twin, card = tmp_path / "twin.mcap", tmp_path / "card.mcap"
    ended = rigtwin.run_on_twin(name, path=twin, settings=SHORT, seed=2)
    assert ended.completed, ended.cause
    ran = rigtwin.dry_run(name, CARD, path=card, settings=SHORT, seed=2)
    assert ran.passed, ran.cause
    assert card.read_bytes() == twin.read_bytes()
    plain = {**SHORT, "controller": {"plate_compensator": "none"}}
    ended = rigtwin.run_on_twin(name, path=tmp_path / "plain.mcap", settings=plain, seed=2)
    ours, theirs = (rigtwin.load(path)["/command.structure"] for path in (twin, ended.path))
    length = min(len(ours), len(theirs))
    assert not np.array_equal(ours[:length], theirs[:length])
