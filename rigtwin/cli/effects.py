"""`rigtwin effects`: what a machine can have."""

from __future__ import annotations

import argparse

from machines import DEFAULT_MACHINE
from rigtwin.cli.options import add_machine
from rigtwin.console import table
from rigtwin.errors import RigtwinError

SUMMARY = "list the effects that a machine can have"
MORE = """\
Give one to a test with rigtwin run NAME --effect KIND@COMPONENT=VALUE."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("component", nargs="?", help="list only the effects of this component")
    add_machine(parser, "machine", DEFAULT_MACHINE)


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    machine = rigtwin.machine(parsed.machine)
    effects = rigtwin.effects(machine)
    head = ("effect", "parameter", "nominal", "unit", "allowed", "what it does")
    rows: list[tuple[str, ...]] = [head]
    for effect in effects:
        if parsed.component not in (None, effect.component):
            continue
        name, meaning = effect.name, effect.kind.meaning
        for parameter, quantity in effect.quantities().items():
            value = f"{effect.nominal(machine.plant)[parameter]:g}"
            unit = machine.unit(effect.group, quantity)
            allowed = f"{quantity.low:g} to {quantity.high:g}"
            rows.append((name, parameter, value, unit, allowed, meaning))
            # Further parameters of one effect repeat neither its name nor its meaning.
            name = meaning = ""
    if len(rows) == 1:
        known = ", ".join(dict.fromkeys(effect.component for effect in effects))
        raise RigtwinError(f"unknown component {parsed.component!r}; there are {known}")
    print(table(rows))
    print(
        "setting@controller=NAME:VALUE  a setting that is not what the recording says; "
        "rigtwin list --settings has them"
    )
    return 0
