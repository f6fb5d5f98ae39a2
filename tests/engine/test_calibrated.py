"""The corrected twin as TOML: what differs, and nothing else."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rigtwin.components import Computer, find
from rigtwin.description.physics import Physics
from rigtwin.diagnosis.calibrated import format_changes, save, toml
from rigtwin.errors import RigtwinError
from rigtwin.joints.physics import PrescribedJoints
from rigtwin.rig.physics import SuspensionRig
from tests.engine.linear import PLANT

RIG = SuspensionRig()
DELAYED = PLANT.structure_cylinder._replace(delay=0.006, gain=1.1)
CORRECTED = PLANT._replace(
    rail=PLANT.rail._replace(coulomb=61.25),
    structure_cylinder=DELAYED,
    computer=Computer(0.0, 0.002),
)


def test_only_what_differs_is_written_component_by_component():
    table = tomllib.loads("\n".join(format_changes(PLANT, CORRECTED)))
    assert table == {
        "rail": {"coulomb": 61.25},
        "structure_cylinder": {"gain": 1.1, "delay": 0.006},
        "computer": {"delay": 0.002},
    }
    assert format_changes(PLANT, PLANT) == []


def finding(kind: str, component: str, **values: tuple[float, float, float]) -> SimpleNamespace:
    """Return a named effect whose parameters have a value, a lower and an upper end."""
    parameters = {
        name: SimpleNamespace(value=value, nominal=low, low=low, high=high)
        for name, (value, low, high) in values.items()
    }
    name = SimpleNamespace(kind=kind, component=component)
    confidence = 0.9 if kind == "coulomb" else 0.7
    return SimpleNamespace(name=name, parameters=parameters, confidence=confidence)


def diagnosis_of(plant: Any, effects: list[Any], physics: Physics = RIG) -> Any:
    answer = SimpleNamespace(
        verdict="explained", sentence="It rubs.", recordings=["a.mcap"], effects=effects
    )
    mass, delay = find("mass@carriage", PLANT), find("lag@motor", PLANT)
    other = SimpleNamespace(
        name="mass@carriage + lag@motor", effects=(mass, delay), values=((40.0,), (0.003,))
    )
    return SimpleNamespace(
        answer=answer,
        described=SimpleNamespace(plant=PLANT, physics=physics),
        machine=SimpleNamespace(plant=plant),
        effects=effects,
        otherwise=[(other, 0.04)],
        evidence=object(),
    )


def test_the_file_has_the_changes_the_settings_of_the_controller_and_the_posterior():
    effects = [
        finding("coulomb", "rail", coulomb=(61.25, 58.0, 64.5)),
        finding("delay", "controller", delay=(0.002, 0.0015, 0.0025)),
        finding("setting", "controller", kp=(3.0, 2.0, 0.0)),
        finding("unknown", "rail", force=(1.0, 0.0, 2.0)),
    ]
    text = toml(diagnosis_of(CORRECTED, effects))
    lines = text.splitlines()
    assert lines[:3] == [
        "# explained: It rubs.",
        "# from a.mcap",
        "# the controller's kp was 3, configured as 2",
    ]
    table = tomllib.loads(text)
    # A controller that compensates the plate's delay is told of the computer's delay too.
    assert table["controller"] == {"plate_gain": 1.1, "plate_delay": 0.008}
    posterior = table["posterior"]
    assert posterior["probability"] == 0.7
    assert posterior["intervals"] == {
        "rail.coulomb": [58.0, 64.5],
        "computer.delay": [0.0015, 0.0025],
    }
    (other,) = posterior["otherwise"]
    assert other["effect"] == "mass@carriage + lag@motor"
    assert other["probability"] == 0.04
    assert other["changes"] == {"carriage": {"mass": 40.0}, "motor": {"lag": 0.003}}


def test_without_effects_there_is_no_posterior_and_without_changes_no_table():
    table = tomllib.loads(toml(diagnosis_of(PLANT, [])))
    assert table == {}
    rubbing = PLANT._replace(rail=PLANT.rail._replace(coulomb=61.25))
    assert tomllib.loads(toml(diagnosis_of(rubbing, []))) == {"rail": {"coulomb": 61.25}}


def test_only_the_suspension_rigs_controller_is_told_of_its_plates():
    table = tomllib.loads(toml(diagnosis_of(CORRECTED, [], PrescribedJoints())))
    assert "controller" not in table


def test_data_that_cannot_be_diagnosed_give_no_twin(tmp_path: Path):
    diagnosis = diagnosis_of(CORRECTED, [])
    assert save(tmp_path / "twin.toml", diagnosis).read_text() == toml(diagnosis)
    diagnosis.evidence = None
    with pytest.raises(RigtwinError, match="cannot be diagnosed"):
        save(tmp_path / "none.toml", diagnosis)
    assert not (tmp_path / "none.toml").exists()
