"""Reader of studies in TOML files.

Every error message is one line that names the entry and what was expected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from controllers.quantity import Quantity, fields
from machines import DEFAULT_MACHINE
from rigtwin.description.catalogue import find
from rigtwin.description.changes import override, parse_assignments, read_toml
from rigtwin.description.configuration import Configuration, groups
from rigtwin.description.machine import Machine
from rigtwin.description.posterior import value_of
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import find_experiment
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.own_measures import list_channels, parse_measure
from rigtwin.studies.tuning.parameter import TuningParameter
from rigtwin.studies.tuning.study import Budget, Changes, Constraint, Goals, Study, Variation

BASELINE = "baseline"
REQUIRED = ("experiment", "minimise", "parameters")
KEYS = (
    *("title", "machine", "experiment", "from", "roads", "held_out", "quantile", "evaluations"),
    *("points", "minimise", "report", "set", "search", "baseline", "parameters"),
    *("constraints", "vary", "judge", "measures"),
)
MOST = 10_000
"""Maximum number of scenarios. Fewer than six have no 95 % interval of their median."""
LONGEST = 100
"""Maximum number of characters of a title or name, which appear in tables and pictures."""


def read_study(
    path: Path,
    machine: Machine | None = None,
    assignments: Sequence[str] = (),
    **numbers: int | None,
) -> Study:
    """Read a study from its file.

    Parameters
    ----------
    path : Path
        Path of the file.
    machine : Machine, optional
        Machine whose controller is tuned. Defaults to the one the study names, or else to the
        suspension rig.
    assignments : sequence of str, optional
        Settings `group.name=value` of every run, which override the study's.
    **numbers : int or None
        Values of `roads`, `held_out` and `evaluations`; None for the study's.

    Raises
    ------
    RigtwinError
        If an entry is wrong; the message names it, what was expected, and the file.
    """
    overrides: dict[str, dict[str, object]] = {}
    for assignment in parse_assignments(assignments):
        for group, values in assignment.items():
            overrides.setdefault(group, {}).update(values)
    changed = {key: number for key, number in numbers.items() if number is not None}

    def parse(tables: Mapping[str, Any]) -> tuple[Mapping[str, Any], Machine, Study]:
        tuned = _machine(path, tables) if machine is None else machine
        return tables, tuned, parse_study(path.stem, tables, tuned)

    # The file is parsed without the overrides first, so that read_toml blames the file only for
    # its own mistakes.
    tables, tuned, study = read_toml(path, parse)
    if not (changed or overrides):
        return study
    return parse_study(path.stem, {**tables, **changed}, tuned, overrides)


def _machine(path: Path, tables: Mapping[str, Any]) -> Machine:
    """Return the machine a study names: a shipped one, or a description beside the study."""
    name = _text("machine", tables.get("machine", DEFAULT_MACHINE))
    beside = path.parent / name
    return find(str(beside) if name.endswith(".toml") and beside.is_file() else name)


def parse_study(
    name: str, tables: Mapping[str, Any], machine: Machine, overrides: Changes | None = None
) -> Study:
    """Return the study described by TOML tables.

    Parameters
    ----------
    name : str
        Name of the study.
    tables : mapping
        Tables of the file.
    machine : Machine
        Machine whose controller is tuned.
    overrides : mapping, optional
        Group → name → value of every run, which overrides the tables.

    Raises
    ------
    RigtwinError
        If an entry is wrong; the message names it and what was expected.
    """
    _check_keys(tables, machine)
    experiment = find_experiment(machine, _text("experiment", tables["experiment"]))
    overrides, base = overrides or {}, experiment.configuration
    changes = _changes("set", tables.get("set", {}), base)
    configuration = override(override(base, changes), overrides)
    search = _search(tables.get("search", {}), overrides, base)
    shorter = override(configuration, search)
    # These properties raise an error if the timing is inconsistent.
    _ = shorter.ticks, shorter.substeps
    first = _number("from", tables.get("from", 0.0), 0.0, 86_400.0)
    shortest = min(configuration.timing.duration, shorter.timing.duration)
    if first > shortest - 1.0:
        expected = f"expected at least a second before the test's end at {shortest:g} s"
        raise RigtwinError(f"from = {first:g} s: {expected}")
    return Study(
        name=name,
        title=_text("title", tables.get("title", name)),
        machine=machine,
        experiment=experiment,
        configuration=configuration,
        search_changes=search,
        baseline_changes=_baseline(tables.get("baseline", {}), base),
        parameters=_parameters(tables["parameters"], configuration),
        goals=_goals(tables, _known_measures(machine, tables.get("measures", {}))),
        budget=Budget(
            roads=_whole("roads", tables.get("roads", 16), 1, MOST),
            held_out=_whole("held_out", tables.get("held_out", 32), 6, MOST),
            evaluations=_whole("evaluations", tables.get("evaluations", 120), 5, 1_000_000),
            points=_whole("points", tables.get("points", 7), 2, 100),
        ),
        first=first,
        quantile=_number("quantile", tables.get("quantile", 0.5), 0.0, 1.0),
        variation=_variation(tables.get("vary", {}), configuration),
        other_rigs=_other_rigs(tables.get("judge", {}), configuration),
    )


def _check_keys(tables: Mapping[str, Any], machine: Machine) -> None:
    """Raise RigtwinError unless all keys are known, and none that is required is missing."""
    for key in tables:
        if key not in KEYS:
            raise RigtwinError(f"unknown {key!r}; expected {', '.join(KEYS)}")
    for key in REQUIRED:
        if key not in tables:
            raise RigtwinError(f"{key} is missing")
    if not len(machine.configuration.controller):
        expected = "expected a machine with a [controller] that has settings"
        raise RigtwinError(f"{machine.name} has nothing to tune; {expected}")


def _known_measures(machine: Machine, table: object) -> dict[str, Measure]:
    """Return the rig's measures and those that the study defines, by name."""
    known = machine.physics.measures()
    channels = list_channels(machine)
    for name, entry in _table("measures", table, "tables, [measures.NAME]").items():
        if name in known:
            raise RigtwinError(f"measures.{name}: the name of a built-in measure; expected another")
        known[name] = parse_measure(_text("measures", name), entry, channels)
    return known


