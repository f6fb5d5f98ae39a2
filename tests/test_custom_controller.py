"""Controllers of one's own in sessions: the same on twin and card, stopped as the rig's are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigtwin
from controllers import Commands, Demand, Measurements
from controllers.mil import controller, initial_state, update
from controllers.settings import PlateCompensator
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.hardware.session.custom_controller import custom_controller
from rigtwin.hardware.session.permission import key_of

SHORT = {"timing": {"duration": 2.0}, "safety": {"ramp": 0.3, "hold": 0.1}}


class Same:
    """The rig's own, tick by tick."""

    def __init__(self, configuration: Configuration) -> None:
        self.controlling = controller(configuration.controller, configuration.timing.period)
        self.state = initial_state(self.controlling)

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        self.state, commands = update(self.controlling, self.state, measured, demand)
        return commands


def compensated(configuration: Configuration) -> Same:
    """With the plate's delay compensated."""
    kind = PlateCompensator.KALMAN_INVERSE
    settings = configuration.controller._replace(plate_compensator=kind)
    return Same(configuration._replace(controller=settings))


def on_twin(path: Path, **options: Any) -> rigtwin.Recording:
    ended = rigtwin.run_on_twin("drop", path=path, settings=SHORT, seed=2, **options)
    assert ended.completed, ended.cause
    return rigtwin.load(path)


def on_card(path: Path, **options: Any) -> rigtwin.Recording:
    from rigtwin.hardware.daq import CARD

    ran = rigtwin.dry_run("drop", CARD, path=path, settings=SHORT, seed=2, **options)
    assert ran.passed, ran.cause
    return rigtwin.load(path)


def test_one_s_own_that_is_the_rig_s_commands_the_same(tmp_path: Path) -> None:
    plain = on_twin(tmp_path / "plain.mcap")
    recorded = on_twin(tmp_path / "own.mcap", controller=Same)
    for channel in plain.channels:
        assert np.array_equal(recorded[channel], plain[channel])
    assert set(recorded.controller) == {"own", "start", "preload"}


@pytest.mark.slow
def test_a_compensator_commands_on_the_card_what_it_does_on_the_twin(tmp_path: Path) -> None:
    twin = on_twin(tmp_path / "twin.mcap", controller=compensated)
    card = on_card(tmp_path / "card.mcap", controller=compensated)
    assert (tmp_path / "card.mcap").read_bytes() == (tmp_path / "twin.mcap").read_bytes()
    plain = on_twin(tmp_path / "plain.mcap")
    assert not np.array_equal(twin["/command.structure"], plain["/command.structure"])
    assert card.end == "completed"


def test_what_it_gives_is_looked_at(tmp_path: Path) -> None:
    def broken(_: Configuration) -> Any:
        return lambda measured, demand: (0.0, 0.0, 0.0)

    ended = rigtwin.run_on_twin(
        "drop", path=tmp_path / "broken.mcap", settings=SHORT, controller=broken
    )
    assert not ended.completed
    assert "the controller failed" in ended.cause
    with pytest.raises(RigtwinError, match="expected a function of the configuration"):
        custom_controller(3)  # type: ignore[arg-type]


def test_a_dry_run_holds_for_one_controller_alone() -> None:
    keys = {
        key_of(rigtwin.plan_test("drop", settings=SHORT, controller=make))
        for make in (None, Same, compensated)
    }
    assert len(keys) == 3
    again = rigtwin.plan_test("drop", settings=SHORT, controller=Same)
    assert key_of(again) in keys
