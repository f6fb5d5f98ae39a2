"""Channel table: the line of each signal on the card, and the meaning of a volt on that line.

There is one TOML file per card. Inputs and outputs convert by the same equation,

    value = sign · scale · volts + offset.
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
"""Commands of the rig that go to the card, in the order in which they are written."""
HEADROOM = 1.05
"""Factor by which a line's range must exceed the signal's limit. A signal that saturates at its
limit could never be seen to exceed it."""
# Names of the driver's lines, such as ai0, ao3 and port0/line2.
_ANALOG = {"inputs": re.compile(r"ai\d{1,3}"), "outputs": re.compile(r"ao\d{1,2}")}
_DIGITAL = re.compile(r"port\d/line\d{1,2}")
OLDEST = 10 * 365
"""Age in days above which a calibration is refused."""
_FREE_TEXT = ("device", "address", "timing", "calibrated", "operator", "note")
_TIMINGS = ("hardware", "software")


class LineScaling(NamedTuple):
    """Meaning of a volt on a line."""

    scale: Annotated[float, Quantity("unit/V", 1e-9, 1e9, "calibration")]
    offset: Annotated[float, Quantity("unit", -1e6, 1e6, "calibration")] = 0.0
    sign: Annotated[float, Quantity("1", -1.0, 1.0, "which way the cable is connected")] = 1.0
    range: Annotated[float, Quantity("V", 0.05, 10.0, "of the card's line, both ways")] = 10.0


class Plausible(NamedTuple):
    """Limits of what working sensors of the suspension rig can show together.

    See rigtwin.simulation.safety. `stuck` counts equal readings in a row. The largest values on
    the twin in all experiments are 4 readings, 9.5 mm and 34 N.
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


class StuckLimit(NamedTuple):
    """Limit of what working sensors of a described machine can show.

    `stuck` counts equal readings in a row; 0 where a working sensor may repeat itself.
    """

    stuck: Annotated[
        float, Quantity("tick", 0.0, 1e9, "of readings after the card's conversion")
    ] = 0.0


class CardLine(NamedTuple):
    """Line of the card, and the machine's signal on it.

    Attributes
    ----------
    name
        Name of the signal.
    line
        Name of the line in the driver, without the device's name.
    unit
        Unit of the signal.
    scaling
        Meaning of a volt.
    sign_checked
        Whether an operator has seen the signal move in the right direction.
    """

    name: str
    line: str
    unit: str
    scaling: LineScaling
    sign_checked: bool

    @property
    def reach(self) -> float:
        """Largest magnitude, in the signal's unit, that the line can carry in both directions."""
        # An offset shifts the range, so one direction carries less.
        return self.scaling.range * self.scaling.scale - abs(self.scaling.offset)


@dataclass(frozen=True)
class ChannelTable:
    """Channel table of a card.

    Parameters
    ----------
    inputs, outputs : tuple of CardLine
        Lines in the order of the machine's signals.
    power : str
        Digital line that enables the actuators' power while high; on the suspension rig, the
        hydraulic pressure.
    plausible : Plausible or StuckLimit
        Limits of what working sensors can show.
    device : str
        Name of the card in the driver.
    address : str
        Address of a gRPC device server; empty for this computer's driver.
    timing : str
        `hardware` or `software`: the clock that the inputs follow.
    calibrated, operator, note : str
        Date, author and remark of the calibration.
    signals : Signals
        Signals of the machine on the card.
    """

    inputs: tuple[CardLine, ...]
    outputs: tuple[CardLine, ...]
    power: str
    plausible: Plausible | StuckLimit
    device: str = "Dev1"
    address: str = ""
    timing: str = "hardware"
    calibrated: str = ""
    operator: str = ""
    note: str = ""
    signals: Signals = RIG

    @property
    def lines(self) -> tuple[CardLine, ...]:
        """All lines, inputs first."""
        return self.inputs + self.outputs

    def physical(self, line: str) -> str:
        """Return the driver's full name of a line."""
        return f"{self.device}/{line}"

    def tighten(self, safety: Safety) -> Safety:
        """Return the limits, tightened by the table's limits on plausibility."""
        # The fields of Plausible have the names of the limits in Safety that they tighten.
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


def require_ranges(table: ChannelTable, safety: Safety) -> None:
    """Raise RigtwinError unless every line can carry its signal up to the rig's limit."""
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
    """Raise RigtwinError unless every line can carry its signal up to a limit.

    Parameters
    ----------
    table
        Channel table.
    limits
        Signal → name and magnitude of its limit, in the signal's unit.
    """
    inputs = [line.name for line in table.inputs]
    for line in table.lines:
        key, limit = limits.get(line.name, ("", 0.0))
        # An input must show that a limit is exceeded; an output must only reach it.
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
    """Return the reasons why this table must not move a real machine, one per line.

    A table is trusted if every sign was checked, and it states when and by whom it was calibrated.
    """
    doubts: list[str] = []
    unchecked = [line.name for line in table.lines if not line.sign_checked]
    if unchecked:
        how = (
            "rigtwin card check moves each a little and looks"
            if table.signals == RIG
            else "move each a little, and say sign_checked = true once it goes the right way"
        )
        doubts.append(f"sign not checked: {', '.join(unchecked)}; {how}")
    entry = f"card.calibrated = {table.calibrated!r}"
    try:
        calibrated = date.fromisoformat(table.calibrated)
    except ValueError:
        doubts.append(f"{entry}: expected the date of calibration, 2026-01-31")
    else:
        entry = f"card.calibrated = {table.calibrated}"
        if calibrated > today:
            doubts.append(f"{entry}: that is after today, {today}")
        if (today - calibrated).days > OLDEST:
            doubts.append(
                f"{entry}: that is more than {OLDEST // 365} years ago; calibrate it anew"
            )
    if not table.operator.strip():
        doubts.append("card.operator is missing: expected who calibrated it")
    return doubts


def require_trust(table: ChannelTable, today: date) -> None:
    """Raise RigtwinError unless the table may move a real machine (see `list_doubts`)."""
    # The first doubt alone is raised, because an error is one line.
    for doubt in list_doubts(table, today):
        raise RigtwinError(doubt)


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
