"""Machines by name or file, their experiments and effects, and the twin of one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rigtwin.components import Cylinder, Effect
from rigtwin.components.cylinder import told_settings
from rigtwin.description import catalogue
from rigtwin.description.changes import POSTERIOR, Changes, read_toml, values_of, with_changes
from rigtwin.description.configuration import Configuration, parameters
from rigtwin.description.effects import apply_effects
from rigtwin.description.effects import without_effect as take_out
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader
from rigtwin.simulation.experiment import Experiment, experiments_of

Settings = Changes | Sequence[Changes]
"""Group → name → value, {"rail": {"coulomb": 60}, "timing": {"duration": 5}}; or the path of a TOML
file that holds them; or several of these, one over the other."""
Effects = Mapping[str, float | Mapping[str, float]] | Sequence[str]
"""Effect → magnitude, or → parameter → value: {"coulomb@rail": 80}; or texts as `--effect`
takes."""


def machine(name: str | Path) -> Machine:
    """A machine.

    Parameters
    ----------
    name
        Of a shipped one, see `machines`, or the path of a description, a TOML file.

    Raises
    ------
    RigtwinError
        With the first mistake in the description, or with what there is.
    """
    return catalogue.find(str(name))


def the_machine(given: Machine | str | Path) -> Machine:
    """A machine, or the one of that name or description; raises as `machine` does."""
    if isinstance(given, Machine):
        return given
    if isinstance(given, str | Path):
        return machine(given)
    raise RigtwinError(f"{given!r:.60}: expected a machine, its name, or its description's path")


def machines() -> dict[str, Path]:
    """The machines that come along: name → description."""
    return catalogue.shipped()


def machine_of(recording: reader.Recording) -> Machine:
    """Return the machine of a recording: the one that was said, the description that the recording
    remembers, or the shipped machine of that name.

    Raises
    ------
    RigtwinError
        If the machine has to be said.
    """
    described = getattr(recording, "described", None)
    if described is not None:
        return described
    remembered = recording.description
    if remembered is not None and remembered.is_file():
        found = catalogue.find(str(remembered))
        if found.name == recording.machine:
            return found
        why = f"but {remembered}, which it remembers, describes {found.name!r}"
    elif recording.machine in catalogue.shipped():
        return catalogue.find(recording.machine)
    elif remembered is not None:
        why = f"but its description {remembered} does not exist any more"
    else:
        why = f"which is none of the shipped ones, {', '.join(catalogue.shipped())}"
    raise RigtwinError(
        f"{recording.path}: it is of machine {recording.machine!r}, {why}; "
        'give its description, machine="F.toml" or --machine F.toml'
    )


def described_machine(recording: reader.Recording, given: Machine | str | Path | None) -> Machine:
    """The machine that was said, or the one that a recording names."""
    return machine_of(recording) if given is None else the_machine(given)


def experiments(of: Machine | str | Path) -> dict[str, Experiment]:
    """The experiments that a machine's description names: name → experiment."""
    return experiments_of(the_machine(of))


def effects(of: Machine | str | Path) -> list[Effect]:
    """All effects that a machine can have."""
    return list(the_machine(of).effects())


def effect_texts(given: Effects) -> list[str]:
    """Effects as `--effect` takes them: `coulomb@rail=80`."""
    try:
        if isinstance(given, Mapping):
            return [f"{name}={_values(value)}" for name, value in given.items()]
        texts = [given] if isinstance(given, str) else list(given)
        if all(isinstance(each, str) for each in texts):
            return [_require_value(each) for each in texts]
    except (TypeError, ValueError):
        pass
    raise RigtwinError(
        f"effects {given!r:.60}: expected {{'coulomb@rail': 80}}, or texts as 'coulomb@rail=80'"
    )


def _require_value(text: str) -> str:
    """An effect as text. Raises RigtwinError if it has no value."""
    if "=" not in text:
        raise RigtwinError(
            f"effect {text!r:.60} has no value; expected KIND@COMPONENT=VALUE, such as "
            "'coulomb@rail=80', or in Python {'coulomb@rail': 80}"
        )
    return text


