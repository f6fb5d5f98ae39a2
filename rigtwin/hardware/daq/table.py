"""The channel table: which signal is on which line of the card, and what a volt means there.

One TOML file a card.

value = sign · scale · volts + offset, in both directions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from controllers.quantity import Quantity, fields
from rigtwin.description.changes import check_value, read_toml
from rigtwin.description.settings import Safety
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.signals import RIG, Signal, Signals

Group = TypeVar("Group")
OUTPUTS = tuple(signal.name for signal in RIG.outputs)
"""Commands of the rig that go to the card, in the order of its writes."""
HEADROOM = 1.05
"""A signal must be readable this far beyond its limit: one that stops at its limit can never be
seen to exceed it."""
_ANALOG = {"inputs": re.compile(r"ai\d{1,3}"), "outputs": re.compile(r"ao\d{1,2}")}
_DIGITAL = re.compile(r"port\d/line\d{1,2}")
OLDEST = 10 * 365
"""Days after which a calibration is none."""
_FREE_TEXT = ("device", "address", "timing", "calibrated", "operator", "note")
_TIMINGS = ("hardware", "software")


class Scaling(NamedTuple):
    """What a volt means on a line."""

    scale: Annotated[float, Quantity("unit/V", 1e-9, 1e9, "calibration")]
    offset: Annotated[float, Quantity("unit", -1e6, 1e6, "calibration")] = 0.0
    sign: Annotated[float, Quantity("1", -1.0, 1.0, "which way the cable is connected")] = 1.0
    range: Annotated[float, Quantity("V", 0.05, 10.0, "of the card's line, both ways")] = 10.0


class Plausible(NamedTuple):
    """What living sensors of one rig cannot do; see rigtwin.simulation.safety.

    stuck: same readings in a row. Greatest seen on the twin in all experiments: 4 readings, 9.5
    mm, 34 N.
    """

    stuck: Annotated[
        float, Quantity("tick", 3.0, 1e9, "by chance in none of 1800 simulated tests of 45 s")
    ] = 7.0
    wheel: Annotated[
        float, Quantity("m", 1e-4, 1e9, "twice what the tyre gives in the experiments")
    ] = 0.02
    motor: Annotated[
        float, Quantity("N", 1.0, 1e9, "3 times friction, hum and noise in the experiments")
    ] = 100.0


class Alive(NamedTuple):
    """What living sensors of a described machine cannot do. stuck: same readings in a row; 0 where
    a sensor that is alive may well give them."""

    stuck: Annotated[float, Quantity("tick", 0.0, 1e9, "of readings as the card has them")] = 0.0


class Line(NamedTuple):
    """One signal of the machine.

    line: as the driver calls it behind the device's name. sign_checked: whether somebody has seen
    the signal move the way that it should.
    """

    name: str
    line: str
    unit: str
    scaling: Scaling
    sign_checked: bool

    @property
    def reach(self) -> float:
        """The greatest magnitude that fits through the line both ways."""
        return self.scaling.range * self.scaling.scale - abs(self.scaling.offset)


@dataclass(frozen=True)
class ChannelTable:
    """A card's channel table.

    Parameters
    ----------
    inputs, outputs : tuple of Line
        In the order of its machine's signals.
    power : str
        The digital line that lets the actuators have power while high: of the rig, the hydraulics
        their pressure.
    plausible : Plausible
        What its sensors cannot do.
    device : str
        The driver's name of the card.
    address : str
        Of a gRPC device server, empty for this computer's driver.
    timing : str
        hardware or software: whose clock the inputs follow.
    calibrated, operator, note : str
        When, by whom, and what they say.
    signals : Signals
        Of the machine that it is of.
    """

    inputs: tuple[Line, ...]
    outputs: tuple[Line, ...]
    power: str
    plausible: Plausible | Alive
    device: str = "Dev1"
    address: str = ""
    timing: str = "hardware"
    calibrated: str = ""
    operator: str = ""
    note: str = ""
    signals: Signals = RIG

    @property
    def lines(self) -> tuple[Line, ...]:
        return self.inputs + self.outputs

    def physical(self, line: str) -> str:
        """The driver's name of a line."""
        return f"{self.device}/{line}"

    def tighten(self, safety: Safety) -> Safety:
        """Gives the limits with what the card knows of its sensors, where that is closer."""
        return safety._replace(
            **{
                name: min(value, getattr(safety, name))
                for name, value in self.plausible._asdict().items()
            }
        )


def find_table(path: Path) -> Path:
    """Find a channel table: a file, or one that is shipped, by its name with or without `.toml`.

    Raises
    ------
    RigtwinError
        If there is neither; the message lists the shipped ones.
    """
    if path.exists():
        return path
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
    """Reads the channel table of a machine with these signals. Raises RigtwinError naming file and
    fault."""
    return read_toml(find_table(path), lambda tables: parse_table(tables, signals))


