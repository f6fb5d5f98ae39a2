"""The data acquisition card: a virtual one on a port, the check of a channel table, lines that a
dead program holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import Effects, Settings, effect_texts, resolve_machine
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
from rigtwin.hardware.daq.card import require_client
from rigtwin.hardware.daq.failsafe import release
from rigtwin.hardware.daq.table import OUTPUTS, ChannelTable, load_table, require_ranges, to_toml
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
    """table: as found, signed and dated; rest: what every input read, if that was looked at; said:
    what was changed, a line each."""

    table: ChannelTable
    rest: tuple[RestReading, ...]
    said: tuple[str, ...]


@dataclass(frozen=True)
class ServedCard:
    """A virtual card that answers on a port of this computer. ticks: how far its clock has come;
    close: ends it."""

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
    """Lets the twin, in real time, be the card of any NI-DAQmx gRPC client on this computer.

    Parameters
    ----------
    card
        The channel table: how the twin is wired to the card.
    machine
        Whose twin, by name or description.
    port
        0 takes a free one.
    settings, effects
        Of the twin.
    seed
        Of the sensors' noise.

    Raises
    ------
    RigtwinError
        For a mistake in these, a port that is taken, or a missing package.
    """
    require_client()
    from rigtwin.hardware.daq.transport import LOCAL, serve

    if seed < 0 or not 0 <= port <= PORTS:
        raise RigtwinError(f"seed: expected 0 or more; port: 0 to {PORTS}")
    on = resolve_machine(machine)
    configuration = with_changes(on.configuration, settings)
    actual = apply_effects(configuration, effect_texts(effects))
    table = load_table(Path(card), on.physics.signals(on))
    terminals = on.physics.terminals(on, actual, table, seed)
    virtual = VirtualCard(terminals, table, RealTime(configuration.timing.period))
    server, taken = serve(virtual, port)
    return ServedCard(
        table.device,
        f"{LOCAL}:{taken}",
        lambda: virtual.tick,
        lambda: server.stop(0.5).wait(),
    )


def release_card(card: str | Path, *, machine: Machine | str | Path = DEFAULT_MACHINE) -> bool:
    """Frees what a program that died has left on a gRPC device server, with all outputs at zero and
    the power off.

    Parameters
    ----------
    card
        The channel table.
    machine
        Of which machine, by name or description.

    Returns
    -------
    bool
        Whether anything had been left.

    Raises
    ------
    RigtwinError
        If the card has no server.
    """
    on = resolve_machine(machine)
    table = load_table(Path(card), on.physics.signals(on))
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
    """Finds zero, span and signs of a channel table on the rig as it stands.

    Parameters
    ----------
    card
        The table to begin with.
    operator, note
        Who does it, and what is to be kept in the table.
    zero
        Whether every input reads its reference now.
    references
        Input → what it reads with `zero`, in its unit, where that is not zero.
    spans
        Input → what it reads now.
    signs
        Whether to move each output a little and see which signal follows, and how.
    stroke
        m, of the plates, with `signs`.
    directions
        Output → which way it goes, 1 or −1, where that is known.
    arm
        Asks, before anything moves, whether everybody is clear of the rig.
    ask
        Asks which way an output went, 1 or −1; not needed of a virtual card.
    virtual
        The table that a virtual card is wired by, in the rig's place.
    stop
        Gives a reason to end the motion; by default it ends at a key or a signal such as Ctrl-C's.
    show
        Called with what the inputs read at rest, as soon as that is known.

    Returns
    -------
    TableCheck
        The table as found; it is not written.

    Raises
    ------
    RigtwinError
        For a mistake in these, an input that is dead, or a motion that was stopped.
    """
    table = load_table(Path(card))
    if not operator.strip():
        raise RigtwinError("operator is empty: expected who calibrates")
    given, reads, known = dict(references or {}), dict(spans or {}), dict(directions or {})
    _require_values(given, "reference", table)
    _require_values(reads, "span", table)
    if not LEAST_STROKE <= stroke <= MOST_STROKE:
        raise RigtwinError(f"stroke {stroke:g}: expected {LEAST_STROKE:g} to {MOST_STROKE:g} m")
    for name, sign in known.items():
        if name not in OUTPUTS or sign not in (1, -1):
            raise RigtwinError(
                f"moved {name}: expected one of {', '.join(OUTPUTS)} and + or -, such as ground=+"
            )
    require_ranges(table, Configuration().safety)
    if not (signs or zero or reads):
        raise RigtwinError("nothing to do: zero, span NAME=VALUE or signs")
    wiring = None if virtual is None else load_table(Path(virtual))

    def find_direction(output: str) -> int:
        if output in known:
            return known[output]
        if wiring is not None:
            return direction_of_wiring(output, table, wiring)
        if ask is None:
            raise RigtwinError(f"which way {output} went is not known, and nobody was asked")
        return ask(output)

    said: tuple[str, ...] = ()
    still: tuple[RestReading, ...] = ()
    found = table
    if signs:
        if wiring is None and not arm():
            raise RigtwinError("not armed; nothing moved")
        with nullcontext(stop) if stop is not None else stop_requests() as asked:
            responses = move_outputs(table, wiring, stroke, asked)
        moved = {output: find_direction(output) for output in OUTPUTS}
        found, said = correct_signs(table, responses, moved)
    if zero or reads:
        still = look_at_rest(found, wiring)
        show(still)
        found = set_spans(found, still, reads) if reads else found
        found = set_zeros(found, still, given) if zero else found
    require_ranges(found, Configuration().safety)
    return TableCheck(sign_off(found, operator, note, date.today()), still, said)


def write_table(table: ChannelTable, path: str | Path) -> None:
    """Writes a channel table. Raises RigtwinError if it cannot."""
    atomic_write(Path(path), to_toml(table))


def _require_values(values: Mapping[str, float], option: str, table: ChannelTable) -> None:
    names = [line.name for line in table.inputs]
    for name, value in values.items():
        if name not in names or not np.isfinite(value):
            raise RigtwinError(
                f"{option} {name}={value:g}: expected one of {', '.join(names)} and a number"
            )
