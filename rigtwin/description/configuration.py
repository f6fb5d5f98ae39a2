"""The settings of a test, by name: the plant's components, the controller, safety limits, road,
simulation.

One type for every machine. What a machine does not have (a road, say) is a group without settings.

`override` is the one way in from outside: TOML files, `--set`, recordings. Every key and value is
checked.
"""

from __future__ import annotations

import math
import tomllib
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

from controllers import Settings
from rigtwin.components import RigPlant, candidates, find
from rigtwin.components.effect import Effect
from rigtwin.components.plant import Plant
from rigtwin.components.quantity import Choice, Quantity, fields
from rigtwin.errors import RigtwinError

Applied = TypeVar("Applied")
P = TypeVar("P", bound=Plant)
C = TypeVar("C", bound=tuple)
POSTERIOR = "posterior"
"""The table of a calibrated twin's file beside its values; rigtwin.description.posterior reads
it."""
MOST_TICKS = 100_000_000
"""More than a day at 1 kHz."""


class Safety(NamedTuple):
    """Limits that end a test, on raw measurements and on commands; how a session starts and
    stops."""

    structure: Annotated[float, Quantity("m", 1e-3, 10.0, "trip of the lab: |structure_lvdt|")] = (
        0.15
    )
    force: Annotated[float, Quantity("N", 1.0, 1e7, "trip of the lab: |load_cell|")] = 1500.0
    travel: Annotated[float, Quantity("m", 1e-3, 10.0, "the motor's stroke: |suspension_lvdt|")] = (
        0.21
    )
    ground: Annotated[
        float, Quantity("m", 1e-3, 10.0, "|ground_lvdt| and its command; assumed stroke")
    ] = 0.25
    velocity: Annotated[
        float, Quantity("m/s", 1e-3, 100.0, "of travel over 10 ticks; half the motor's 4.4 m/s")
    ] = 2.2
    lvdt_rate: Annotated[
        float, Quantity("m/s", 1e-3, 1e3, "change of an LVDT in a tick; 3 times the experiments'")
    ] = 2.0
    force_rate: Annotated[
        float,
        Quantity("N/s", 1.0, 1e9, "change of the load cell in a tick; 3 times the experiments'"),
    ] = 3e5
    command_rate: Annotated[
        float, Quantity("m/s", 1e-3, 1e3, "position commands; 7 times what the cylinders follow")
    ] = 2.0
    voltage_rate: Annotated[
        float, Quantity("V/s", 1.0, 1e6, "4 times the experiments'; less than force_rate shows")
    ] = 2500.0
    following: Annotated[
        float, Quantity("m", 1e-4, 100.0, "cylinder off its command; 1.6 times the experiments'")
    ] = 0.06
    following_force: Annotated[
        float, Quantity("N", 1.0, 1e8, "load cell off its demand; 2.6 times the experiments'")
    ] = 400.0
    stuck: Annotated[
        float,
        Quantity("tick", 3.0, 1e9, "same reading in a row; a card's channel table says how many"),
    ] = 1e9
    wheel: Annotated[
        float, Quantity("m", 1e-4, 1e9, "wheel off the ground plate; a card's channel table says")
    ] = 1e9
    motor: Annotated[
        float,
        Quantity("N", 1.0, 1e9, "load cell off the voltage's force; a card's channel table says"),
    ] = 1e9
    hysteresis: Annotated[
        float, Quantity("1", 0.0, 0.9, "share of a limit to be back inside before arming")
    ] = 0.1
    missed: Annotated[
        float, Quantity("tick", 0.0, 1e6, "that may be missed in a row; a fifth of all")
    ] = 3.0
    ramp: Annotated[float, Quantity("s", 0.05, 600.0, "cosine to the start of a test and back")] = (
        2.0
    )
    hold: Annotated[
        float, Quantity("s", 0.0, 600.0, "cylinders hold after a stop before pressure is taken off")
    ] = 0.5


