"""A kind of machine is one file and one registration."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.description import physics
from tests.helpers.shaft import CARD, Shaft, ShaftModel, write_shaft

HIDDEN = {"viscous@shaft": 0.12}
"""Effect to find; the description has 0.05 Nms/rad."""


@pytest.fixture(scope="module")
def machine(tmp_path_factory) -> Iterator[rigtwin.Machine]:
    shaft = Shaft()
    physics.register(shaft)
    yield rigtwin.machine(write_shaft(tmp_path_factory.mktemp("shaft")))
    physics.unregister(shaft)


@pytest.fixture(scope="module")
def recording(machine) -> rigtwin.Recording:
    return rigtwin.run(machine, "shake", seed=3, effects=HIDDEN)


def test_a_registered_kind_claims_its_machine(machine):
    assert machine.kind == "shaft"


def test_its_model_is_the_one_that_predicts(machine, recording):
    configuration = machine.configuration_of(recording)
    model = machine.physics.model(machine, recording.inputs, configuration, 1)
    assert isinstance(model, ShaftModel)
    plant = machine.plant._replace(shaft=machine.plant.shaft._replace(viscous=0.12))
    # The twin is MuJoCo's, the model a closed form: only noise and integration differ.
    left = model.predict(plant)[0] - recording["/sensor.angle"]
    assert np.std(left) < 0.01 * np.std(recording["/sensor.angle"])


def test_a_comparison_shows_its_gap(machine, recording):
    compared = rigtwin.compare(recording, machine=machine)
    assert compared.gap > 3.0
    assert set(compared.replays) == {"encoder"}


@pytest.mark.slow
def test_a_diagnosis_names_the_effect(machine, recording):
    answer = rigtwin.diagnose(recording, machine=machine)
    (finding,) = answer.effects
    assert str(finding.name) == "viscous@shaft"
    (value,) = finding.parameters.values()
    assert value.value == pytest.approx(0.12, rel=0.1)


def test_it_is_plotted_and_filmed(recording, tmp_path: Path):
    recording.plot(tmp_path / "shaft.png")
    assert (tmp_path / "shaft.png").stat().st_size > 1000
    recording.video(tmp_path / "shaft.mp4", until=0.2)
    assert (tmp_path / "shaft.mp4").stat().st_size > 1000


def test_it_runs_a_session_on_the_virtual_card(machine, tmp_path: Path):
    (tmp_path / "card.toml").write_text(CARD)
    path = tmp_path / "session.mcap"
    settings = {"timing": {"duration": 0.5}}
    ended = rigtwin.run_on_twin(
        "shake", machine=machine, card=tmp_path / "card.toml", path=path, settings=settings
    )
    assert ended.completed
    assert rigtwin.load(path).ticks == 500
