"""`rigtwin info`: what is in a recording."""

from __future__ import annotations

import argparse
import contextlib
import textwrap
from pathlib import Path

from rigtwin.cli.options import add_machine
from rigtwin.console import late, table

SUMMARY = "say what is in a recording"
MORE = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    add_machine(parser)


def execute(parsed: argparse.Namespace) -> int:
    import numpy as np

    import rigtwin
    from rigtwin.recording.channels import channels_of

    recording = rigtwin.load(parsed.recording, parsed.machine)
    units: dict[str, str] = {}
    if parsed.machine is not None:
        machine = rigtwin.machine(parsed.machine)
        if machine.name != recording.machine:
            raise rigtwin.RigtwinError(
                f"{recording.path}: it is of machine {recording.machine!r}; "
                f"--machine is {machine.name!r}"
            )
        units = machine.units
    elif recording.machine in rigtwin.machines():
        units = rigtwin.machine(recording.machine).units
    print(f"{recording.path}: {recording.experiment} on {recording.machine}")
    print(
        f"{recording.ticks} ticks of {recording.period:g} s, "
        f"{recording.time[0]:g} to {recording.time[-1]:.3f} s"
    )
    print(f"ended: {recording.end or 'not said'}")
    if recording.twin:
        print(
            f"made by a twin: seed {recording.twin.get('seed')}, "
            f"rigtwin {recording.twin.get('version')}"
        )
    for note in recording.notes:
        print(f"note: {note}")
    for step in recording.transitions:
        print(
            f"{step.get('time', '?'):>12s} s  {step.get('from')} "
            f"→ {step.get('to')}: {step.get('reason')}"
        )
    if recording.lateness:
        print(late(recording.lateness))
    if recording.machine in rigtwin.machines():
        # The energy error is an addition, whose absence must not hide the rest.
        with contextlib.suppress(rigtwin.RigtwinError):
            if (energy := rigtwin.energy_error(recording)) is not None:
                print(f"energy error: {energy}")
    rows: list[tuple[str, ...]] = [("channel", "unit", "lowest", "mean", "highest", "meaning")]
    for channel in channels_of(recording.columns, recording.machine, units):
        values = recording.column(channel.topic, channel.name)
        # Huge values of foreign recordings overflow in the mean, which then shows as inf.
        with np.errstate(over="ignore", invalid="ignore"):
            figures = (f"{values.min():.5g}", f"{values.mean():.5g}", f"{values.max():.5g}")
        rows.append((f"{channel.topic}.{channel.name}", channel.unit, *figures, channel.meaning))
    print(table(rows))
    if recording.controller:
        settings = ", ".join(f"{key} {value}" for key, value in recording.controller.items())
        print(textwrap.fill(f"controller: {settings}", 120, subsequent_indent="  "))
    return 0
