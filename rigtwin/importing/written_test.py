"""Writing of an imported test to a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigtwin.description import catalogue
from rigtwin.description.machine import Machine
from rigtwin.files import atomic_path
from rigtwin.importing.channels import Imported
from rigtwin.importing.mapping import Map
from rigtwin.recording import Writer

BLOCK = 10_000
"""Ticks written at a time."""


def write_test(out: Path, wanted: Map, machine: Machine | None, imported: Imported) -> str:
    """Write a recording; return the last line of the report."""
    channels, period, ticks = imported.channels, imported.period, len(imported.time)
    fields: dict[str, list[str]] = {}
    for topic, field in channels:
        fields.setdefault(topic, []).append(field)
    name = wanted.machine if machine is None else machine.name
    with (
        # The recording appears under its name only when it is complete.
        atomic_path(out) as beside,
        Writer(
            beside,
            wanted.experiment,
            period,
            wanted.controller,
            name,
            {topic: tuple(each) for topic, each in fields.items()},
            None if machine is None else catalogue.own_description(machine),
        ) as writer,
    ):
        # Written in blocks: otherwise all messages of a long recording would be in memory at once.
        for start in range(0, ticks, BLOCK):
            part = slice(start, min(start + BLOCK, ticks))
            blocks = {
                topic.strip("/"): np.column_stack([channels[topic, each][part] for each in names])
                for topic, names in fields.items()
            }
            writer.append(**blocks)
    return f"{ticks} ticks of {period:g} s for machine {name} in {out}"
