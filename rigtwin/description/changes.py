"""Changes of a test's settings by name.

All values from outside (TOML files, `--set`, recordings) pass through `override`, which checks
every key and value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rigtwin.components.quantity import Choice, Quantity, describe_disorder, fields
from rigtwin.description.configuration import Configuration, groups, parameters
from rigtwin.errors import RigtwinError
from rigtwin.files import parse_toml

Applied = TypeVar("Applied")
POSTERIOR = "posterior"
"""Table of a calibrated twin's file that states the uncertainty of its values, see
`rigtwin.description.posterior`."""


def check_value(key: str, value: object, meaning: Quantity | type[Choice]) -> float | Choice:
    """Return the value of a setting, converted to its type.

    Parameters
    ----------
    key
        Name of the setting, for the message.
    value
        Number, number as a text, or label of a choice.
    meaning
        Allowed values: a quantity with its bounds, or a choice with its labels.

    Returns
    -------
    float or Choice
        Number in the quantity's unit, or member of the choice.

    Raises
    ------
    RigtwinError
        If the value is not allowed. The message names the key and the allowed values.
    """
    # Choices come as their label, in files and on the command line.
    if not isinstance(meaning, Quantity):
        try:
            return meaning.parse(str(value))
        except ValueError as error:
            raise RigtwinError(f"{key}: {error}") from None
    # bool is a subclass of int, but `true` is no number in TOML. NaN fails the comparison below.
    try:
        number = (
            float(value)
            if isinstance(value, str | int | float) and not isinstance(value, bool)
            else math.nan
        )
    except (ValueError, OverflowError):
        number = math.nan
    # The comparison is negated so that NaN fails it.
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
    """Return a configuration with changed settings.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    changes
        New values as group → name → value.

    Returns
    -------
    Configuration
        Copy with the changes.

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
        if (disorder := describe_disorder(group._asdict())) is not None:
            raise RigtwinError(f"{group_name}.{disorder}")
        if group_name in plant._fields:
            plant = plant._replace(**{group_name: group})
        else:
            # Groups beside the plant are fields of the configuration itself.
            rest = rest._replace(**{group_name: group})
    return rest._replace(plant=plant)


def read_toml(path: Path, apply: Callable[[Mapping[str, Any]], Applied]) -> Applied:
    """Apply a function to the tables of a TOML file.

    Parameters
    ----------
    path
        Path of the TOML file.
    apply
        Function of the parsed tables.

    Returns
    -------
    object
        Result of the function.

    Raises
    ------
    RigtwinError
        If the file cannot be read, is not valid TOML, or is refused by the function. The message
        names the file.
    """
    # Editors on Windows write a byte order mark, which utf-8-sig removes.
    try:
        return apply(parse_toml(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    # The parser recurses into nested arrays: a hostile file exhausts the stack.
    except (ValueError, RecursionError) as error:
        raise RigtwinError(f"{path} is not valid TOML: {error}") from None
    except RigtwinError as error:
        raise RigtwinError(f"{path}: {error}") from None


def parse_assignments(assignments: Sequence[str]) -> Iterator[dict[str, dict[str, str]]]:
    """Yield group → name → value for every assignment.

    Parameters
    ----------
    assignments
        Texts of the form `group.name=value`, as `--set` takes them.

    Raises
    ------
    RigtwinError
        For a text of another form.
    """
    for text in assignments:
        key, equals, value = text.partition("=")
        group, dot, name = key.strip().partition(".")
        if not (equals and dot):
            raise RigtwinError(f"--set {text}: expected group.name=value, such as rail.coulomb=60")
        yield {group: {name: value.strip()}}


def values_of(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables that hold settings: all but `posterior`, the uncertainty of a calibrated
    twin."""
    return {name: table for name, table in tables.items() if name != POSTERIOR}


Changes = Mapping[str, Mapping[str, object]] | str | Path
"""Group → name → value, or the path of a TOML file that holds them."""


def with_changes(
    configuration: Configuration, changes: Changes | Sequence[Changes]
) -> Configuration:
    """Return a configuration with changes of any form.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    changes
        Group → name → value, path of a TOML file, or a sequence of these. In a sequence, a later
        change replaces an earlier one.

    Returns
    -------
    Configuration
        Copy with the changes.

    Raises
    ------
    RigtwinError
        For a key or value that is not allowed, or a file that cannot be read.
    """
    if isinstance(changes, str | Path):
        return read_toml(Path(changes), lambda tables: override(configuration, values_of(tables)))
    if isinstance(changes, Mapping):
        return override(configuration, changes)
    for change in changes:
        configuration = with_changes(configuration, change)
    return configuration


def rebase(configuration: Configuration, base: Configuration) -> Configuration:
    """Return a base with the settings in which a configuration differs from the nominal rig.

    Parameters
    ----------
    configuration
        Configuration of the suspension rig.
    base
        Configuration with the same settings, to which the differences are applied.

    Returns
    -------
    Configuration
        Copy of the base with the differences.
    """
    changes: dict[str, dict[str, object]] = {}
    for (key, value, _), (_, nominal, _) in zip(
        parameters(configuration), parameters(Configuration()), strict=True
    ):
        # Only differences are carried over: the base may be calibrated in all else.
        if value != nominal:
            group, _, name = key.partition(".")
            changes.setdefault(group, {})[name] = (
                value.label if isinstance(value, Choice) else value
            )
    return override(base, changes)
