"""Data acquisition card: virtual card, check of a channel table, release of held lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import resolve_machine
from rigtwin.api.twin import Effects, Settings, effect_texts
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import apply_effects
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
from rigtwin.hardware.daq.calibration import (
    RestReading,
    correct_signs,
    set_spans,
    set_zeros,
    sign_off,
)
from rigtwin.hardware.daq.driver import require_client
from rigtwin.hardware.daq.failsafe import release
from rigtwin.hardware.daq.table import OUTPUTS, ChannelTable, require_ranges
from rigtwin.hardware.daq.table_file import load_table, to_toml
from rigtwin.hardware.daq.virtual import RealTime, VirtualCard
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.table_check import (
    LEAST_STROKE,
    MOST_STROKE,
    direction_of_wiring,
    look_at_rest,
    move_outputs,
)

PORTS = 65535


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


@dataclass(frozen=True)
class ServedCard:
    """Virtual card on a port of this computer.

    Attributes
    ----------
    device : str
        Name of the card.
    address : str
        Host and port, for `card.address` of a channel table.
    ticks : callable
        Returns the number of ticks that the twin has run.
    close : callable
        Stops the server.
    """

    device: str
    address: str
    ticks: Callable[[], int]
    close: Callable[[], object]


def serve_card(
    card: str | Path,
    *,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    port: int = 0,
    settings: Settings = (),
    effects: Effects = (),
    seed: int = 0,
) -> ServedCard:
    """Serve a virtual card to NI-DAQmx gRPC clients on this computer; a twin runs behind it.

    Parameters
    ----------
    card
        Channel table: the wiring between twin and card, TOML.
    machine
        Machine of the twin, or its name, or the path of its description.
    port
        Port of the server. 0, the default, takes a free port.
    settings
        Changes of the twin's configuration.
    effects
        Effects added to the twin.
    seed
        Seed of the sensor noise, at least 0.

    Returns
    -------
    ServedCard
        The running server; call its `close` at the end.

    Raises
    ------
    RigtwinError
        For a mistake in an argument, a port in use, or a missing package.
    """
    # Before the imports below, which need the same optional package.
    require_client()
    from rigtwin.hardware.daq.transport import LOCAL, serve

    if seed < 0 or not 0 <= port <= PORTS:
        raise RigtwinError(f"seed: expected 0 or more; port: 0 to {PORTS}")
    described = resolve_machine(machine)
    configuration = with_changes(described.configuration, settings)
    actual = apply_effects(configuration, effect_texts(effects))
    table = load_table(Path(card), described.physics.signals(described))
    terminals = described.physics.terminals(described, actual, table, seed)
    # In real time, since its clients run on clocks of their own.
    virtual = VirtualCard(terminals, table, RealTime(configuration.timing.period))
    server, open_port = serve(virtual, port)
    return ServedCard(
        table.device,
        f"{LOCAL}:{open_port}",
        lambda: virtual.tick,
        # Half a second lets running calls end; then the port is free.
        lambda: server.stop(0.5).wait(),
    )


def release_card(card: str | Path, *, machine: Machine | str | Path = DEFAULT_MACHINE) -> bool:
    """Release the lines that a dead program holds on a gRPC device server.

    All outputs are set to zero and the power is switched off first.

    Parameters
    ----------
    card
        Channel table of the card, TOML.
    machine
        Machine on the card, or its name, or the path of its description.

    Returns
    -------
    bool
        Whether any line was held.

    Raises
    ------
    RigtwinError
        If the channel table names no server.
    """
    described = resolve_machine(machine)
    table = load_table(Path(card), described.physics.signals(described))
    if not table.address:
        raise RigtwinError(
            "card.address is empty: "
            "the driver of this computer frees a dead program's lines by itself"
        )
    return release(table)


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
