"""`rigtwin card`: a virtual card on a port, and the check that a channel table is true."""

from __future__ import annotations

import time
from argparse import Namespace

from rigtwin.configuration import Configuration
from rigtwin.console import configured
from rigtwin.daq.table import load_table
from rigtwin.daq.terminals import Terminals
from rigtwin.daq.virtual import RealTime, VirtualCard
from rigtwin.effects import applied
from rigtwin.session.stops import stop_requests


def serve(parsed: Namespace) -> int:
    """A virtual card with the twin at its terminals, in real time, for any NI-DAQmx gRPC client on this computer."""
    from rigtwin.daq.transport import LOCAL
    from rigtwin.daq.transport import serve as listen

    table = load_table(parsed.card)
    configuration = configured(Configuration(), parsed)
    terminals = Terminals(applied(configuration, parsed.effect), table, parsed.seed)
    card = VirtualCard(
        terminals,
        [line.line for line in table.inputs],
        [line.line for line in table.outputs],
        table.pressure,
        RealTime(configuration.timing.period),
        table.device,
    )
    server, port = listen(card, parsed.port)
    print(f'virtual card {table.device}: set address = "{LOCAL}:{port}" in the channel table. Ctrl-C ends it.', flush=True)
    with stop_requests() as stop:
        while stop() is None:
            time.sleep(0.1)
    server.stop(0.5).wait()
    print(f"{card.tick} ticks")
    return 0
