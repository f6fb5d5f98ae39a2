"""Check of a card's wiring, signs and ranges before a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
from rigtwin.hardware.daq.calibration import (
    RestReading,
    correct_signs,
    set_spans,
    set_zeros,
    sign_off,
)
from rigtwin.hardware.daq.table import OUTPUTS, ChannelTable, require_ranges
from rigtwin.hardware.daq.table_file import load_table, to_toml
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.table_check import (
    LEAST_STROKE,
    MOST_STROKE,
    direction_of_wiring,
    look_at_rest,
    move_outputs,
)


@dataclass(frozen=True)
class TableCheck:
    """Result of the check of a channel table.

    Attributes
    ----------
    table : ChannelTable
        Corrected table, with operator and date.
    rest : tuple of RestReading
        Reading of every input at rest. Empty if neither zero nor span was checked.
    changes : tuple of str
        Corrections of signs, one line each.
    """

    table: ChannelTable
    rest: tuple[RestReading, ...]
    changes: tuple[str, ...]


def check_card(
    card: str | Path,
    *,
    operator: str,
    note: str = "",
    zero: bool = False,
    references: Mapping[str, float] | None = None,
    spans: Mapping[str, float] | None = None,
    signs: bool = False,
    stroke: float = 0.005,
    directions: Mapping[str, int] | None = None,
    arm: Callable[[], bool] = lambda: False,
    ask: Callable[[str], int] | None = None,
    virtual: str | Path | None = None,
    stop: Callable[[], str | None] | None = None,
    show: Callable[[tuple[RestReading, ...]], object] = lambda _: None,
) -> TableCheck:
    """Calibrate zero, span and signs of a channel table on the rig in its present state.

    Parameters
    ----------
    card
        Channel table to correct, TOML.
    operator, note
        Name of the person who calibrates, and a remark. Both are stored in the table.
    zero
        Whether every input is at its reference value now, so that its zero can be set.
    references
        Reference values that are not zero: input → value in the input's unit, used with `zero`.
    spans
        Present values from which the span is set: input → value in the input's unit.
    signs
        Whether to move each output slightly and observe which signals follow.
    stroke
        Stroke of the plates in m, used with `signs`, 0.005 by default.
    directions
        Known direction of motion: output → 1 or -1.
    arm, ask
        Functions that ask, before anything moves, whether everybody is clear of the rig; and in
        which direction an output moved, 1 or -1. A virtual card needs neither.
    virtual
        Channel table by which a virtual card is wired. The check then uses it in place of the rig.
    stop
        Function that returns a reason to end the motion, or None. By default the motion ends at a
        key, or at a signal such as Ctrl-C's.
    show
        Function called with the readings at rest as soon as they are known.

    Returns
    -------
    TableCheck
        Corrected table, which `write_table` writes.

    Raises
    ------
    RigtwinError
        For a mistake in an argument, a dead input, or a motion that was stopped.
    """
    table = load_table(Path(card))
    if not operator.strip():
        raise RigtwinError("operator is empty: expected who calibrates")
    zeros, present, known = dict(references or {}), dict(spans or {}), dict(directions or {})
    _require_values(zeros, "reference", table)
    _require_values(present, "span", table)
    _require_motion(stroke, known)
    require_ranges(table, Configuration().safety)
    if not (signs or zero or present):
        raise RigtwinError("nothing to check: expected zero, span NAME=VALUE or signs")
    wiring = None if virtual is None else load_table(Path(virtual))
    corrected, changes, rest = table, (), ()
    # Signs first: zero and span depend on them. The span before the zero: the zero is set at the
    # corrected span.
    if signs:
        if wiring is None and not arm():
            raise RigtwinError("not armed; nothing moved")
        with nullcontext(stop) if stop is not None else stop_requests() as stop_request:
            responses = move_outputs(table, wiring, stroke, stop_request)
        moved = {output: _direction(output, known, table, wiring, ask) for output in OUTPUTS}
        corrected, changes = correct_signs(table, responses, moved)
    if zero or present:
        rest = look_at_rest(corrected, wiring)
        show(rest)
        corrected = set_spans(corrected, rest, present) if present else corrected
        corrected = set_zeros(corrected, rest, zeros) if zero else corrected
    # The corrections may have changed what a line can carry.
    require_ranges(corrected, Configuration().safety)
    return TableCheck(sign_off(corrected, operator, note, date.today()), rest, changes)


def _require_motion(stroke: float, directions: Mapping[str, int]) -> None:
    """Raise RigtwinError for a stroke in m, or directions of outputs, that are not allowed."""
    if not LEAST_STROKE <= stroke <= MOST_STROKE:
        raise RigtwinError(f"stroke {stroke:g}: expected {LEAST_STROKE:g} to {MOST_STROKE:g} m")
    for name, sign in directions.items():
        if name not in OUTPUTS or sign not in (1, -1):
            raise RigtwinError(
                f"moved {name}: expected one of {', '.join(OUTPUTS)} and + or -, such as ground=+"
            )


def _direction(
    output: str,
    known: Mapping[str, int],
    table: ChannelTable,
    wiring: ChannelTable | None,
    ask: Callable[[str], int] | None,
) -> int:
    """Return the direction in which an output moved: as stated, as wired, or as a person says."""
    if output in known:
        return known[output]
    if wiring is not None:
        return direction_of_wiring(output, table, wiring)
    if ask is None:
        raise RigtwinError(f"direction of {output} is unknown: expected `directions` or `ask`")
    return ask(output)


def write_table(table: ChannelTable, path: str | Path) -> None:
    """Write a channel table as TOML.

    Parameters
    ----------
    table
        Channel table, such as that of `TableCheck`.
    path
        File to write; replaced if it exists.

    Raises
    ------
    RigtwinError
        If the file cannot be written.
    """
    atomic_write(Path(path), to_toml(table))


def _require_values(values: Mapping[str, float], option: str, table: ChannelTable) -> None:
    """Refuse a value of an unknown input, or a value that is not finite."""
    names = [line.name for line in table.inputs]
    for name, value in values.items():
        if name not in names or not np.isfinite(value):
            raise RigtwinError(
                f"{option} {name}={value:g}: expected one of {', '.join(names)} and a number"
            )
