"""Arguments of other types than a function takes are one clear line."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any, Literal

import numpy as np
import pytest

import rigtwin
from rigtwin.api.arguments import check_arguments, describe, fits
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table_file import find_table

FUNCTIONS = {
    name: value
    for name in rigtwin.__all__
    if isinstance(value := getattr(rigtwin, name), FunctionType)
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_can_be_sent_to_another_process(name: str) -> None:
    assert pickle.loads(pickle.dumps(FUNCTIONS[name])) is FUNCTIONS[name]


@pytest.mark.parametrize(
    ("value", "expected", "fit"),
    [
        (1, int, True),
        (np.int64(1), int, True),
        (1.5, int, False),
        (True, int, False),
        (True, bool, True),
        (np.float64(1.5), float, True),
        (1, float, True),
        ("1", float, False),
        (None, int | None, True),
        ("a", str | Path, True),
        (5, str | Path, False),
        ("abc", Sequence[str], False),
        (["a", 1], Sequence[str], False),
        (("a", "b"), Sequence[str], True),
        ({"a": {"b": 1}}, Mapping[str, Mapping[str, object]], True),
        ({"a": 1}, Mapping[str, Mapping[str, object]], False),
        (print, Callable[[str], object], True),
        ("print", Callable[[str], object], False),
        ("wild", Literal["wild", "arm"], True),
        ("mild", Literal["wild", "arm"], False),
        (object(), Any, True),
        (None, None, True),
    ],
)
def test_a_value_fits_a_type_or_does_not(value: object, expected: object, fit: bool) -> None:
    assert fits(value, expected) is fit


def test_types_are_told_in_words() -> None:
    assert describe(int | None) == "a whole number or None"
    assert describe(str | Path) == "text or a path"
    assert describe(Sequence[str]) == "a list, each text"
    assert describe(Mapping[str, float] | Literal["a"]) == "a table or 'a'"
    assert describe(Callable[[int], object]) == "a function"


DROP = {"settings": {"timing": {"duration": 1.0}}}
WRONG: list[tuple[str, tuple[object, ...], dict[str, object], str]] = [
    ("diagnose", (5,), {}, "5: expected a recording"),
    ("diagnose", ("a\0b",), {}, "without a null character"),
    ("load", ("a\0b",), {}, "without a null character"),
    ("load", (5,), {}, "path 5: expected text or a path"),
    ("stability", ("truck",), {"changes": 5}, "changes 5: expected a table or None"),
    ("run", ("suspension-rig", "drop"), {"settings": 5}, "settings 5"),
    ("run", ("suspension-rig", "drop"), {"path": 5}, "path 5: expected text, a path or None"),
    ("run", ("suspension-rig", "drop"), {**DROP, "seed": "x"}, "seed 'x'"),
    ("run", ("suspension-rig", "drop"), {**DROP, "effects_from": "x"}, "effects_from 'x'"),
    ("import_data", (5, "x", "y"), {}, "5"),
    ("blindcheck", ("x",), {"folder": "f"}, "'x': expected a whole number"),
    ("faults", (), {"seed": "x"}, "seed 'x': expected a whole number"),
    ("tune", (5,), {}, "study 5: expected text"),
    ("tune", ("skyhook",), {"seed": "x"}, "seed 'x': expected a whole number"),
    ("tune", ("skyhook",), {"settings": 5}, "settings 5: expected a list, each text"),
    ("reproduce", (5,), {}, "part 5: expected text or None"),
    ("machine", (5,), {}, "5"),
]


@pytest.mark.parametrize(("name", "values", "named", "said"), WRONG)
def test_a_wrong_type_is_said(
    name: str,
    values: tuple[object, ...],
    named: dict[str, object],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(rigtwin.RigtwinError) as told:
        FUNCTIONS[name](*values, **named)
    assert said in str(told.value)
    assert "\n" not in str(told.value)


def test_a_failure_of_right_arguments_stays_what_it_is() -> None:
    """As of a controller that a user wrote: where it failed is what is wanted then."""

    @check_arguments
    def fail(number: int) -> int:
        return number // "text"  # type: ignore[operator]

    with pytest.raises(TypeError, match="unsupported operand"):
        fail(1)
    with pytest.raises(rigtwin.RigtwinError, match="number 'x': expected a whole number"):
        fail("x")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="unexpected keyword"):
        fail(numbers=1)  # type: ignore[call-arg]


def test_a_truth_value_is_no_number():
    with pytest.raises(RigtwinError, match="cases True: expected a whole number"):
        rigtwin.blindcheck(True)


@pytest.mark.parametrize("effects", ["coulomb@guide", ["coulomb@guide"]])
def test_an_effect_without_a_value_is_answered_in_terms_of_python_too(effects):
    with pytest.raises(RigtwinError) as caught:
        rigtwin.run("emps", "positioning", effects=effects)
    assert "effect 'coulomb@guide' has no value" in str(caught.value)
    assert "in Python {'coulomb@rail': 80}" in str(caught.value)
    assert "--" not in str(caught.value)


def test_a_misspelt_effect_has_a_suggestion():
    with pytest.raises(RigtwinError, match=r"'coulomb@gide'; did you mean 'coulomb@guide'\?"):
        rigtwin.run("emps", "positioning", effects={"coulomb@gide": 10.0})
    machine = rigtwin.machine("emps")
    with pytest.raises(RigtwinError, match=r"cannot exclude 'delay@drve': .* 'delay@drive'\?"):
        machine.excluding(["delay@drve"])


def test_effects_that_are_excluded_are_not_searched_for():
    machine = rigtwin.machine("emps")
    some = machine.excluding(["delay", "coulomb@guide"])
    left = {effect.name for effect in rigtwin.effects(some)}
    gone = {effect.name for effect in rigtwin.effects(machine)} - left
    assert "coulomb@guide" in gone
    assert {name.partition("@")[0] for name in gone} == {"delay", "coulomb"}


def test_a_setting_that_the_recording_states_is_not_ignored_in_silence(tmp_path):
    recording = rigtwin.run("emps", "positioning", settings={"timing": {"duration": 2}})
    for value in (100.0, 160.18):
        with pytest.raises(RigtwinError, match=r"controller.kp: .* states 160.18 for it"):
            rigtwin.compare(recording, settings={"controller": {"kp": value}})


def test_a_delay_of_the_controller_needs_one_that_is_described():
    arm = rigtwin.machine("cart-pole")
    assert arm.control is None
    assert not any(each.group == "computer" for each in rigtwin.effects(arm))
    rig = rigtwin.machine("suspension-rig")
    assert any(each.group == "computer" for each in rigtwin.effects(rig))


@pytest.mark.parametrize("name", ["pci-6229", "pci-6229.toml", "cart_pole", "cart-pole.toml"])
def test_a_shipped_channel_table_is_found_by_its_name(name):
    assert find_table(Path(name)).is_file()


def test_a_channel_table_that_does_not_exist_lists_the_shipped_ones(tmp_path):
    with pytest.raises(RigtwinError, match="card.toml does not exist; shipped ones: cart"):
        find_table(tmp_path / "card.toml")