class Timing(NamedTuple):
    """Clocks of a test."""

    duration: Annotated[float, Quantity("s", 0.01, 86_400.0, "the experiment")] = 20.0
    period: Annotated[float, Quantity("s", 1e-4, 0.1, "1 kHz, assumed")] = 1e-3
    timestep: Annotated[
        float, Quantity("s", 1e-5, 0.01, "integration step, docs/architecture.md")
    ] = 2.5e-4


class Road(NamedTuple):
    """Pseudo-random road: spectral density roughness / wavenumber^exponent, thesis Eq. 6.3."""

    roughness: Annotated[
        float, Quantity("m^2/(cycle/m)", 0.0, 1e-2, "motorway, thesis Eq. 6.3")
    ] = 7e-8
    exponent: Annotated[float, Quantity("1", 0.0, 5.0, "thesis Eq. 6.3")] = 2.5
    speed: Annotated[float, Quantity("m/s", 0.1, 150.0, "thesis §6.3")] = 25.0 / 3.6
    lowest: Annotated[float, Quantity("Hz", 1e-3, 50.0, "thesis §6.3.2")] = 0.02
    highest: Annotated[float, Quantity("Hz", 1e-3, 50.0, "thesis §6.3.2")] = 1.6
    spacing: Annotated[
        float, Quantity("Hz", 1e-3, 50.0, "the lowest frequency where not given")
    ] = 0.02


class Nothing(NamedTuple):
    """A group of settings that a machine does not have."""


class Configuration(NamedTuple, Generic[P, C]):
    """All settings of one test of one machine; by default of the nominal suspension rig.

    Keys are `group.name`, e.g. `rail.coulomb`, `controller.kp`, `timing.duration`. plant and
    controller are NamedTuples, of whatever components and settings the machine has.
    """

    plant: P = RigPlant()  # type: ignore[assignment]
    controller: C = Settings()  # type: ignore[assignment]
    safety: Safety = Safety()
    timing: Timing = Timing()
    road: Road = Road()

    @property
    def substeps(self) -> int:
        """Integration steps a tick. Raises RigtwinError unless the period is a whole multiple of
        the timestep."""
        ratio = self.timing.period / self.timing.timestep
        if ratio < 0.999 or abs(ratio - round(ratio)) > 1e-6:
            raise RigtwinError(
                f"timing.period = {self.timing.period:g} s must be a whole multiple of "
                f"timing.timestep = {self.timing.timestep:g} s; here it is {ratio:.4g} times"
            )
        return round(ratio)

    @property
    def ticks(self) -> int:
        """Ticks in the test, at least one. Raises RigtwinError for more than fit into memory."""
        ticks = max(1, round(self.timing.duration / self.timing.period))
        if ticks > MOST_TICKS:
            raise RigtwinError(
                f"timing.duration / timing.period = {ticks} ticks: expected at most {MOST_TICKS}"
            )
        return ticks


def settings_of(values: Mapping[str, float], source: str) -> tuple[float, ...]:
    """Numbers by name as a group of settings.

    Parameters
    ----------
    values
        Name → number.
    source
        Where they come from, in words.

    Returns
    -------
    tuple
        A NamedTuple whose fields say that any number is allowed.
    """
    made = namedtuple("Settings", list(values), defaults=list(values.values()))  # type: ignore[misc]
    made.__annotations__ = {
        name: Annotated[float, Quantity("1", -1e300, 1e300, source)] for name in values
    }
    return made()


def groups(configuration: Configuration) -> dict[str, Any]:
    """The groups of settings.

    Parameters
    ----------
    configuration
        Of any machine.

    Returns
    -------
    dict
        Name → NamedTuple: the plant's components side by side with the rest; none that is empty.
    """
    rest = {
        name: value
        for name, value in configuration._asdict().items()
        if name != "plant" and len(value)
    }
    return {**configuration.plant._asdict(), **rest}


def flatten(configuration: Configuration) -> dict[str, dict[str, float | str]]:
    """The settings as TOML and recordings hold them.

    Parameters
    ----------
    configuration
        Of any machine.

    Returns
    -------
    dict
        Group → name → number or label.
    """
    return {
        name: {
            key: value.label if isinstance(value, Choice) else float(value)
            for key, value in group._asdict().items()
        }
        for name, group in groups(configuration).items()
    }


