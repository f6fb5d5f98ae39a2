"""Reads a study from its TOML file. Every mistake is one line that names the entry and what was expected."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from controllers.quantity import Quantity, fields
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration, assigned, groups, overridden, read_toml
from rigtwin.studies.tuning.measures import MEASURES, Measure
from rigtwin.studies.tuning.parameter import Parameter
from rigtwin.studies.tuning.study import Constraint, Study, shipped

BASELINE = "baseline"
KEYS = (
    *("title", "experiment", "from", "roads", "held_out", "quantile", "evaluations", "points", "minimise", "report"),
    *("set", "search", "baseline", "parameters", "constraints", "vary", "judge"),
)
MOST = 10_000
"""Scenarios. Fewer than six have no 95 % interval of their median."""
LONGEST = 100
"""Characters of a title or a name, which stand in tables and pictures."""


def find(name: str, assignments: Sequence[str] = (), **numbers: int | None) -> Study:
    """A study by its name, or by the path of its file. assignments: `group.name=value` for every run, over the study's own;
    numbers: of roads, held_out, evaluations, None for the study's own.

    Raises RigtwinError with what there is, or what is wrong with it.
    """
    path = shipped().get(name, Path(name))
    if path.suffix != ".toml" and not path.exists():
        raise RigtwinError(f"unknown study {name!r}; there are {', '.join(shipped())}, or give the path of a study, F.toml")
    given: dict[str, dict[str, object]] = {}
    for own in assigned(assignments):
        for group, values in own.items():
            given.setdefault(group, {}).update(values)
    other = {key: number for key, number in numbers.items() if number is not None}
    return read_toml(path, lambda tables: parsed(path.stem, {**tables, **other}, given))


def parsed(name: str, tables: Mapping[str, Any], given: Mapping[str, Mapping[str, object]] | None = None) -> Study:
    """A study of its TOML tables. given: group → name → value for every run, over what the tables have.

    Raises RigtwinError naming the entry and what was expected.
    """
    import experiments

    for key in tables:
        if key not in KEYS:
            raise RigtwinError(f"unknown {key!r}; there are {', '.join(KEYS)}")
    for key in ("experiment", "minimise", "parameters"):
        if key not in tables:
            raise RigtwinError(f"{key} is missing")
    experiment = experiments.find(_text("experiment", tables["experiment"]))
    given = given or {}
    configuration = overridden(overridden(experiment.configuration, _changes("set", tables.get("set", {}))), given)
    baseline, search = (_changes(key, tables.get(key, {})) for key in ("baseline", "search"))
    # What is given at once goes for the search too.
    search = {
        group: {key: value for key, value in own.items() if key not in given.get(group, {})} for group, own in search.items()
    }
    if set(baseline) - {"controller"}:
        raise RigtwinError(f"baseline: {next(iter(set(baseline) - {'controller'}))}: expected settings of the controller alone")
    if set(search) - {"timing", "safety", "road"}:
        raise RigtwinError(f"search: {next(iter(set(search) - {'timing', 'safety', 'road'}))}: expected timing, safety or road")
    _ = overridden(configuration, search).ticks, overridden(configuration, search).substeps
    minimise = _measures("minimise", tables["minimise"])
    if len(minimise) not in (1, 2) or (isinstance(tables["minimise"], list) and len(minimise) != len(tables["minimise"])):
        raise RigtwinError(f"minimise = {tables['minimise']!r}: expected one objective, or two others for their front")
    constraints, limits = _constraints(tables.get("constraints", {}))
    first = _number("from", tables.get("from", 0.0), 0.0, 86_400.0)
    shortest = min(configuration.timing.duration, overridden(configuration, search).timing.duration)
    if first > shortest - 1.0:
        raise RigtwinError(f"from = {first:g} s: expected at least a second before the test's end at {shortest:g} s")
    vary, tolerances = _vary(tables.get("vary", {}), configuration)
    return Study(
        name,
        _text("title", tables.get("title", name)),
        experiment.name,
        configuration,
        search,
        baseline,
        _parameters(tables["parameters"], configuration),
        minimise,
        constraints,
        _measures("report", tables.get("report", [])),
        limits,
        first,
        _whole("roads", tables.get("roads", 16), 1, MOST),
        _whole("held_out", tables.get("held_out", 32), 6, MOST),
        _number("quantile", tables.get("quantile", 0.5), 0.0, 1.0),
        _whole("evaluations", tables.get("evaluations", 120), 5, 1_000_000),
        _whole("points", tables.get("points", 7), 2, 100),
        tolerances,
        vary,
        _judge(tables.get("judge", {}), configuration),
    )


def _text(key: str, value: object) -> str:
    if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > LONGEST:
        raise RigtwinError(f"{key} = {str(value)[:LONGEST]!r}: expected text of one line, {LONGEST} characters at most")
    return value


def _number(key: str, value: object, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a number from {low:g} to {high:g}")
    return float(value)


def _whole(key: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RigtwinError(f"{key} = {value!r}: expected a whole number from {low} to {high}")
    return value


def _changes(where: str, table: object) -> dict[str, dict[str, object]]:
    """`"group.name" = value` entries, or tables of them, as group → name → value. Every key and value is checked."""
    if not isinstance(table, Mapping):
        raise RigtwinError(f'{where} = {table!r}: expected a table of settings, such as "controller.kp" = 0.5')
    found: dict[str, dict[str, object]] = {}
    for key, value in table.items():
        group, dot, name = key.partition(".")
        if isinstance(value, Mapping) and not dot:
            found.setdefault(key, {}).update(value)
        elif dot and name:
            found.setdefault(group, {})[name] = value
        else:
            raise RigtwinError(f'{where}: {key} = {value!r}: expected group.name, such as "controller.kp" = 0.5')
    try:
        overridden(Configuration(), found)
    except RigtwinError as error:
        raise RigtwinError(f"{where}: {error}") from None
    return found


def _measures(key: str, names: object) -> tuple[Measure, ...]:
    listed = [names] if isinstance(names, str) else names
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise RigtwinError(f"{key} = {names!r}: expected names of {', '.join(MEASURES)}")
    for name in listed:
        if name not in MEASURES:
            raise RigtwinError(f"{key}: unknown {name!r}; there are {', '.join(MEASURES)}")
    return tuple(MEASURES[name] for name in dict.fromkeys(listed))


def _quantity(key: str, configuration: Configuration) -> Quantity:
    """The meaning of a setting that is a number. Raises RigtwinError for any other."""
    group, _, name = key.partition(".")
    known = groups(configuration)
    meaning = fields(type(known[group])).get(name) if group in known else None
    if not isinstance(meaning, Quantity):
        raise RigtwinError(f"{key}: expected group.name of a setting that is a number; rigtwin list --settings has all")
    return meaning


def _parameters(table: object, configuration: Configuration) -> tuple[Parameter, ...]:
    if not isinstance(table, Mapping) or not table:
        raise RigtwinError(f'parameters = {table!r}: expected settings with bounds, such as "controller.kp" = [0.1, 2.0]')
    found = []
    for key, entry in table.items():
        if not key.startswith("controller."):
            raise RigtwinError(f"parameters: {key}: only the controller is tuned; expected controller.name")
        meaning = _quantity(key, configuration)
        bounds = entry.get("between") if isinstance(entry, Mapping) else entry
        scale = entry.get("scale", "linear") if isinstance(entry, Mapping) else "linear"
        if isinstance(entry, Mapping) and (set(entry) - {"between", "scale"} or scale not in ("linear", "logarithmic")):
            raise RigtwinError(f'parameters: {key} = {dict(entry)}: expected between = [low, high], scale = "logarithmic"')
        if not isinstance(bounds, list) or len(bounds) != 2:
            raise RigtwinError(f"parameters: {key} = {bounds!r}: expected its bounds, [low, high]")
        low, high = (_number(f"parameters: {key}", bound, meaning.low, meaning.high) for bound in bounds)
        if not low < high or (scale == "logarithmic" and low <= 0.0):
            raise RigtwinError(f"parameters: {key} = [{low:g}, {high:g}]: expected low below high, above 0 if logarithmic")
        found.append(Parameter(key, low, high, scale == "logarithmic", meaning.unit))
    return tuple(found)


def _constraints(table: object) -> tuple[tuple[Constraint, ...], float]:
    if not isinstance(table, Mapping):
        raise RigtwinError(f'constraints = {table!r}: expected measures with bounds, such as road_holding = "baseline"')
    found, limits = [], 0.9
    for key, value in table.items():
        if key == "limits":
            limits = _number("constraints: limits", value, 0.01, 1.0)
            continue
        (measure,) = _measures("constraints", [key])
        if not isinstance(value, str):
            found.append(Constraint(measure, _number(f"constraints: {key}", value, -1e12, 1e12)))
            continue
        share, _, word = value.rpartition(" ")
        try:
            factor = float(share or 1.0)
        except ValueError:
            factor = math.nan
        if word != BASELINE or not factor > 0.0 or not math.isfinite(factor):
            raise RigtwinError(f'constraints: {key} = {value!r}: expected a number, "baseline", or such as "0.98 baseline"')
        found.append(Constraint(measure, math.nan, factor))
    return tuple(found), limits


def _vary(table: object, configuration: Configuration) -> tuple[dict[str, float], float]:
    if not isinstance(table, Mapping):
        raise RigtwinError(f'vary = {table!r}: expected shares, such as "motor.coulomb" = 0.3')
    found, tolerances = {}, 0.0
    for key, value in table.items():
        if key == "tolerances":
            tolerances = _number("vary: tolerances", value, 0.0, 10.0)
            continue
        if key.partition(".")[0] not in configuration.plant._fields:
            raise RigtwinError(f"vary: {key}: expected component.parameter of the rig, or tolerances")
        _quantity(key, configuration)
        group, _, name = key.partition(".")
        if getattr(getattr(configuration.plant, group), name) == 0.0:
            raise RigtwinError(f"vary: {key}: it is 0 in this rig, and any share of that is nothing; give it a value in [set]")
        found[key] = _number(f"vary: {key}", value, 0.0, 1.0)
    return found, tolerances


def _judge(table: object, configuration: Configuration) -> dict[str, dict[str, dict[str, object]]]:
    if not isinstance(table, Mapping):
        raise RigtwinError("judge: expected tables of changes of the rig, [judge.NAME]")
    found = {}
    for name, changes in table.items():
        found[_text("judge", name)] = _changes(f"judge: {name}", changes)
        if any(group not in configuration.plant._fields for group in found[name]):
            raise RigtwinError(f'judge: {name}: expected changes of the rig alone, such as "motor.coulomb" = 18.2')
    return found