def _values(value: float | Mapping[str, float]) -> str:
    if not isinstance(value, Mapping):
        return repr(float(value))
    first, *more = value.items()
    return ",".join([repr(float(first[1])), *(f"{name}={each!r}" for name, each in more)])


def twin_of(
    of: Machine,
    settings: Settings = (),
    taken_out: Sequence[str] = (),
    effects: Sequence[str] = (),
) -> Configuration:
    """The twin that recordings are compared with.

    Parameters
    ----------
    of
        The machine.
    settings
        Changes of its plant or of `timing.timestep`; all other settings are a recording's own.
    taken_out
        Effects that the nominal machine has and the twin is not to have.
    effects
        That the twin is given.

    Raises
    ------
    RigtwinError
        For any other setting, or an effect that is not there.
    """
    base = with_changes(of.configuration, list(tables_of(settings)))
    told = set(_told(settings))
    for (key, value, _), (_, described, _) in zip(
        parameters(base), parameters(of.configuration), strict=True
    ):
        group, _, name = key.partition(".")
        own = group in of.plant._fields or (
            group == "controller" and of.physics.compares_controller
        )
        other = key in told or value != described
        if other and not own and (group, name) != ("timing", "timestep"):
            raise RigtwinError(
                f"{key}: a comparison changes the plant and timing.timestep only; "
                "all other settings are the recording's own"
            )
    for name in taken_out:
        base = take_out(base, name)
    return apply_effects(base, effects)


def names_of(argument: str, names: Sequence[str]) -> list[str]:
    """Names of effects as an argument gives them. Raises RigtwinError for anything but a list of
    texts."""
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise RigtwinError(f"{argument} {names!r:.60}: expected a list of effects' names")
    return list(names)


def require_unrecorded(
    settings: Settings, of: Machine, recordings: Sequence[reader.Recording]
) -> None:
    """Refuse controller settings that have no effect, as the recordings state their own.

    Raises
    ------
    RigtwinError
        For a setting that is named one by one and that a recording of the machine states.
    """
    for key in _told(settings):
        group, _, name = key.partition(".")
        for recording in recordings:
            own = recording.machine == of.name and name in recording.controller
            if group == "controller" and own:
                raise RigtwinError(
                    f"{key}: {recording.path} states {recording.controller[name]} for it, and the "
                    "recording's own settings hold; expected settings of the plant, or "
                    "timing.timestep"
                )


class _Written(dict[str, Any]):
    """Tables of a file, which may hold all settings that there are."""


def _told(settings: Settings) -> Iterator[str]:
    """The settings that are named one by one."""
    if isinstance(settings, _Written):
        return
    if isinstance(settings, Mapping):
        for group, values in settings.items():
            yield from (
                f"{group}.{name}" for name in (values if isinstance(values, Mapping) else ())
            )
    elif isinstance(settings, Sequence) and not isinstance(settings, str | bytes):
        for each in settings:
            yield from _told(each)  # type: ignore[arg-type]


def tables_of(settings: Settings) -> Iterator[Mapping[str, Any]]:
    """Settings as tables, the files that they may stand in read.

    What a calibrated twin's file tells the controller of the plant is left out: it is of tests to
    come, not of those that are recorded.

    Raises
    ------
    RigtwinError
        For anything but tables and files of them.
    """
    if isinstance(settings, str | Path):
        yield _Written(read_toml(Path(settings), _of_the_plant))
    elif isinstance(settings, Mapping):
        yield settings
    elif isinstance(settings, Sequence) and not isinstance(settings, bytes):
        for each in settings:
            yield from tables_of(each)  # type: ignore[arg-type]
    else:
        raise RigtwinError(
            f"settings {settings!r:.60}: expected tables of settings, or the paths of files"
        )


def _of_the_plant(tables: Mapping[str, Any]) -> Mapping[str, Any]:
    values = values_of(tables)
    if POSTERIOR in tables and isinstance(values.get("controller"), Mapping):
        told = told_settings(Cylinder())
        own = {name: value for name, value in values["controller"].items() if name not in told}
        values = {**values, "controller": own}
    return values
