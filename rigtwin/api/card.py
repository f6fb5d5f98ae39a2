"""Data acquisition card: virtual card, and release of held lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import resolve_machine
from rigtwin.api.twin import Effects, Settings, effect_texts
from rigtwin.description.changes import with_changes
from rigtwin.description.effects import apply_effects
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.driver import require_client
from rigtwin.hardware.daq.failsafe import release
from rigtwin.hardware.daq.table_file import load_table
from rigtwin.hardware.daq.virtual import RealTime, VirtualCard

PORTS = 65535


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
