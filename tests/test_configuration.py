"""Settings from outside: everything known is checked, everything unknown is refused by name."""

from __future__ import annotations

import pytest

from controllers import Mode, Settings, Skyhook
from controllers.quantity import Quantity, fields
from experiments import EXPERIMENTS
from rigtwin.description.changes import override, with_changes
from rigtwin.description.configuration import Configuration, flatten, groups, parameters
from rigtwin.errors import RigtwinError
from rigtwin.recording.schema import RECORD
from tests.helpers.settings import from_assignments

EVERY = list(parameters(Configuration()))
NUMBERS = [(key, value, meaning) for key, value, meaning in EVERY if isinstance(meaning, Quantity)]


def test_every_field_has_a_meaning():
    for name, group in groups(Configuration()).items():
        assert set(fields(type(group))) == set(group._fields), name


@pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=lambda e: e.name)
def test_every_nominal_value_is_within_its_bounds_and_has_a_source(experiment):
    for key, value, meaning in parameters(experiment.configuration):
        if isinstance(meaning, Quantity):
            assert meaning.low <= value <= meaning.high, key
            assert meaning.source
            assert meaning.unit, key


@pytest.mark.parametrize(("key", "meaning"), [(key, meaning) for key, _, meaning in NUMBERS])
@pytest.mark.parametrize("wrong", ["nan", "inf", "-inf", "below", "above", "text", ""])
def test_numbers_out_of_bounds_are_refused_by_name(key, meaning, wrong):
    value = {"below": meaning.low - 1, "above": meaning.high * 2 + 1}.get(wrong, wrong)
    with pytest.raises(RigtwinError, match=key) as error:
        from_assignments(Configuration(), [f"{key}={value}"])
    assert f"{meaning.high:g}" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("key", "value"), [(key, meaning.high) for key, _, meaning in NUMBERS])
def test_bounds_themselves_are_allowed(key, value):
    changed = from_assignments(Configuration(), [f"{key}={value!r}"])
    group, _, name = key.partition(".")
    assert getattr(groups(changed)[group], name) == value


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rail.coulom=3", "rail has coulomb"),
        ("rial.coulomb=3", "unknown group 'rial'; there are carriage, rail"),
        ("rail=3", "group.name=value"),
        ("rail.coulomb", "group.name=value"),
        ("controller.skyhook=semiactive", "none, active, semi-active"),
    ],
)
def test_what_is_unknown_is_named_with_what_there_is(text, says):
    with pytest.raises(RigtwinError, match=says):
        from_assignments(Configuration(), [text])


def test_toml(tmp_path):
    good = tmp_path / "good.toml"
    good.write_text('[rail]\ncoulomb = 60\n[controller]\nskyhook = "semi-active"\nkp = 0.5\n')
    changed = with_changes(Configuration(), good)
    assert (changed.plant.rail.coulomb, changed.controller.skyhook, changed.controller.kp) == (
        60.0,
        Skyhook.SEMI_ACTIVE,
        0.5,
    )
    for content, says in (
        ("[rail\n", "not valid TOML"),
        ("[rail]\ncoulomb = true\n", "rail.coulomb = True"),
        ("rail = 3\n", "a table of settings"),
        ("[rail]\ncoulomb = nan\n", "0 to 1000 N"),
        ("[rail]\ncoulomb = [1]\n", "rail.coulomb"),
    ):
        bad = tmp_path / "bad.toml"
        bad.write_text(content)
        with pytest.raises(RigtwinError, match=says) as error:
            with_changes(Configuration(), bad)
        assert str(bad) in str(error.value)
    with pytest.raises(RigtwinError, match="cannot read"):
        with_changes(Configuration(), tmp_path / "absent.toml")


def test_flattened_and_back():
    configuration = Configuration(controller=Settings(mode=Mode.IMPOSED, kp=0.7))
    assert override(Configuration(), flatten(configuration)) == configuration


def test_controller_keys_are_those_of_the_recording_format():
    expected = (
        "mode travel structure compensator start sprung_mass suspension_stiffness "
        "suspension_damping preload gravity skyhook "
        "skyhook_damping damping_max damping_min filter_position "
        "filter_velocity filter_force kff kp ki voltage_limit"
    )
    # Those of the format come first; a recording may leave out what this controller has besides.
    assert " ".join(Settings._fields).startswith(expected)
    assert RECORD == "rigtwin"