def _text(key: str, value: object) -> str:
    if isinstance(value, str) and value.strip() and value.isprintable() and len(value) <= LONGEST:
        return value
    expected = f"expected text of one line, {LONGEST} characters at most"
    raise RigtwinError(f"{key} = {str(value)[:LONGEST]!r}: {expected}")


def _number(key: str, value: object, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a number from {low:g} to {high:g}")
    return float(value)


def _whole(key: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a whole number from {low} to {high}")
    return value


def _table(where: str, table: object, expected: str) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}: expected {expected}")
    return table


def _changes(where: str, table: object, base: Configuration) -> dict[str, dict[str, object]]:
    """Return changes by group and name, from `"group.name" = value` entries or from tables.

    Every name and value is checked against the base configuration.
    """
    changes: dict[str, dict[str, object]] = {}
    expected = 'a table of settings, such as "controller.kp" = 0.5'
    for key, value in _table(where, table, expected).items():
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


def _only(where: str, changes: Changes, allowed: Sequence[str], expected: str) -> None:
    """Raise RigtwinError for a group that is not among the allowed ones."""
    for group in changes:
        if group not in allowed:
            raise RigtwinError(f"{where}: {group}: expected {expected}")


def _baseline(table: object, base: Configuration) -> Changes:
    changes = _changes("baseline", table, base)
    _only("baseline", changes, ["controller"], "settings of the controller alone")
    return changes


def _search(table: object, overrides: Changes, base: Configuration) -> Changes:
    """Return the changes of the search's runs, without settings that the user overrides."""
    changes = _changes("search", table, base)
    _only("search", changes, ["timing", "safety", "road"], "timing, safety or road")
    remaining = {}
    for group, settings in changes.items():
        fixed = overrides.get(group, {})
        remaining[group] = {key: value for key, value in settings.items() if key not in fixed}
    return remaining


def _measures(key: str, names: object, known: Mapping[str, Measure]) -> tuple[Measure, ...]:
    listed, available = [names] if isinstance(names, str) else names, ", ".join(known) or "none"
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise RigtwinError(f"{key} = {names!r}: expected names of {available}")
    for name in listed:
        if name not in known:
            more = "; [measures.NAME] defines one"
            raise RigtwinError(f"{key}: unknown {name!r}; expected {available}{more}")
    return tuple(known[name] for name in dict.fromkeys(listed))


def _quantity(key: str, configuration: Configuration) -> Quantity:
    """Return the unit and bounds of a numeric setting. Raise RigtwinError for any other."""
    group, _, name = key.partition(".")
    known = groups(configuration)
    meaning = fields(type(known[group])).get(name) if group in known else None
    if not isinstance(meaning, Quantity):
        expected = "expected group.name of a setting that is a number"
        raise RigtwinError(f"{key}: {expected}; rigtwin list --settings has all")
    return meaning


def _parameters(table: object, configuration: Configuration) -> tuple[TuningParameter, ...]:
    expected = 'settings with bounds, such as "controller.kp" = [0.1, 2.0]'
    entries = _table("parameters", table, expected)
    if not entries:
        raise RigtwinError(f"parameters = {entries!r}: expected {expected}")
    return tuple(_parameter(key, entry, configuration) for key, entry in entries.items())


def _parameter(key: str, entry: object, configuration: Configuration) -> TuningParameter:
    where = f"parameters: {key}"
    # The plant is the rig as it is; only what the engineer can set is tuned.
    if not key.startswith("controller."):
        raise RigtwinError(f"{where}: only the controller is tuned; expected controller.name")
    meaning = _quantity(key, configuration)
    table = entry if isinstance(entry, Mapping) else {"between": entry}
    bounds, scale = table.get("between"), table.get("scale", "linear")
    if set(table) - {"between", "scale"} or scale not in ("linear", "logarithmic"):
        expected = 'expected between = [low, high], scale = "logarithmic"'
        raise RigtwinError(f"{where} = {dict(table)}: {expected}")
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise RigtwinError(f"{where} = {bounds!r}: expected its bounds, [low, high]")
    low, high = (_number(where, bound, meaning.low, meaning.high) for bound in bounds)
    logarithmic = scale == "logarithmic"
    if not low < high or (logarithmic and low <= 0.0):
        expected = "expected low below high, above 0 if logarithmic"
        raise RigtwinError(f"{where} = [{low:g}, {high:g}]: {expected}")
    return TuningParameter(key, low, high, logarithmic, meaning.unit)


def _goals(tables: Mapping[str, Any], known: Mapping[str, Measure]) -> Goals:
    asked = tables["minimise"]
    minimise = _measures("minimise", asked, known)
    if len(minimise) not in (1, 2) or (isinstance(asked, list) and len(minimise) != len(asked)):
        expected = "expected one objective, or two different ones for their front"
        raise RigtwinError(f"minimise = {asked!r}: {expected}")
    expected = f'measures with bounds, such as road_holding = "{BASELINE}"'
    bounds = dict(_table("constraints", tables.get("constraints", {}), expected))
    limits = _number("constraints: limits", bounds.pop("limits", 0.9), 0.01, 1.0)
    constraints = tuple(_constraint(key, value, known) for key, value in bounds.items())
    report = _measures("report", tables.get("report", []), known)
    return Goals(minimise, constraints, limits, report)


def _constraint(key: str, value: object, known: Mapping[str, Measure]) -> Constraint:
    where, (measure,) = f"constraints: {key}", _measures("constraints", [key], known)
    if not isinstance(value, str):
        return Constraint(measure, _number(where, value, -1e12, 1e12))
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


def _variation(table: object, configuration: Configuration) -> Variation:
    shares = dict(_table("vary", table, 'shares, such as "motor.coulomb" = 0.3'))
    tolerances = _number("vary: tolerances", shares.pop("tolerances", 0.0), 0.0, 10.0)
    for key, value in shares.items():
        where = f"vary: {key}"
        # Only the machine varies between scenarios; the controller's settings are the study's to
        # choose.
        if key.partition(".")[0] not in configuration.plant._fields:
            expected = "expected component.parameter of the machine, or tolerances"
            raise RigtwinError(f"{where}: {expected}")
        _quantity(key, configuration)
        if value_of(configuration, key) == 0.0:
            advice = "any share of 0 is 0; give it a value in [set]"
            raise RigtwinError(f"{where}: it is 0 in this machine, and {advice}")
        shares[key] = _number(where, value, 0.0, 1.0)
    return Variation(tolerances, shares)


def _other_rigs(table: object, configuration: Configuration) -> dict[str, Changes]:
    rigs_changes: dict[str, Changes] = {}
    rigs = _table("judge", table, "tables of changes of the rig, [judge.NAME]")
    for name, changes in rigs.items():
        where = f"judge: {_text('judge', name)}"
        rigs_changes[name] = _changes(where, changes, configuration)
        expected = 'changes of the machine alone, such as "motor.coulomb" = 18.2'
        _only(where, rigs_changes[name], configuration.plant._fields, expected)
    return rigs_changes
