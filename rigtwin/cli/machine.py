"""`rigtwin machine check`: every mistake of a description."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.console import table

if TYPE_CHECKING:
    from rigtwin.description.machine import Machine

SUMMARY = "check a machine's description"
MORE = """\
rigtwin machine check F.toml explains every mistake in one line each; without
any, what will be looked for, and what its sensors can never show whatever the
machine does: worked out by made-up motions within the range of its joints."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=["check"])
    parser.add_argument("description", type=Path, metavar="F.toml")


def execute(parsed: argparse.Namespace) -> int:
    from rigtwin.description.catalogue import shipped
    from rigtwin.description.document import examine

    path: Path = shipped().get(str(parsed.description)) or parsed.description
    found, mistakes = examine(path)
    for mistake in mistakes:
        print(f"{path}: {mistake}")
    if found is None:
        print(f"{len(mistakes)} mistake{'s' if len(mistakes) > 1 else ''}")
        return 1
    print(f"{found.name}: {found.title}")
    for replay in found.replays:
        closed = ", commanded by the controller" if replay.closed else ""
        print(
            f"  {replay.name}: moved by {', '.join(replay.moved_by)}{closed}; "
            f"observed {', '.join(r.name for r in replay.rows)}"
        )
    rows = [
        ("component", "is", "recorded as", "nominal values with a tolerance", "effects looked for")
    ]
    effects = [effect for effect in found.effects() if effect.searched]
    for name, component in found.components.items():
        held = [t for t in found.tolerances if t.group == name and not t.ticks]
        part = getattr(found.plant, name)
        values = ", ".join(
            f"{t.parameter} {getattr(part, t.parameter):g} ± "
            + (f"{100 * t.half_width:g} %" if t.relative else f"{t.half_width:g}")
            for t in held
        )
        own = ", ".join(effect.kind.name for effect in effects if effect.group == name)
        channel = ".".join(component.channel) if component.channel else ""
        rows.append((name, f"{component.element} {component.mjcf}", channel, values, own))
    print(table(rows))
    for name, source in found.sources.items():
        print(f"{name}: {source}")
    if found.control is not None:
        print(f"controller: {found.control.text}")
    for line in found.overlooked:
        print(f"not taken into account: {line}")
    _print_never(found)
    print("no mistakes")
    return 0


def _print_never(machine: Machine) -> None:
    """What can never be identified, before there are any data."""
    import rigtwin

    told = "working out what its sensors can show ..."
    if sys.stderr.isatty():
        print(told, end="\r", file=sys.stderr, flush=True)
    can = rigtwin.identifiability(machine)
    if sys.stderr.isatty():
        print(" " * len(told), end="\r", file=sys.stderr, flush=True)
    if not can.motions:
        print("never identifiable: not worked out; give its joints a range")
    for name in can.unseen:
        print(f"never identifiable: {name}; nothing that is recorded changes with it")
    for name, others in can.confounded.items():
        print(f"never identifiable alone: {name}; {' + '.join(others)} would do the same")
    if can.motions and not can.unseen and not can.confounded:
        print("never identifiable: none; what a recording does not excite, its diagnosis says")
    for each in can.sums:
        print(f"seen of bodies and rotors: {_write_sum(each)}")


def _write_sum(terms: Mapping[str, float]) -> str:
    """A sum as it is written by hand."""
    first, *others = terms
    return first + "".join(
        f" {'-' if terms[name] < 0.0 else '+'} {abs(terms[name]):.4g} {name}" for name in others
    )
