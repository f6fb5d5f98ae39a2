"""File of a channel table, TOML."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from controllers.quantity import fields
from rigtwin.description.changes import check_value, read_toml
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.signals import RIG, Signal, Signals
from rigtwin.hardware.daq.table import CardLine, ChannelTable, LineScaling, Plausible, StuckLimit

Group = TypeVar("Group")
# Names of the driver's lines, such as ai0, ao3 and port0/line2.
_ANALOG = {"inputs": re.compile(r"ai\d{1,3}"), "outputs": re.compile(r"ao\d{1,2}")}
_DIGITAL = re.compile(r"port\d/line\d{1,2}")
_FREE_TEXT = ("device", "address", "timing", "calibrated", "operator", "note")
_TIMINGS = ("hardware", "software")


def find_table(path: Path) -> Path:
    """Find a channel table: a file, or one that is shipped, by its name with or without `.toml`.

    Raises
    ------
    RigtwinError
        If there is neither; the message lists the shipped ones.
    """
    if path.exists():
        return path
    # The shipped tables are beside the machines that they are wired to.
    folder = Path(str(files("machines"))) / "cards"
    shipped = {each.stem.replace("_", "-"): each for each in sorted(folder.glob("*.toml"))}
    name = path.name.removesuffix(".toml").replace("_", "-")
    if path == Path(path.name) and name in shipped:
        return shipped[name]
    close = get_close_matches(name, shipped, 1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise RigtwinError(
        f"channel table {path} does not exist; {hint}shipped ones: {', '.join(shipped)}"
    )


def load_table(path: Path, signals: Signals = RIG) -> ChannelTable:
    """Read the channel table of a machine with these signals.

    Raises
    ------
    RigtwinError
        If the table is wrong; the message names the file and the mistake.
    """
    return read_toml(find_table(path), lambda tables: parse_table(tables, signals))


def parse_table(tables: Mapping[str, Any], signals: Signals = RIG) -> ChannelTable:
    """Read a channel table from TOML tables.

    Parameters
    ----------
    tables : mapping
        Tables [card], [plausible], [inputs.NAME] and [outputs.NAME].
    signals : Signals
        Signals of the machine.

    Returns
    -------
    ChannelTable
        Complete channel table.

    Raises
    ------
    RigtwinError
        If an entry is missing, unknown, or a line is used twice.
    """
    known = ("card", "plausible", "inputs", "outputs")
    for name in tables:
        if name not in known:
            raise RigtwinError(
                f"unknown table [{name}]; a channel table has [card], [plausible], [inputs.NAME], "
                "[outputs.NAME]"
            )
    card = tables.get("card", {})
    _check_card(card, signals)
    power = card[signals.power]
    inputs = _lines("inputs", tables.get("inputs", {}), signals.inputs)
    outputs = _lines("outputs", tables.get("outputs", {}), signals.outputs)
    taken: dict[str, str] = {}
    # Two signals on one line would read, or overwrite, each other's values.
    for line in inputs + outputs:
        if line.line in taken:
            raise RigtwinError(
                f"{taken[line.line]} and {line.name} are both on line {line.line}; "
                "expected a line each"
            )
        taken[line.line] = line.name
    texts = {key: card[key] for key in _FREE_TEXT if key in card}
    # Only the suspension rig has sensors that can be checked against each other.
    plausible = Plausible if signals == RIG else StuckLimit
    return ChannelTable(
        inputs,
        outputs,
        power,
        _numbers("plausible", tables.get("plausible", {}), plausible),
        **texts,
        signals=signals,
    )


def _check_card(card: Any, signals: Signals) -> None:
    """Raise RigtwinError unless the table [card] is complete and known."""
    if not isinstance(card, Mapping):
        raise RigtwinError("card: expected a table, [card]")
    for key, value in card.items():
        if key not in (*_FREE_TEXT, signals.power):
            raise RigtwinError(
                f"unknown setting card.{key}; [card] has {', '.join((*_FREE_TEXT, signals.power))}"
            )
        if not isinstance(value, str):
            raise RigtwinError(f"card.{key} = {value!r}: expected text")
    power = card.get(signals.power, "")
    if not _DIGITAL.fullmatch(power):
        raise RigtwinError(
            f"card.{signals.power} = {power!r}: expected the digital line that lets the actuators "
            "have power, such as 'port0/line0'"
        )
    timing = card.get("timing", "hardware")
    if timing not in _TIMINGS:
        raise RigtwinError(f"card.timing = {timing!r}: expected {' or '.join(_TIMINGS)}")
    if not re.fullmatch(r"[A-Za-z][\w-]*", card.get("device", "Dev1")):
        raise RigtwinError(
            f"card.device = {card['device']!r}: expected the driver's name of the card, "
            "such as 'Dev1'"
        )


def _numbers(where: str, table: Any, kind: Callable[..., Group]) -> Group:
    """Return a group of checked numbers from a table; missing ones keep their defaults."""
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}: expected a table")
    meanings = fields(kind)  # type: ignore[arg-type]
    for key in table:
        if key not in meanings:
            raise RigtwinError(f"unknown setting {where}.{key}; there are {', '.join(meanings)}")
    return kind(
        **{key: check_value(f"{where}.{key}", value, meanings[key]) for key, value in table.items()}
    )


def _lines(group: str, tables: Any, signals: Sequence[Signal]) -> tuple[CardLine, ...]:
    names = [signal.name for signal in signals]
    if not isinstance(tables, Mapping):
        raise RigtwinError(f"{group}: expected tables, such as [{group}.{names[0]}]")
    for name in tables:
        if name not in names:
            raise RigtwinError(f"unknown signal [{group}.{name}]; there are {', '.join(names)}")
    for name in names:
        if name not in tables:
            raise RigtwinError(
                f"[{group}.{name}] is missing; each of {', '.join(names)} needs its line"
            )
    return tuple(_line(group, s.name, tables[s.name], s.unit) for s in signals)


def _line(group: str, name: str, table: Any, unit: str) -> CardLine:
    where = f"{group}.{name}"
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}: expected a table with line and scale")
    texts = ("line", "unit", "sign_checked")
    line = table.get("line")
    if not isinstance(line, str) or not _ANALOG[group].fullmatch(line):
        raise RigtwinError(
            f"{where}.line = {line!r}: "
            f"expected one such as {'ai0' if group == 'inputs' else 'ao0'!r}"
        )
    if table.get("unit", unit) != unit:
        raise RigtwinError(
            f"{where}.unit = {table['unit']!r}: expected {unit!r}; scale is {unit}/V, offset {unit}"
        )
    if "scale" not in table:
        raise RigtwinError(f"{where}.scale is missing: expected {unit} a volt")
    scaling = _numbers(
        where, {key: value for key, value in table.items() if key not in texts}, LineScaling
    )
    # The range in the annotation allows −1 to 1; a sign is one of its ends.
    if abs(scaling.sign) != 1.0:
        raise RigtwinError(f"{where}.sign = {scaling.sign:g}: expected 1 or -1")
    sign_checked = table.get("sign_checked", False)
    if not isinstance(sign_checked, bool):
        raise RigtwinError(f"{where}.sign_checked = {sign_checked!r}: expected true or false")
    return CardLine(name, line, unit, scaling, sign_checked)


def to_toml(table: ChannelTable) -> str:
    """Return the channel table as TOML text."""
    lines = ["[card]", f"{table.signals.power} = {_quote(table.power)}"]
    lines += [f"{key} = {_quote(getattr(table, key))}" for key in _FREE_TEXT]
    lines += [
        "",
        "[plausible]",
        *(f"{key} = {value!r}" for key, value in table.plausible._asdict().items()),
    ]
    for group, signals in (("inputs", table.inputs), ("outputs", table.outputs)):
        for signal in signals:
            scaling = signal.scaling
            lines += [
                "",
                f"[{group}.{signal.name}]",
                f"line = {_quote(signal.line)}",
                f"unit = {_quote(signal.unit)}",
            ]
            lines += [
                f"scale = {scaling.scale!r}",
                f"offset = {scaling.offset!r}",
                f"sign = {int(scaling.sign)}",
            ]
            lines += [f"range = {scaling.range!r}"]
            lines += [f"sign_checked = {str(signal.sign_checked).lower()}"]
    return "\n".join(lines) + "\n"


def _quote(text: str) -> str:
    # Text that was read with surrogate escapes, from another encoding, cannot be written as UTF-8.
    known = text.encode("utf-8", "replace").decode()
    escaped = known.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
