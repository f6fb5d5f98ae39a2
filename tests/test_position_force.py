"""A smooth force over the stroke: found at its shape, and only where no simpler effect will do."""

from __future__ import annotations

import numpy as np
import pytest

import rigtwin
from rigtwin.components import Guide
from rigtwin.components.guide_force import curve, curve_points, position_force
from rigtwin.diagnosis.text import describe
from tests.helpers.described import NOISY, described

HARDENING = ("position_force@guide=0.0,curve_3=15.0,curve_half_range=0.4", "stiffness@guide=240")
"""A spring of 127.5 N/m whose force grows by 60 N·(x/0.4 m)³."""
CABLE = ("position_force@guide=-8.0,curve_3=6.0,curve_half_range=0.4",)
"""A cable that pulls more on one side."""


SETTINGS = {"timing": {"duration": 4.0}}


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> rigtwin.Machine:
    folder = tmp_path_factory.mktemp("bench")
    described(folder, "slide", NOISY)
    return rigtwin.machine(folder / "bench.toml")


@pytest.fixture(scope="module")
def pulled(machine: rigtwin.Machine) -> rigtwin.Diagnosis:
    recording = rigtwin.run(machine, "shake", seed=1, effects=CABLE, settings=SETTINGS)
    return rigtwin.diagnose(recording)


@pytest.mark.slow
def test_a_hardening_spring_is_a_cubic_spring(machine: rigtwin.Machine):
    recording = rigtwin.run(machine, "shake", seed=1, effects=HARDENING, settings=SETTINGS)
    answer = rigtwin.diagnose(recording)
    assert answer.verdict == "explained", answer.sentence
    values = {str(finding.name): finding.parameters for finding in answer.effects}
    assert set(values) == {"cubic_stiffness@guide", "stiffness@guide"}
    cubic = values["cubic_stiffness@guide"]["cubic_stiffness"].value
    assert cubic == pytest.approx(60.0 / 0.4**3, rel=0.01)
    assert values["stiffness@guide"]["stiffness"].value == pytest.approx(127.5, rel=0.01)


@pytest.mark.slow
def test_a_cable_is_found_at_its_forces(pulled: rigtwin.Diagnosis):
    assert pulled.verdict == "explained", pulled.sentence
    assert "position_force@guide" in {str(finding.name) for finding in pulled.effects}
    guide = pulled.corrected.plant.guide
    for position in np.linspace(-0.3, 0.3, 7):
        share = position / 0.4
        expected = -8.0 * (2.0 * share**2 - 1.0) + 6.0 * (4.0 * share**3 - 3.0 * share)
        assert position_force(guide, position, 0.0) == pytest.approx(
            150.0 * position + expected, abs=1.5
        )


@pytest.mark.slow
def test_it_is_told_by_its_forces_and_not_by_a_coefficient(pulled: rigtwin.Diagnosis):
    assert "position-dependent force from -" in pulled.sentence
    assert "over the stroke" in pulled.sentence
    assert "force at a position: " in describe(pulled.answer)


@pytest.mark.slow
def test_the_corrected_twin_has_it(pulled: rigtwin.Diagnosis):
    guide = pulled.corrected.plant.guide
    finding = next(found for found in pulled.effects if found.curve)
    assert [curve(guide, place) for place, _ in finding.curve] == pytest.approx(
        [force for _, force in finding.curve]
    )


@pytest.mark.slow
def test_a_spring_stays_a_spring(machine: rigtwin.Machine):
    recording = rigtwin.run(
        machine, "shake", seed=1, effects=["stiffness@guide=700"], settings=SETTINGS
    )
    (finding,) = rigtwin.diagnose(recording).effects
    assert str(finding.name) == "stiffness@guide"


def test_a_curve_is_told_from_end_to_end():
    values = Guide(curve_2=5.0, curve_middle=0.1, curve_half_range=0.2)._asdict()
    points = curve_points(values)
    assert [place for place, _ in points] == pytest.approx(np.linspace(-0.1, 0.3, 7))
    assert points[0][1] == points[-1][1] == pytest.approx(5.0)
    assert points[3][1] == pytest.approx(-5.0)