def parameters(configuration: Configuration) -> Iterator[tuple[str, Any, Quantity | type[Choice]]]:
    """(key, value, what it means) of every setting."""
    for name, group in groups(configuration).items():
        for key, meaning in fields(type(group)).items():
            yield f"{name}.{key}", getattr(group, key), meaning


def check_value(key: str, value: object, meaning: Quantity | type[Choice]) -> float | Choice:
    """The value of a setting, if it is allowed.

    Parameters
    ----------
    key
        Its name, for the message.
    value
        A number, or a label.
    meaning
        What is allowed.

    Returns
    -------
    float or Choice
        The value.

    Raises
    ------
    RigtwinError
        Naming the key and what is allowed.
    """
    if not isinstance(meaning, Quantity):
        try:
            return meaning.parse(str(value))
        except ValueError as error:
            raise RigtwinError(f"{key}: {error}") from None
    try:
        number = (
            float(value)
            if isinstance(value, str | int | float) and not isinstance(value, bool)
            else math.nan
        )
    except (ValueError, OverflowError):
        number = math.nan
    if not (meaning.low <= number <= meaning.high):
        unit = "" if meaning.unit == "1" else f" {meaning.unit}"
        raise RigtwinError(
            f"{key} = {str(value)[:40]}: expected a number from "
            f"{meaning.low:g} to {meaning.high:g}{unit}"
        )
    return number


def override(
    configuration: Configuration, changes: Mapping[str, Mapping[str, object]]
) -> Configuration:
    """The configuration with changes.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    changes
        Group → name → value.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        For any key or value that is not allowed.
    """
    plant, rest = configuration.plant, configuration
    known = groups(configuration)
    for group_name, values in changes.items():
        if group_name not in known:
            raise RigtwinError(f"unknown group {group_name!r}; there are {', '.join(known)}")
        if not isinstance(values, Mapping):
            raise RigtwinError(
                f"{group_name} = {values!r}: expected a table of settings, such as [{group_name}]"
            )
        group = known[group_name]
        meanings = fields(type(group))
        for key, value in values.items():
            if key not in meanings:
                raise RigtwinError(
                    f"unknown setting {group_name}.{key}; {group_name} has {', '.join(meanings)}"
                )
            group = group._replace(
                **{key: check_value(f"{group_name}.{key}", value, meanings[key])}
            )
        if group_name in plant._fields:
            plant = plant._replace(**{group_name: group})
        else:
            rest = rest._replace(**{group_name: group})
    return rest._replace(plant=plant)


