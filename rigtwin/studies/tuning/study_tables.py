"""Tables of a study file, each read into its typed value."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from controllers.quantity import Quantity, fields
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration, groups
from rigtwin.description.posterior import value_of
from rigtwin.errors import RigtwinError
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import TuningParameter
from rigtwin.studies.tuning.study import Changes, Constraint, Goals, Variation

BASELINE = "baseline"
LONGEST = 100
"""Maximum number of characters of a title or name, which appear in tables and pictures."""


def read_text(key: str, value: object) -> str:
    """Return an entry that has to be a text. Raise RigtwinError for any other."""
    if isinstance(value, str) and value.strip() and value.isprintable() and len(value) <= LONGEST:
        return value
    expected = f"expected text of one line, {LONGEST} characters at most"
    raise RigtwinError(f"{key} = {str(value)[:LONGEST]!r}: {expected}")


def read_number(key: str, value: object, low: float, high: float) -> float:
    """Return an entry that has to be a number within bounds. Raise RigtwinError for any other."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a number from {low:g} to {high:g}")
    return float(value)


def read_whole(key: str, value: object, low: int, high: int) -> int:
    """Return an entry that has to be a whole number. Raise RigtwinError for any other."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a whole number from {low} to {high}")
    return value


def read_table(where: str, table: object, expected: str) -> Mapping[str, Any]:
    """Return an entry that has to be a table. Raise RigtwinError for any other."""
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}: expected {expected}")
    return table


def read_changes(where: str, table: object, base: Configuration) -> dict[str, dict[str, object]]:
    """Return changes by group and name, from `"group.name" = value` entries or from tables.

    Every name and value is checked against the base configuration.
    """
    changes: dict[str, dict[str, object]] = {}
    expected = 'a table of settings, such as "controller.kp" = 0.5'
    for key, value in read_table(where, table, expected).items():
        group, dot, name = key.partition(".")
        if isinstance(value, Mapping) and not dot:
            changes.setdefault(key, {}).update(value)
        elif dot and name:
            changes.setdefault(group, {})[name] = value
        else:
            expected = 'expected group.name, such as "controller.kp" = 0.5'
            raise RigtwinError(f"{where}: {key} = {value!r}: {expected}")
    try:
        override(base, changes)
    except RigtwinError as error:
        raise RigtwinError(f"{where}: {error}") from None
    return changes


def require_groups(where: str, changes: Changes, allowed: Sequence[str], expected: str) -> None:
    """Raise RigtwinError for a group that is not among the allowed ones."""
    for group in changes:
        if group not in allowed:
            raise RigtwinError(f"{where}: {group}: expected {expected}")


def read_baseline(table: object, base: Configuration) -> Changes:
    """Return the changes of the controller that all candidates are compared with."""
    changes = read_changes("baseline", table, base)
    require_groups("baseline", changes, ["controller"], "settings of the controller alone")
    return changes


def read_search(table: object, overrides: Changes, base: Configuration) -> Changes:
    """Return the changes of the search's runs, without settings that the user overrides."""
    changes = read_changes("search", table, base)
    require_groups("search", changes, ["timing", "safety", "road"], "timing, safety or road")
    remaining = {}
    for group, settings in changes.items():
        fixed = overrides.get(group, {})
        remaining[group] = {key: value for key, value in settings.items() if key not in fixed}
    return remaining


def read_measures(key: str, names: object, known: Mapping[str, Measure]) -> tuple[Measure, ...]:
    """Return the measures that a goal weighs."""
    listed, available = [names] if isinstance(names, str) else names, ", ".join(known) or "none"
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise RigtwinError(f"{key} = {names!r}: expected names of {available}")
    for name in listed:
        if name not in known:
            more = "; [measures.NAME] defines one"
            raise RigtwinError(f"{key}: unknown {name!r}; expected {available}{more}")
    return tuple(known[name] for name in dict.fromkeys(listed))


def read_quantity(key: str, configuration: Configuration) -> Quantity:
    """Return the unit and bounds of a numeric setting. Raise RigtwinError for any other."""
    group, _, name = key.partition(".")
    known = groups(configuration)
    meaning = fields(type(known[group])).get(name) if group in known else None
    if not isinstance(meaning, Quantity):
        expected = "expected group.name of a setting that is a number"
        raise RigtwinError(f"{key}: {expected}; rigtwin list --settings has all")
    return meaning


def read_parameters(table: object, configuration: Configuration) -> tuple[TuningParameter, ...]:
    """Return the parameters that are searched."""
    expected = 'settings with bounds, such as "controller.kp" = [0.1, 2.0]'
    entries = read_table("parameters", table, expected)
    if not entries:
        raise RigtwinError(f"parameters = {entries!r}: expected {expected}")
    return tuple(_parameter(key, entry, configuration) for key, entry in entries.items())


