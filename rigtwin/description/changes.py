"""Changes of a test's settings by name.

`override` is the one way in from outside: TOML files, `--set`, recordings. Every key and value is
checked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rigtwin.components.quantity import Choice, Quantity, fields
from rigtwin.description.configuration import Configuration, groups, parameters
from rigtwin.errors import RigtwinError
from rigtwin.files import parse_toml

Applied = TypeVar("Applied")
POSTERIOR = "posterior"
"""The table of a calibrated twin's file beside its values; rigtwin.description.posterior reads
it."""


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
        return apply(parse_toml(path.read_text(encoding="utf-8-sig")))
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