def read_toml(path: Path, apply: Callable[[Mapping[str, Any]], Applied]) -> Applied:
    """What a function makes of a TOML file's tables.

    Parameters
    ----------
    path
        Of the file.
    apply
        The function.

    Returns
    -------
    object
        What it returns.

    Raises
    ------
    RigtwinError
        Naming file and fault.
    """
    try:
        return apply(tomllib.loads(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise RigtwinError(f"{path} is not valid TOML: {error}") from None
    except RigtwinError as error:
        raise RigtwinError(f"{path}: {error}") from None


def parse_assignments(assignments: Sequence[str]) -> Iterator[dict[str, dict[str, str]]]:
    """group → name → value of each `group.name=value` text, as `--set` takes them. Raises
    RigtwinError for any other."""
    for text in assignments:
        key, equals, value = text.partition("=")
        group, dot, name = key.strip().partition(".")
        if not (equals and dot):
            raise RigtwinError(f"--set {text}: expected group.name=value, such as rail.coulomb=60")
        yield {group: {name: value.strip()}}


def from_toml(configuration: Configuration, path: Path) -> Configuration:
    """The configuration with a TOML file's settings.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    path
        Of the file.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        Naming file and fault.
    """
    return read_toml(path, lambda tables: override(configuration, values_of(tables)))


def values_of(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration file's tables without that of a calibrated twin which says how sure its
    values are."""
    return {name: table for name, table in tables.items() if name != POSTERIOR}


def from_assignments(configuration: Configuration, assignments: Sequence[str]) -> Configuration:
    """The configuration with settings as `--set` takes them.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    assignments
        `group.name=value` each.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        For any other text, key or value.
    """
    for changes in parse_assignments(assignments):
        configuration = override(configuration, changes)
    return configuration


Changes = Mapping[str, Mapping[str, object]] | str | Path
"""Group → name → value, or the path of a TOML file that holds them."""


def with_changes(
    configuration: Configuration, changes: Changes | Sequence[Changes]
) -> Configuration:
    """The configuration with changes, or with several, one over the other.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    changes
        Group → name → value, a TOML file, or several of them.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        For any that is not allowed.
    """
    if isinstance(changes, str | Path):
        return from_toml(configuration, Path(changes))
    if isinstance(changes, Mapping):
        return override(configuration, changes)
    for each in changes:
        configuration = with_changes(configuration, each)
    return configuration


def with_effect(
    configuration: Configuration, effect: Effect, values: Mapping[str, float]
) -> Configuration:
    """The configuration with an effect.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    effect
        One that the plant can have.
    values
        Parameter → value.

    Returns
    -------
    Configuration
        With it.

    Raises
    ------
    RigtwinError
        For a value out of bounds.
    """
    return override(configuration, {effect.group: values})


def without_effect(configuration: Configuration, name: str) -> Configuration:
    """The configuration with an effect of the nominal machine taken out: its magnitude set to 0.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    name
        Such as `coulomb@rail`.

    Returns
    -------
    Configuration
        Without it.

    Raises
    ------
    RigtwinError
        If the machine has none of it to take out.
    """
    effect = find(name, configuration.plant)
    if not _is_removable(effect, configuration.plant):
        there = [
            each.name
            for each in candidates(configuration.plant)
            if _is_removable(each, configuration.plant)
        ]
        raise RigtwinError(
            f"--without {name}: the twin has none to take out; it has {', '.join(there) or 'none'}"
        )
    return with_effect(configuration, effect, {effect.kind.parameters[0]: 0.0})


def _is_removable(effect: Effect, plant: Plant) -> bool:
    parameter, quantity = next(iter(effect.quantities().items()))
    there = effect.nominal(plant)[parameter]
    return effect.searched and there not in (0.0, quantity.high) and quantity.low <= 0.0


def apply_effects(configuration: Configuration, texts: Sequence[str]) -> Configuration:
    """The configuration with effects as `--effect` takes them.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    texts
        `coulomb@rail=80`, `stribeck@rail=20,stribeck_velocity=0.02`, or `setting@controller=kp:0.5`
        for a setting that is not what the recording will say.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        Naming the effect and what is allowed.
    """
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals:
            raise RigtwinError(
                f"--effect {text}: expected KIND@COMPONENT=VALUE, such as coulomb@rail=80"
            )
        if name == "setting@controller":
            key, _, value = values.partition(":")
            configuration = override(configuration, {"controller": {key: value}})
            continue
        effect = find(name, configuration.plant)
        first, *more = values.split(",")
        changes: dict[str, object] = {effect.kind.parameters[0]: first}
        for item in more:
            key, _, value = item.partition("=")
            if key not in effect.kind.parameters:
                raise RigtwinError(
                    f"--effect {text}: {effect.name} has "
                    f"{', '.join(effect.kind.parameters)}, not {key!r}"
                )
            changes[key] = value
        configuration = override(configuration, {effect.group: changes})
    return configuration


def rebase(configuration: Configuration, base: Configuration) -> Configuration:
    """What a configuration changes of the nominal suspension rig, on top of another base.

    Parameters
    ----------
    configuration
        Of the suspension rig.
    base
        Of the same settings.

    Returns
    -------
    Configuration
        The base with those changes.
    """
    changes: dict[str, dict[str, object]] = {}
    for (key, value, _), (_, nominal, _) in zip(
        parameters(configuration), parameters(Configuration()), strict=True
    ):
        if value != nominal:
            group, _, name = key.partition(".")
            changes.setdefault(group, {})[name] = (
                value.label if isinstance(value, Choice) else value
            )
    return override(base, changes)