def _parameter(key: str, entry: object, configuration: Configuration) -> TuningParameter:
    where = f"parameters: {key}"
    # The plant is the rig as it is; only what the engineer can set is tuned.
    if not key.startswith("controller."):
        raise RigtwinError(f"{where}: only the controller is tuned; expected controller.name")
    meaning = read_quantity(key, configuration)
    table = entry if isinstance(entry, Mapping) else {"between": entry}
    bounds, scale = table.get("between"), table.get("scale", "linear")
    if set(table) - {"between", "scale"} or scale not in ("linear", "logarithmic"):
        expected = 'expected between = [low, high], scale = "logarithmic"'
        raise RigtwinError(f"{where} = {dict(table)}: {expected}")
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise RigtwinError(f"{where} = {bounds!r}: expected its bounds, [low, high]")
    low, high = (read_number(where, bound, meaning.low, meaning.high) for bound in bounds)
    logarithmic = scale == "logarithmic"
    if not low < high or (logarithmic and low <= 0.0):
        expected = "expected low below high, above 0 if logarithmic"
        raise RigtwinError(f"{where} = [{low:g}, {high:g}]: {expected}")
    return TuningParameter(key, low, high, logarithmic, meaning.unit)


def read_goals(tables: Mapping[str, Any], known: Mapping[str, Measure]) -> Goals:
    """Return the goals and constraints of a study."""
    asked = tables["minimise"]
    minimise = read_measures("minimise", asked, known)
    if len(minimise) not in (1, 2) or (isinstance(asked, list) and len(minimise) != len(asked)):
        expected = "expected one objective, or two different ones for their front"
        raise RigtwinError(f"minimise = {asked!r}: {expected}")
    expected = f'measures with bounds, such as road_holding = "{BASELINE}"'
    bounds = dict(read_table("constraints", tables.get("constraints", {}), expected))
    limits = read_number("constraints: limits", bounds.pop("limits", 0.9), 0.01, 1.0)
    constraints = tuple(_constraint(key, value, known) for key, value in bounds.items())
    report = read_measures("report", tables.get("report", []), known)
    return Goals(minimise, constraints, limits, report)


def _constraint(key: str, value: object, known: Mapping[str, Measure]) -> Constraint:
    where, (measure,) = f"constraints: {key}", read_measures("constraints", [key], known)
    if not isinstance(value, str):
        return Constraint(measure, read_number(where, value, -1e12, 1e12))
    # "baseline" alone, or a share of it such as "0.98 baseline".
    share, _, word = value.rpartition(" ")
    try:
        factor = float(share or 1.0)
    except ValueError:
        factor = math.nan
    if word != BASELINE or not factor > 0.0 or not math.isfinite(factor):
        expected = f'expected a number, "{BASELINE}", or such as "0.98 {BASELINE}"'
        raise RigtwinError(f"{where} = {value!r}: {expected}")
    return Constraint(measure, math.nan, factor)


def read_variation(table: object, configuration: Configuration) -> Variation:
    """Return the random variation of the rig between runs."""
    shares = dict(read_table("vary", table, 'shares, such as "motor.coulomb" = 0.3'))
    tolerances = read_number("vary: tolerances", shares.pop("tolerances", 0.0), 0.0, 10.0)
    for key, value in shares.items():
        where = f"vary: {key}"
        # Only the machine varies between scenarios; the controller's settings are the study's to
        # choose.
        if key.partition(".")[0] not in configuration.plant._fields:
            expected = "expected component.parameter of the machine, or tolerances"
            raise RigtwinError(f"{where}: {expected}")
        read_quantity(key, configuration)
        if value_of(configuration, key) == 0.0:
            advice = "any share of 0 is 0; give it a value in [set]"
            raise RigtwinError(f"{where}: it is 0 in this machine, and {advice}")
        shares[key] = read_number(where, value, 0.0, 1.0)
    return Variation(tolerances, shares)


def read_other_rigs(table: object, configuration: Configuration) -> dict[str, Changes]:
    """Return the further rigs on which a candidate is tried."""
    rigs_changes: dict[str, Changes] = {}
    rigs = read_table("judge", table, "tables of changes of the rig, [judge.NAME]")
    for name, changes in rigs.items():
        where = f"judge: {read_text('judge', name)}"
        rigs_changes[name] = read_changes(where, changes, configuration)
        expected = 'changes of the machine alone, such as "motor.coulomb" = 18.2'
        require_groups(where, rigs_changes[name], configuration.plant._fields, expected)
    return rigs_changes
