"""What is said before the judgement."""

from __future__ import annotations

import pytest

import rigtwin

RIG = "suspension-rig"
SHORT = {"timing": {"duration": 6.0}}


def looks_at(**effects: float) -> tuple[list[rigtwin.FirstLook], rigtwin.Diagnosis]:
    named = {name.replace("__", "@"): value for name, value in effects.items()}
    test = rigtwin.run(RIG, "imposed", effects=named, settings=SHORT)
    found: list[rigtwin.FirstLook] = []
    return found, rigtwin.diagnose(test, first_look=found.append)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value", "sensor"),
    [
        ("coulomb__rail", 90.0, "suspension_lvdt"),
        pytest.param("gain__load_cell", 1.05, "load_cell", marks=pytest.mark.slow),
    ],
)
def test_what_is_there_is_among_the_suspects(name, value, sensor):
    found, answer = looks_at(**{name: value})
    (look,) = found
    suspects = [str(suspect) for suspect, _ in look.suspects]
    assert name.replace("__", "@") in suspects
    assert all(0.0 < share <= 1.0 for _, share in look.suspects)
    assert look.gap[sensor] > 1.5
    assert [str(effect.name) for effect in answer.effects] == [name.replace("__", "@")]
    assert "suspects" in str(look)


@pytest.mark.slow
def test_where_nothing_is_there_is_no_suspect():
    (look,), answer = looks_at()
    assert answer.verdict == "no gap"
    assert look.suspects == ()
    assert all(0.9 < level < 1.1 for level in look.gap.values())
    assert str(look).startswith("no significant gap")


@pytest.mark.slow
def test_the_command_says_it_before_the_answer(capfd, tmp_path):
    from rigtwin.cli import main

    path = tmp_path / "rig.mcap"
    rigtwin.run(RIG, "imposed", effects={"coulomb@rail": 90.0}, settings=SHORT, path=path)
    assert main(["diagnose", str(path)]) == 0
    said = capfd.readouterr()
    assert said.err.startswith("first look, ")
    assert "coulomb@rail" in said.err
    assert said.out.startswith("explained: ")
