"""Every machine goes one way: whatever a description changes reaches the twin, the run and the
diagnosis alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.description.catalogue import SHIPPED
from rigtwin.description.document import examine
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.space import Space
from tests.helpers.described import TOML, described, recording_of

SHORT = {"timing": {"duration": 3}}


def rig_named(folder: Path, name: str, **replaced: str) -> rigtwin.Machine:
    """The suspension rig's description under another name, with some of its text replaced."""
    text = (SHIPPED / "suspension_rig.toml").read_text()
    for old, new in {'name = "suspension-rig"': f'name = "{name}"', **replaced}.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{name}.toml"
    path.write_text(text)
    machine, mistakes = examine(path)
    assert mistakes == []
    assert machine is not None
    return machine


def names(diagnosis: rigtwin.Diagnosis) -> set[str]:
    return {str(effect.name) for effect in diagnosis.effects}


@pytest.mark.slow
def test_a_rig_under_another_name_is_diagnosed_like_the_shipped_one(tmp_path: Path):
    machine = rig_named(tmp_path, "my-quarter-car")
    recording = rigtwin.run(machine, "imposed", settings=SHORT, effects={"coulomb@motor": 24})
    assert recording.machine == "my-quarter-car"
    found = rigtwin.diagnose(recording)
    assert names(found) == {"coulomb@motor"}
    assert found.effects[0].parameters["coulomb"].value == pytest.approx(24.0, rel=0.05)
    assert rigtwin.compare(recording, effects={"coulomb@motor": 24}).gap < 1.1


def test_a_described_mass_is_the_mass_everywhere(tmp_path: Path):
    mass = {'mass = { tolerance = "0.5 %" }': 'mass = { value = 40.0, tolerance = "0.5 %" }'}
    machine = rig_named(tmp_path, "heavy-rig", **mass)
    assert machine.plant.carriage.mass == 40.0
    assert machine.configuration.plant.carriage.mass == 40.0
    assert rigtwin.experiments(machine)["imposed"].configuration.plant.carriage.mass == 40.0
    recording = rigtwin.run(machine, "imposed", settings=SHORT)
    found = rigtwin.diagnose(recording)
    assert found.evidence is not None
    assert found.evidence.plant.carriage.mass == 40.0
    assert found.corrected.plant.carriage.mass == 40.0
    # What was run is what is described, and not the shipped rig.
    assert found.verdict == "no gap"
    assert not found.effects
    lighter = rigtwin.compare(recording, settings={"carriage": {"mass": 34.0}})
    assert lighter.gap > 2.0 * rigtwin.compare(recording).gap


LVDT = TOML.replace("effects = []", 'type = "lvdt"')
PLAIN = TOML.replace("effects = []", 'type = "position sensor"\nwhite = 6e-5')
TIME = np.arange(5000) * 1e-3
PUSH = np.asarray(sum(8.0 * np.sin(2 * np.pi * f * TIME + f) for f in (0.23, 0.61, 1.13, 1.9, 3.1)))
COARSE = 9e-4
"""m, rms: fifteen times what is declared."""


def pushed(machine: rigtwin.Machine, share: float = 1.0, **effects: float) -> rigtwin.Recording:
    def push(_: rigtwin.Configuration, seed: int) -> dict[str, np.ndarray]:
        return {"force": share * PUSH}

    given = {f"{kind}@encoder": value for kind, value in effects.items()}
    return rigtwin.run(machine, push, seed=2, effects=given)


@pytest.mark.parametrize("toml", [LVDT, PLAIN], ids=["lvdt", "position sensor"])
def test_a_joints_sensor_of_declared_noise_is_no_finding(tmp_path: Path, toml: str):
    found = rigtwin.diagnose(pushed(described(tmp_path, toml=toml)))
    assert found.verdict == "no gap"
    assert not found.effects


@pytest.mark.parametrize(
    ("sort", "share", "unit", "toml"),
    [
        pytest.param("slide", 1.0, "m", LVDT, marks=pytest.mark.slow),
        ("slide", 1.0, "m", PLAIN),
        pytest.param("pendulum", 0.04, "rad", PLAIN, marks=pytest.mark.slow),
    ],
    ids=["lvdt", "position sensor", "turning"],
)
def test_coarse_noise_of_a_joints_sensor_is_named(
    tmp_path: Path, sort: str, share: float, unit: str, toml: str
):
    machine = described(tmp_path, sort, toml)
    found = rigtwin.diagnose(pushed(machine, share, noise=COARSE))
    assert names(found) == {"noise@encoder"}
    white = found.effects[0].parameters["white"]
    assert white.value == pytest.approx(COARSE, rel=0.1)
    assert white.unit == unit
    assert found.machine.plant.encoder.white == white.value


def test_what_a_description_rules_out_is_not_found(tmp_path: Path):
    recording = pushed(described(tmp_path, toml=LVDT), noise=COARSE)
    ruled_out = LVDT.replace('type = "lvdt"', 'type = "lvdt"\neffects = ["gain"]')
    assert not names(rigtwin.diagnose(recording, machine=described(tmp_path, toml=ruled_out)))


def test_a_loop_is_closed_over_any_sensor_of_position(tmp_path: Path):
    """An LVDT without noise is a position sensor: to the controller, the run and the replay."""
    loop = '[controller]\noutput = "force"\nformula = "200 * (goal - encoder)"\n\n[[replays]]'
    quiet = "white = 0.0\nhum = 0.0\nresolution = 0.0"
    found = []
    for sort in ("lvdt", "position sensor"):
        toml = TOML.replace("effects = []", f'type = "{sort}"\n{quiet}')
        machine = described(tmp_path, toml=toml.replace("[[replays]]", loop))
        wave = 0.02 * np.sin(2 * np.pi * TIME)
        recording = rigtwin.run(machine, lambda _, __, wave=wave: {"goal": wave})
        model = machine.physics.model(
            machine, recording.inputs, machine.configuration_of(recording), 4
        )
        found.append((recording["/sensor.position"], model.predict(machine.plant)[0]))
    (ran, replayed), plain = found
    assert np.ptp(ran) > 0.01
    np.testing.assert_array_equal((ran, replayed), plain)
    np.testing.assert_allclose(replayed, ran, atol=0.01 * np.ptp(ran))


def test_a_machine_without_any_tolerance_is_compared_too(tmp_path):
    time = 1e-3 * np.arange(2000)
    machine = replace(described(tmp_path, "slide"), tolerances=())
    position = 0.01 * np.sin(5.0 * time)
    recording = recording_of(machine, 10.0 * np.sin(5.0 * time), position)
    evidence = Evidence(machine, [recording], [machine.configuration_of(recording)])
    nominal = evidence.residual(evidence.plant)
    assert evidence.tolerance_responses(evidence.plant).shape == (len(nominal), 0)
    assert Space(evidence, evidence.plant).misfit(nominal) == pytest.approx(nominal @ nominal)
