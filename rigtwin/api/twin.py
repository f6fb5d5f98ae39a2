"""Twin of a machine: settings that change it, and effects added to it or removed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rigtwin.components import Cylinder
from rigtwin.components.cylinder import told_settings
from rigtwin.description.changes import POSTERIOR, Changes, read_toml, values_of, with_changes
from rigtwin.description.configuration import Configuration, parameters
from rigtwin.description.effects import apply_effects, without_effect
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader

Settings = Changes | Sequence[Changes]
"""Changes of settings: group → name → value, such as {"rail": {"coulomb": 60}, "timing":
{"duration": 5}}; or the path of a TOML file with such tables; or a sequence of both, of which a
later entry overrides an earlier one."""
Effects = Mapping[str, float | Mapping[str, float]] | Sequence[str]
"""Effects with their values: effect → magnitude, such as {"coulomb@rail": 80}; or effect →
parameter → value; or texts in the form of the option `--effect`, such as "coulomb@rail=80"."""


def effect_texts(effects: Effects) -> list[str]:
    """Return effects in the form of the option `--effect`: `coulomb@rail=80`.

    Raises
    ------
    RigtwinError
        If an effect has no value, or for any other type.
    """
    try:
        if isinstance(effects, Mapping):
            return [f"{name}={_values(value)}" for name, value in effects.items()]
        texts = [effects] if isinstance(effects, str) else list(effects)
        if all(isinstance(text, str) for text in texts):
            return [_require_value(text) for text in texts]
    except (TypeError, ValueError):
        # The common message below shows both accepted forms.
        pass
    raise RigtwinError(
        f"effects {effects!r:.60}: expected {{'coulomb@rail': 80}}, or texts as 'coulomb@rail=80'"
    )


def _require_value(text: str) -> str:
    """Return an effect's text. Raises RigtwinError if it has no value."""
    if "=" not in text:
        raise RigtwinError(
            f"effect {text!r:.60} has no value; expected KIND@COMPONENT=VALUE, such as "
            "'coulomb@rail=80', or in Python {'coulomb@rail': 80}"
        )
    return text


def _values(value: float | Mapping[str, float]) -> str:
    """Return an effect's values as text; the first parameter's name is left out."""
    if not isinstance(value, Mapping):
        return repr(float(value))
    # An effect's main parameter comes first, and its name is implied by the effect's.
    first, *rest = value.items()
    return ",".join([repr(float(first[1])), *(f"{name}={number!r}" for name, number in rest)])


def twin_of(
    machine: Machine,
    settings: Settings = (),
    removed: Sequence[str] = (),
    effects: Sequence[str] = (),
) -> Configuration:
    """Return the configuration of the twin that recordings are compared with.

    Parameters
    ----------
    machine
        Machine of the twin.
    settings
        Changes of the plant or of `timing.timestep`. All other settings are the recording's own.
    removed
        Effects of the nominal machine that are removed from the twin.
    effects
        Effects added to the twin, `KIND@COMPONENT=VALUE`.

    Raises
    ------
    RigtwinError
        If another setting changes, or an effect does not exist.
    """
    base = with_changes(machine.configuration, list(tables_of(settings)))
    stated = set(_named_settings(settings))
    for (key, value, _), (_, nominal, _) in zip(
        parameters(base), parameters(machine.configuration), strict=True
    ):
        group, _, name = key.partition(".")
        allowed = (
            group in machine.plant._fields
            or (group == "controller" and machine.physics.compares_controller)
            # The integration step belongs to the twin, not to the test.
            or (group, name) == ("timing", "timestep")
        )
        # A setting that repeats the nominal value is refused too if it was named: silently
        # accepting it would suggest that it has an effect.
        changes = key in stated or value != nominal
        if changes and not allowed:
            raise RigtwinError(
                f"{key}: a comparison changes the plant and timing.timestep only; "
                "all other settings are the recording's own"
            )
    for name in removed:
        base = without_effect(base, name)
    # Removed effects first: an effect may be replaced by another value of itself.
    return apply_effects(base, effects)


def names_of(argument: str, names: Sequence[str]) -> list[str]:
    """Return the effects' names of an argument as a list.

    Raises
    ------
    RigtwinError
        For anything but a list of texts. The message names `argument`.
    """
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise RigtwinError(f"{argument} {names!r:.60}: expected a list of effects' names")
    return list(names)


def require_unrecorded(
    settings: Settings, machine: Machine, recordings: Sequence[reader.RecordedTest]
) -> None:
    """Refuse controller settings that have no effect because the recordings state their own.

    Raises
    ------
    RigtwinError
        For a setting that is named one by one and that a recording of the machine states.
    """
    for key in _named_settings(settings):
        group, _, name = key.partition(".")
        for recording in recordings:
            recorded = recording.machine == machine.name and name in recording.controller
            if group == "controller" and recorded:
                raise RigtwinError(
                    f"{key}: {recording.path} states {recording.controller[name]} for it, and the "
                    "recording's own settings hold; expected settings of the plant, or "
                    "timing.timestep"
                )


class _FileTables(dict[str, Any]):
    """Tables read from a file.

    A file may hold every setting of a machine, of which a comparison uses the plant's. So its
    settings do not count as named one by one (`_named_settings`).
    """


def _named_settings(settings: Settings) -> Iterator[str]:
    """Yield `group.name` of all settings that the caller names one by one, not in a file."""
    if isinstance(settings, _FileTables):
        return
    if isinstance(settings, Mapping):
        for group, values in settings.items():
            yield from (
                f"{group}.{name}" for name in (values if isinstance(values, Mapping) else ())
            )
    elif isinstance(settings, Sequence) and not isinstance(settings, str | bytes):
        for entry in settings:
            yield from _named_settings(entry)  # type: ignore[arg-type]


def tables_of(settings: Settings) -> Iterator[Mapping[str, Any]]:
    """Yield settings as tables; files are read.

    Settings by which a calibrated twin's file informs the controller about the plant are left out.
    They hold for later tests: the controller of a recorded test did not have them.

    Raises
    ------
    RigtwinError
        For anything but tables and files of tables.
    """
    if isinstance(settings, str | Path):
        yield _FileTables(read_toml(Path(settings), _without_told_settings))
    elif isinstance(settings, Mapping):
        yield settings
    elif isinstance(settings, Sequence) and not isinstance(settings, bytes):
        for entry in settings:
            yield from tables_of(entry)  # type: ignore[arg-type]
    else:
        raise RigtwinError(
            f"settings {settings!r:.60}: expected tables of settings, or the paths of files"
        )


def _without_told_settings(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a file's settings without those that inform the controller about the plant."""
    values = values_of(tables)
    # Only a calibrated twin has a posterior; a hand-written file keeps all its settings.
    if POSTERIOR in tables and isinstance(values.get("controller"), Mapping):
        informed = told_settings(Cylinder())
        controller = {
            name: value for name, value in values["controller"].items() if name not in informed
        }
        values = {**values, "controller": controller}
    return values
