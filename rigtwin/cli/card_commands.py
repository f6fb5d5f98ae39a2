"""`rigtwin card`: a virtual card on a port, and the check that a channel table is true."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rigtwin.console import apart, configured, writable
from rigtwin.console import table as tabulated
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import apply_effects
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.calibration import (
    FORCE,
    correct_signs,
    fit_responses,
    measure_rest,
    plan_bumps,
    set_spans,
    set_zeros,
    sign_off,
)
from rigtwin.hardware.daq.card import Card, connect, require_client
from rigtwin.hardware.daq.failsafe import release
from rigtwin.hardware.daq.table import (
    OUTPUTS,
    ChannelTable,
    Plausible,
    load_table,
    require_ranges,
    to_toml,
)
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.virtual import OnDemand, RealTime, VirtualCard
from rigtwin.hardware.realtime import Pacer
from rigtwin.hardware.session.record import Test, record_at_leisure, record_in_real_time
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.supervisor import COMPLETED
from rigtwin.recording import load

PORTS = 65535
LEAST_STROKE, MOST_STROKE = 0.001, 0.02
"""m that a plate is moved to see its sign: well above noise, well within any rig."""


def serve(parsed: Namespace) -> int:
    """Serves a virtual card with the twin at its terminals, in real time, on this computer."""
    require_client()
    from rigtwin.hardware.daq.transport import LOCAL
    from rigtwin.hardware.daq.transport import serve as listen

    if parsed.seed < 0 or not 0 <= parsed.port <= PORTS:
        raise RigtwinError(f"--seed: expected 0 or more; --port: 0 to {PORTS}")
    table = load_table(parsed.card)
    configuration = configured(Configuration(), parsed)
    terminals = Terminals(apply_effects(configuration, parsed.effect), table, parsed.seed)
    card = VirtualCard(terminals, table, RealTime(configuration.timing.period))
    server, port = listen(card, parsed.port)
    print(
        f"virtual card {table.device}: "
        f'set address = "{LOCAL}:{port}" in the channel table. Ctrl-C ends it.',
        flush=True,
    )
    with stop_requests() as stop:
        while stop() is None:
            time.sleep(0.1)
    server.stop(0.5).wait()
    print(f"{card.tick} ticks")
    return 0


def free(parsed: Namespace) -> int:
    """Frees what a program that died has left on a gRPC device server."""
    table = load_table(parsed.card)
    if not table.address:
        raise RigtwinError(
            "card.address is empty: "
            "the driver of this computer frees a dead program's lines by itself"
        )
    left = release(table)
    print(
        "motor at zero, pressure off; "
        f"{'what a dead program had is free' if left else 'nothing had been left'}"
    )
    return 0


def check(parsed: Namespace) -> int:
    """Zero, span and signs of a channel table, written with date and name."""
    table = load_table(parsed.card)
    apart(parsed.out, parsed.card)
    writable(parsed.out)
    if not parsed.operator.strip():
        raise RigtwinError("--operator is empty: expected who calibrates")
    spans, references = (
        _parse_values(parsed.span, "--span", table),
        _parse_values(parsed.reference, "--reference", table),
    )
    if not LEAST_STROKE <= parsed.stroke <= MOST_STROKE:
        raise RigtwinError(
            f"--stroke {parsed.stroke:g}: expected {LEAST_STROKE:g} to {MOST_STROKE:g} m"
        )
    told = _parse_directions(parsed.moved)
    require_ranges(table, Configuration().safety)
    if not (parsed.signs or parsed.zero or spans):
        raise RigtwinError("nothing to do: --zero, --span NAME=VALUE or --signs")
    wiring = load_table(parsed.virtual) if parsed.virtual is not None else None
    if parsed.signs:
        table = _signs(table, wiring, parsed, told)
    if parsed.zero or spans:
        rig = _rig(table, wiring)
        try:
            rig.start()
            still = measure_rest(rig)
        finally:
            rig.stop()
        rows: list[tuple[str, ...]] = [("signal", "mean", "noise", "same in a row")]
        rows += [(s.name, f"{s.mean:.5g}", f"{s.noise:.3g} rms", str(s.repeats)) for s in still]
        print(tabulated(rows))
        for signal in still:
            if signal.repeats >= table.plausible.stuck:
                raise RigtwinError(
                    f"{signal.name} gave {signal.repeats} times the same reading: "
                    "stuck or not connected"
                )
        table = set_spans(table, still, spans) if spans else table
        table = set_zeros(table, still, references) if parsed.zero else table
    require_ranges(table, Configuration().safety)
    table = sign_off(table, parsed.operator, parsed.note, date.today())
    try:
        parsed.out.write_text(to_toml(table), encoding="utf-8")
    except OSError as error:
        raise RigtwinError(f"cannot write {parsed.out}: {error.strerror}") from None
    print(f"channel table in {parsed.out}")
    return 0


def _parse_values(texts: Sequence[str], option: str, table: ChannelTable) -> dict[str, float]:
    """input → value of each NAME=VALUE. Raises RigtwinError."""
    names, found = [line.name for line in table.inputs], dict[str, float]()
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise RigtwinError(
                f"{option} {text}: expected NAME=NUMBER, such as structure_lvdt=0.1"
            ) from None
        if name not in names or not np.isfinite(found[name]):
            raise RigtwinError(f"{option} {text}: expected one of {', '.join(names)} and a number")
    return found


def _rig(table: ChannelTable, wiring: ChannelTable | None) -> Card:
    """The card, or a virtual one that is wired as `wiring` says."""
    period = Configuration().timing.period
    if wiring is None:
        card = Card(
            table,
            period,
            connect(table.address),
            pacer=Pacer(period) if table.timing == "software" else None,
        )
    else:
        require_client()
        from rigtwin.hardware.daq.transport import InProcess

        virtual = VirtualCard(Terminals(Configuration(), wiring, 0), wiring, OnDemand())
        card = Card(table, period, InProcess(virtual), clock=lambda: virtual.tick * period)
    card.inspect()
    return card


def _signs(
    table: ChannelTable, wiring: ChannelTable | None, parsed: Namespace, told: Mapping[str, int]
) -> ChannelTable:
    """Moves every output a little, under supervision, and turns the signs that are wrong."""
    if wiring is None and not parsed.arm:
        _ask(
            "the check moves ground, structure and motor a little; "
            "everybody clear? type arm to go: ",
            ("arm",),
        )
    rig = _rig(table, wiring)
    configuration, demands = plan_bumps(parsed.stroke, FORCE, Configuration().timing.period)
    # Signals whose signs are unknown cannot be held against each other; each alone still can.
    alone = replace(table, plausible=Plausible(stuck=table.plausible.stuck, wheel=1e9, motor=1e9))
    test = Test("sign check", configuration, demands, 0, alone)
    with TemporaryDirectory(prefix="rigtwin-check-") as folder, stop_requests() as stop:
        path = Path(folder) / "check.mcap"
        if wiring is None:
            ended = record_in_real_time(rig, test, path, stop, guarded=True)
        else:
            ended = record_at_leisure(rig, test, path, stop)
        if ended.cause != COMPLETED:
            raise RigtwinError(f"the check was stopped: {ended.cause.reason}")
        recording = load(path)
    if recording.ticks != len(demands):
        raise RigtwinError(
            f"{len(demands) - recording.ticks} ticks were missed; do it again, "
            "with less else on this computer"
        )
    measured = np.column_stack([recording.column("/sensor", line.name) for line in table.inputs])
    moved = {output: _find_direction(output, table, wiring, told) for output in OUTPUTS}
    checked, said = correct_signs(table, fit_responses(measured, demands), moved)
    for line in said or ("every sign is right",):
        print(line)
    return checked


def _parse_directions(texts: Sequence[str]) -> dict[str, int]:
    """output → which way it went, of each OUTPUT=+ or OUTPUT=-. Raises RigtwinError."""
    told: dict[str, int] = {}
    for text in texts:
        name, _, sign = text.partition("=")
        if name not in OUTPUTS or sign not in ("+", "-"):
            raise RigtwinError(
                f"--moved {text}: expected one of {', '.join(OUTPUTS)} and + or -, such as ground=+"
            )
        told[name] = 1 if sign == "+" else -1
    return told


def _find_direction(
    output: str, table: ChannelTable, wiring: ChannelTable | None, told: Mapping[str, int]
) -> int:
    """Says whether an output went the way of its command: told, asked, or known."""
    if output in told:
        return told[output]
    place = OUTPUTS.index(output)
    if wiring is not None:
        return int(table.outputs[place].scaling.sign * wiring.outputs[place].scaling.sign)
    what = {
        "ground": "the ground plate go towards the wheel",
        "structure": "the structure plate go away from the wheel",
    }
    return (
        1
        if _ask(
            f"did {what.get(output, 'the motor push the plate away from the wheel')} first? y/n: ",
            ("y", "n"),
        )
        == "y"
        else -1
    )


def _ask(question: str, answers: tuple[str, ...]) -> str:
    if not sys.stdin.isatty():
        raise RigtwinError(
            f"no terminal to ask: {question.strip()} (--arm and --moved answer beforehand)"
        )
    try:
        while (said := input(question).strip().lower()) not in answers:
            pass
    except EOFError:
        raise RigtwinError(f"not answered: {question.strip()}") from None
    return said


DEEDS: dict[str, Callable[[Namespace], int]] = {"serve": serve, "check": check, "release": free}