def parse_table(tables: Mapping[str, Any], signals: Signals = RIG) -> ChannelTable:
    """Reads a channel table from TOML's tables.

    Parameters
    ----------
    tables : mapping
        [card], [plausible], [inputs.NAME], [outputs.NAME].
    signals : Signals
        Of its machine.

    Returns
    -------
    ChannelTable
        Complete.

    Raises
    ------
    RigtwinError
        For anything missing, unknown or twice.
    """
    known = ("card", "plausible", "inputs", "outputs")
    for name in tables:
        if name not in known:
            raise RigtwinError(
                f"unknown table [{name}]; a channel table has [card], [plausible], [inputs.NAME], "
                "[outputs.NAME]"
            )
    card = tables.get("card", {})
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
    inputs = _lines("inputs", tables.get("inputs", {}), signals.inputs)
    outputs = _lines("outputs", tables.get("outputs", {}), signals.outputs)
    taken: dict[str, str] = {}
    for line in inputs + outputs:
        if line.line in taken:
            raise RigtwinError(
                f"{taken[line.line]} and {line.name} are both on line {line.line}; "
                "expected a line each"
            )
        taken[line.line] = line.name
    texts = {key: card[key] for key in _FREE_TEXT if key in card}
    plausible = Plausible if signals == RIG else Alive
    return ChannelTable(
        inputs,
        outputs,
        power,
        _numbers("plausible", tables.get("plausible", {}), plausible),
        **texts,
        signals=signals,
    )


def _numbers(where: str, table: Any, kind: Callable[..., Group]) -> Group:
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}: expected a table")
    meanings = fields(kind)  # type: ignore[arg-type]
    for key in table:
        if key not in meanings:
            raise RigtwinError(f"unknown setting {where}.{key}; there are {', '.join(meanings)}")
    return kind(
        **{key: check_value(f"{where}.{key}", value, meanings[key]) for key, value in table.items()}
    )


def _lines(group: str, tables: Any, signals: Sequence[Signal]) -> tuple[Line, ...]:
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


def _line(group: str, name: str, table: Any, unit: str) -> Line:
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
        where, {key: value for key, value in table.items() if key not in texts}, Scaling
    )
    if abs(scaling.sign) != 1.0:
        raise RigtwinError(f"{where}.sign = {scaling.sign:g}: expected 1 or -1")
    sign_checked = table.get("sign_checked", False)
    if not isinstance(sign_checked, bool):
        raise RigtwinError(f"{where}.sign_checked = {sign_checked!r}: expected true or false")
    return Line(name, line, unit, scaling, sign_checked)


def require_ranges(table: ChannelTable, safety: Safety) -> None:
    """Raises RigtwinError unless every limit of the rig lies within what its line can carry."""
    require_reach(
        table,
        {
            "ground_lvdt": ("safety.ground", safety.ground),
            "structure_lvdt": ("safety.structure", safety.structure),
            "suspension_lvdt": ("safety.travel", safety.travel),
            "load_cell": ("safety.force", safety.force),
            "ground": ("safety.ground", safety.ground),
            "structure": ("safety.structure", safety.structure),
        },
    )


def require_reach(table: ChannelTable, limits: Mapping[str, tuple[str, float]]) -> None:
    """Raises RigtwinError unless every limit lies within what its line can carry. limits: signal →
    the limit's name, and its magnitude."""
    inputs = [line.name for line in table.inputs]
    for line in table.lines:
        key, limit = limits.get(line.name, ("", 0.0))
        if line.reach < HEADROOM * limit and line.name in inputs:
            raise RigtwinError(
                "range too small for the limit: "
                f"{line.name} on {line.line} reads up to {line.reach:.4g} {line.unit}, "
                f"{key} is {limit:g} {line.unit}; expected at least {HEADROOM:g} times that, "
                "or a smaller limit"
            )
        if line.reach < limit:
            raise RigtwinError(
                "range too small for the limit: "
                f"{line.name} on {line.line} commands up to {line.reach:.4g} {line.unit}, "
                f"{key} is {limit:g} {line.unit}"
            )


def list_doubts(table: ChannelTable, today: date) -> list[str]:
    """Why this table must not move a real machine, a line each: signs that nobody has checked, or
    no word of when and by whom it was calibrated."""
    found: list[str] = []
    unchecked = [line.name for line in table.lines if not line.sign_checked]
    if unchecked:
        how = (
            "rigtwin card check moves each a little and looks"
            if table.signals == RIG
            else "move each a little, and say sign_checked = true once it goes the right way"
        )
        found.append(f"sign not checked: {', '.join(unchecked)}; {how}")
    told = f"card.calibrated = {table.calibrated!r}"
    try:
        calibrated = date.fromisoformat(table.calibrated)
    except ValueError:
        found.append(f"{told}: expected the date of calibration, 2026-01-31")
    else:
        told = f"card.calibrated = {table.calibrated}"
        if calibrated > today:
            found.append(f"{told}: that is after today, {today}")
        if (today - calibrated).days > OLDEST:
            found.append(f"{told}: that is more than {OLDEST // 365} years ago; calibrate it anew")
    if not table.operator.strip():
        found.append("card.operator is missing: expected who calibrated it")
    return found


def require_trust(table: ChannelTable, today: date) -> None:
    """Raises RigtwinError unless somebody has calibrated this table and checked every sign.

    Needed to move a real machine.
    """
    for doubt in list_doubts(table, today):
        raise RigtwinError(doubt)


def to_toml(table: ChannelTable) -> str:
    """The table as TOML."""
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
    # What came in another encoding than UTF-8 has no sign of its own.
    known = text.encode("utf-8", "replace").decode()
    escaped = known.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
