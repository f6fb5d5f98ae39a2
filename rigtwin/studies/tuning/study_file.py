"""Reader of studies in TOML files.

Every error message is one line that names the entry and what was expected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from machines import DEFAULT_MACHINE
from rigtwin.description.catalogue import find
from rigtwin.description.changes import override, parse_assignments, read_toml
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import find_experiment
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.own_measures import list_channels, parse_measure
from rigtwin.studies.tuning.study import Budget, Changes, Study
from rigtwin.studies.tuning.study_tables import (
    read_baseline,
    read_changes,
    read_goals,
    read_number,
    read_other_rigs,
    read_parameters,
    read_search,
    read_table,
    read_text,
    read_variation,
    read_whole,
)

REQUIRED = ("experiment", "minimise", "parameters")
KEYS = (
    *("title", "machine", "experiment", "from", "roads", "held_out", "quantile", "evaluations"),
    *("points", "minimise", "report", "set", "search", "baseline", "parameters"),
    *("constraints", "vary", "judge", "measures"),
)
MOST = 10_000
"""Maximum number of scenarios. Fewer than six have no 95 % interval of their median."""


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
    name = read_text("machine", tables.get("machine", DEFAULT_MACHINE))
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
    experiment = find_experiment(machine, read_text("experiment", tables["experiment"]))
    overrides, base = overrides or {}, experiment.configuration
    changes = read_changes("set", tables.get("set", {}), base)
    configuration = override(override(base, changes), overrides)
    search = read_search(tables.get("search", {}), overrides, base)
    shorter = override(configuration, search)
    # These properties raise an error if the timing is inconsistent.
    _ = shorter.ticks, shorter.substeps
    first = read_number("from", tables.get("from", 0.0), 0.0, 86_400.0)
    shortest = min(configuration.timing.duration, shorter.timing.duration)
    if first > shortest - 1.0:
        expected = f"expected at least a second before the test's end at {shortest:g} s"
        raise RigtwinError(f"from = {first:g} s: {expected}")
    return Study(
        name=name,
        title=read_text("title", tables.get("title", name)),
        machine=machine,
        experiment=experiment,
        configuration=configuration,
        search_changes=search,
        baseline_changes=read_baseline(tables.get("baseline", {}), base),
        parameters=read_parameters(tables["parameters"], configuration),
        goals=read_goals(tables, _known_measures(machine, tables.get("measures", {}))),
        budget=Budget(
            roads=read_whole("roads", tables.get("roads", 16), 1, MOST),
            held_out=read_whole("held_out", tables.get("held_out", 32), 6, MOST),
            evaluations=read_whole("evaluations", tables.get("evaluations", 120), 5, 1_000_000),
            points=read_whole("points", tables.get("points", 7), 2, 100),
        ),
        first=first,
        quantile=read_number("quantile", tables.get("quantile", 0.5), 0.0, 1.0),
        variation=read_variation(tables.get("vary", {}), configuration),
        other_rigs=read_other_rigs(tables.get("judge", {}), configuration),
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
    for name, entry in read_table("measures", table, "tables, [measures.NAME]").items():
        if name in known:
            raise RigtwinError(f"measures.{name}: the name of a built-in measure; expected another")
        known[name] = parse_measure(read_text("measures", name), entry, channels)
    return known
