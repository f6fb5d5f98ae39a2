"""File of a map, TOML."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from controllers.formula import Formula, formula
from rigtwin.description.changes import read_toml
from rigtwin.errors import RigtwinError
from rigtwin.files import parse_toml
from rigtwin.importing.mapping import Column, Map, Source
from rigtwin.importing.units import unit_of
from rigtwin.recording.schema import NAME, check_names

TOPICS = ("/command", "/sensor")
TABLES = (
    "machine",
    "experiment",
    "time",
    "episodes",
    "columns",
    "constants",
    "channels",
    "controller",
)
COLUMN = ("column", "unit", "wrap")
SCALED = (*COLUMN, "scale", "offset", "sign")


def load(path: Path | Mapping[str, Any]) -> Map:
    """Read a map.

    Parameters
    ----------
    path
        TOML file, or its tables as a dictionary.

    Returns
    -------
    Map
        The map.

    Raises
    ------
    RigtwinError
        If a key is unknown, missing or wrong. The message names the file, the key and what was
        expected.
    """
    if isinstance(path, Mapping):
        return _map(path)
    return replace(read_toml(path, _map), folder=path.parent)


def parse(text: str, name: str) -> Map:
    """Read a map in memory.

    Parameters
    ----------
    text
        The map, TOML.
    name
        Name of the map, for errors.

    Raises
    ------
    RigtwinError
        If a key is wrong; the message names map and key, and what was expected.
    """
    try:
        document = parse_toml(text)
    except (ValueError, RecursionError) as error:
        raise RigtwinError(f"{name} is not valid TOML: {error}") from None
    try:
        return _map(document)
    except RigtwinError as error:
        raise RigtwinError(f"{name}: {error}") from None


def _require_keys(where: str, table: object, known: tuple[str, ...]) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where}: expected a table")
    for key in table:
        if key not in known:
            close = difflib.get_close_matches(key, known, 1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            raise RigtwinError(f"{where}: unknown key {key!r}; {hint}there are {', '.join(known)}")
    return table


def _number(where: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    # A boolean is an int in Python, and an integer of TOML may be too large for a float.
    number = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        with suppress(OverflowError):
            number = float(value)
    if not (low <= number <= high and math.isfinite(number)):
        limits = f" from {low:g} to {high:g}" if math.isfinite(low) else ""
        shown = repr(value) if isinstance(value, str) else str(value)
        raise RigtwinError(f"{where} = {shown[:40]}: expected a number{limits}")
    return number


def _map(document: Mapping[str, Any]) -> Map:
    _require_keys("the map", document, TABLES)
    machine = document.get("machine")
    # A recording without a machine could not be compared with any twin.
    if not isinstance(machine, str) or not machine:
        raise RigtwinError(
            "machine is missing; expected the name that its description has, "
            'such as machine = "emps", or the path of its description'
        )
    time = _require_keys(
        "[time]",
        document.get("time", {}),
        ("column", "unit", "period", "resample", "start", "until"),
    )
    # Exactly one of them: with both, the period could contradict the stamps.
    if ("column" in time) == ("period" in time):
        raise RigtwinError('[time]: expected either column = "NAME" or period = SECONDS')
    period = _number("[time] period", time["period"], 1e-6, 10.0) if "period" in time else None
    resample = (
        _number("[time] resample", time["resample"], 1e-6, 10.0) if "resample" in time else None
    )
    if "unit" in time and unit_of(str(time["unit"]))[0] != "s":
        raise RigtwinError(f"[time] unit {time['unit']!r}: expected s, ms, us, ns, min, h or d")
    episode, episodes = _episodes(document.get("episodes", {}))
    channels = document.get("channels")
    if not isinstance(channels, Mapping) or not channels:
        raise RigtwinError(
            '[channels] is missing; expected lines such as "/sensor.position" = { column = "pos", '
            'unit = "mm" }'
        )
    columns = {name: _named(name, table) for name, table in _tables(document, "columns").items()}
    constants = {
        name: _number(f"[constants] {name}", each)
        for name, each in _tables(document, "constants").items()
    }
    # Formulas know columns and constants by one name each.
    if twice := sorted(set(columns) & set(constants)):
        raise RigtwinError(f"[constants] {twice[0]}: [columns] has that name too")
    for topic in TOPICS:
        check_names(topic, [field for of, field in map(_channel, channels) if of == topic])
    sources = {_channel(name): _source(name, table, constants) for name, table in channels.items()}
    controller = document.get("controller", {})
    if not isinstance(controller, Mapping) or not all(
        isinstance(v, int | float | str) for v in controller.values()
    ):
        raise RigtwinError("[controller]: expected a table of settings")
    return Map(
        machine=machine,
        experiment=str(document.get("experiment", "")),
        time=_time_columns(time["column"]) if "column" in time else (),
        time_unit=str(time["unit"]) if "unit" in time else None,
        period=period,
        resample=resample,
        start=_number("[time] start", time.get("start", 0.0)),
        until=_number("[time] until", time.get("until", 1e12)),
        columns=columns,
        channels=sources,
        controller=dict(controller),
        episode=episode,
        episodes=episodes,
    )


def _episodes(entry: object) -> tuple[str | None, tuple[int, ...]]:
    """Return the column that numbers the episodes, and the episodes to import."""
    table = _require_keys("[episodes]", entry, ("column", "take"))
    column = table.get("column")
    if column is not None and not (isinstance(column, str) and column):
        raise RigtwinError(f"[episodes] column = {column}: expected the name of a column")
    take = table.get("take", [])
    # type() rather than isinstance: true is an int in Python.
    if not isinstance(take, list | tuple) or not all(type(number) is int for number in take):
        raise RigtwinError(f"[episodes] take = {take}: expected a list of whole numbers")
    # Repeated numbers would make recordings of one name.
    return column, tuple(dict.fromkeys(take))


def _channel(name: str) -> tuple[str, str]:
    topic, dot, field = str(name).partition(".")
    if topic not in TOPICS or not dot or not NAME.fullmatch(field):
        raise RigtwinError(
            f'[channels] {name!r}: expected "/command.NAME" or "/sensor.NAME", the name of letters '
            "without accents, digits and _"
        )
    return topic, field


def _tables(document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """A table whose keys are names for formulas."""
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise RigtwinError(f"[{name}]: expected a table")
    for key in table:
        if not str(key).isidentifier():
            raise RigtwinError(
                f"[{name}] {key!r}: expected a name of letters, digits and _, as formulas take it"
            )
    return table


def _time_columns(entry: object) -> tuple[str, ...]:
    if isinstance(entry, str):
        return (entry,)
    if isinstance(entry, list) and entry and all(isinstance(each, str) for each in entry):
        if len(set(entry)) < len(entry):
            raise RigtwinError(f"[time] column = {entry}: a column is listed twice")
        return tuple(entry)
    raise RigtwinError(f"[time] column = {entry}: expected a name, or a date's and a time's")


def _named(name: str, entry: object) -> Column:
    where = f"[columns] {name}"
    if isinstance(entry, str):
        return Column(entry, None, None)
    table = _require_keys(where, entry, COLUMN)
    if "column" not in table:
        raise RigtwinError(f'{where}: expected column = "NAME"')
    return _column(where, table)


def _column(where: str, table: Mapping[str, Any]) -> Column:
    if "unit" in table:
        unit_of(str(table["unit"]))
    return Column(
        name=str(table["column"]),
        unit=str(table["unit"]) if "unit" in table else None,
        wrap=_number(f"{where} wrap", table["wrap"], 2.0, 1e300) if "wrap" in table else None,
    )


def _source(name: str, entry: object, constants: Mapping[str, float]) -> Source:
    where = f"[channels] {name!r}"
    table = _require_keys(where, entry, (*SCALED, "constant", "formula"))
    ways = [way for way in ("column", "constant", "formula") if way in table]
    if len(ways) != 1:
        raise RigtwinError(
            f'{where}: expected either column = "NAME", constant = NUMBER or formula = "..."'
        )
    if ways != ["column"] and (beside := [key for key in SCALED if key in table]):
        raise RigtwinError(f"{where}: {beside[0]} goes with a column, not with a {ways[0]}")
    if "constant" in table:
        return Source(constant=_number(f"{where} constant", table["constant"]))
    if "formula" in table:
        return Source(formula=_formula(where, table["formula"], constants))
    sign = table.get("sign", 1)
    if sign not in (1, -1):
        raise RigtwinError(f"{where} sign = {sign}: expected 1 or -1")
    scale = _number(f"{where} scale", table.get("scale", 1.0))
    # A scale of 0 would turn a column into a constant without saying so.
    if scale == 0.0:
        raise RigtwinError(f"{where} scale = 0: expected anything else")
    return Source(
        column=_column(where, table),
        scale=scale,
        offset=_number(f"{where} offset", table.get("offset", 0.0)),
        sign=float(sign),
    )


def _formula(where: str, text: object, constants: Mapping[str, float]) -> Formula:
    if not isinstance(text, str):
        raise RigtwinError(f'{where} formula = {text}: expected a text, such as "4.2 * current"')
    try:
        compiled = formula(text, constants)
    except ValueError as error:
        raise RigtwinError(f"{where} formula: {error}") from None
    if not compiled.inputs:
        raise RigtwinError(f"{where} formula = {text!r}: it names no column")
    return compiled
