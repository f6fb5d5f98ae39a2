"""Declared values that the data determine only together with fitted ones, and what is said."""

from __future__ import annotations

from pathlib import Path

import pytest

import rigtwin
from rigtwin.diagnosis.confounded_text import describe_confounded
from rigtwin.diagnosis.finding import Confounded, Name
from tests.test_servo import ONE, machine_in, model_text, recorded

WEIGHTLESS = '<option gravity="0 0 0"'


def arm_in(folder: Path) -> rigtwin.Machine:
    """Return a servo's arm without gravity whose mass may differ from the declared one."""
    toml = ONE.replace('body = "upper", effects = []', 'body = "upper", effects = ["mass"]')
    return machine_in(folder, toml, weightless(model_text(two=False)))


def weightless(text: str) -> str:
    return text.replace('<option gravity="0 0 -9.81"', WEIGHTLESS)


@pytest.fixture(scope="module")
def stiffer(tmp_path_factory: pytest.TempPathFactory) -> rigtwin.Diagnosis:
    """Diagnose a servo whose gains are four times the declared ones."""
    machine = arm_in(tmp_path_factory.mktemp("arm"))
    recording = recorded(weightless(model_text(two=False, kp=80.0, kv=4.0)))
    return rigtwin.diagnose(recording, machine=machine)


def test_gains_four_times_the_declared_ones_are_named_before_a_quarter_of_the_mass(
    stiffer: rigtwin.Diagnosis,
) -> None:
    (gains,) = stiffer.effects
    assert str(gains.name) == "gains@servo"
    assert gains.parameters["gains"].value == pytest.approx(4.0, rel=0.04)


def test_the_answer_says_that_the_gains_hold_for_the_declared_mass(
    stiffer: rigtwin.Diagnosis,
) -> None:
    (entry,) = (e for e in stiffer.answer.confounded if e.assumed == Name("arm", "mass"))
    powers = {str(name): power for name, power in entry.exponents}
    assert powers["gains@servo"] == pytest.approx(1.0, abs=0.2)
    assert "if mass@arm is" in str(stiffer)
    (document,) = (e for e in stiffer.document()["confounded"] if e["component"] == "arm")
    assert document["kind"] == "mass"


def test_a_mass_that_gravity_shows_is_not_confounded(tmp_path: Path) -> None:
    toml = ONE.replace('body = "upper", effects = []', 'body = "upper", effects = ["mass"]')
    machine = machine_in(tmp_path, toml, model_text(two=False))
    # With gravity, the angle at which the arm hangs tells its mass from the gain.
    answer = rigtwin.diagnose(recorded(model_text(two=False, kp=15.0)), machine=machine)
    assert [str(effect.name) for effect in answer.effects] == ["position_gain@servo"]
    assert answer.answer.confounded == ()


@pytest.mark.parametrize(
    ("power", "words"),
    [
        (1.0, "coulomb@pivot is proportional to it"),
        (-1.05, "coulomb@pivot is inversely proportional to it"),
        (0.5, "coulomb@pivot changes by +0.5 % with each percent of it"),
    ],
)
def test_a_dependence_is_told_in_words(power: float, words: str) -> None:
    entry = Confounded(Name("bob", "mass"), 3.45, "kg", ((Name("pivot", "coulomb"), power),))
    text = describe_confounded(entry)
    assert text == f"these values hold if mass@bob is 3.45 kg, which the data do not show: {words}"


def test_the_report_says_what_the_values_depend_on(
    stiffer: rigtwin.Diagnosis, tmp_path: Path
) -> None:
    stiffer.report(tmp_path / "why.html")
    assert "These values hold if mass@arm is" in (tmp_path / "why.html").read_text()
