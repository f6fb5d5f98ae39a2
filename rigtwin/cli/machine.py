"""`rigtwin machine check`: every mistake of a description."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.console import table

if TYPE_CHECKING:
    from rigtwin.description.machine import Machine

SUMMARY = "check a machine's description"
MORE = """\
rigtwin machine check F.toml explains every mistake in one line each; without
any, what will be looked for, and what its sensors can never show whatever the
machine does: worked out by made-up motions within the range of its joints, as
far as that takes less than 20 s; --identifiability works all of it out."""
ALLOWED = 20.0
"""s for what can never be identified, unless all of it is asked for."""
REPORTED = 2.0
"""s between lines of progress off a terminal."""
WIDTH = 78
"""Signs of a line of progress."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=["check"])
    parser.add_argument("description", type=Path, metavar="F.toml")
    parser.add_argument(
        "--identifiability",
        action="store_true",
        help="work out all that can never be identified, however long it takes",
    )


def execute(parsed: argparse.Namespace) -> int:
    from rigtwin.components.plant import parameter_of
    from rigtwin.description.catalogue import shipped
    from rigtwin.description.document import examine

    path: Path = shipped().get(str(parsed.description)) or parsed.description
    machine, mistakes = examine(path)
    for mistake in mistakes:
        print(f"{path}: {mistake}")
    if machine is None:
        print(f"{len(mistakes)} mistake{'s' if len(mistakes) > 1 else ''}")
        return 1
    print(f"{machine.name}: {machine.title}")
    for replay in machine.replays:
        closed = ", commanded by the controller" if replay.closed else ""
        print(
            f"  {replay.name}: moved by {', '.join(replay.moved_by)}{closed}; "
            f"observed {', '.join(r.name for r in replay.rows)}"
        )
    rows = [
        ("component", "is", "recorded as", "nominal values with a tolerance", "effects looked for")
    ]
    effects = [effect for effect in machine.effects() if effect.searched]
    for name, component in machine.components.items():
        held = [t for t in machine.tolerances if t.group == name and t.is_declared]
        values = ", ".join(
            f"{t.parameter} {parameter_of(machine.plant, name, t.parameter):g} ± "
            + (f"{100 * t.half_width:g} %" if t.relative else f"{t.half_width:g}")
            for t in held
        )
        kinds = ", ".join(effect.kind.name for effect in effects if effect.group == name)
        channel = ".".join(component.channel) if component.channel else ""
        rows.append((name, f"{component.element} {component.mjcf}", channel, values, kinds))
    print(table(rows))
    for name, source in machine.sources.items():
        print(f"{name}: {source}")
    if machine.control is not None:
        print(f"controller: {machine.control.text}")
    for line in machine.overlooked:
        print(f"not taken into account: {line}")
    # Flushed: what follows takes up to 20 s.
    print("no mistakes", flush=True)
    # Last, because it takes longest and everything else is known without it.
    _print_never(machine, math.inf if parsed.identifiability else ALLOWED)
    return 0


def _print_never(machine: Machine, seconds: float) -> None:
    """Print which effects the sensors can never identify."""
    with _telling() as progress:
        progress("packages")
        import rigtwin

        can = rigtwin.identifiability(machine, seconds=seconds, progress=progress)
    if not can.motions:
        print("never identifiable: not worked out; give its joints a range")
    for name in can.unseen:
        print(f"never identifiable: {name}; nothing that is recorded changes with it")
    for name, rivals in can.confounded.items():
        print(f"never identifiable alone: {name}; {' + '.join(rivals)} would do the same")
    if can.untried:
        print(
            f"not worked out within {seconds:g} s, --identifiability goes on: "
            f"{', '.join(can.untried)}"
        )
    if can.motions and not can.unseen and not can.confounded and not can.untried:
        print("never identifiable: none; what a recording does not excite, its diagnosis says")
    for base_parameter in can.sums:
        print(f"seen of bodies and rotors: {_write_sum(base_parameter)}")


@contextmanager
def _telling() -> Iterator[Callable[[str], None]]:
    """What is worked out at present, on standard error: in one line of a terminal, else a line now
    and then."""
    terminal, begun, last = sys.stderr.isatty(), time.monotonic(), -math.inf

    def tell(stage: str) -> None:
        nonlocal last
        now = time.monotonic()
        said = f"working out what its sensors can show, {now - begun:.0f} s: {stage}"
        if terminal:
            # Padded to a fixed width, so that a shorter line leaves nothing of a longer one.
            print(f"\r{said[:WIDTH].ljust(WIDTH)}", end="", file=sys.stderr, flush=True)
        elif now - last >= REPORTED:
            print(said, file=sys.stderr, flush=True)
            last = now

    yield tell
    if terminal:
        print("\r" + " " * WIDTH + "\r", end="", file=sys.stderr, flush=True)


def _write_sum(terms: Mapping[str, float]) -> str:
    """A sum as it is written by hand."""
    first, *remaining = terms
    return first + "".join(
        f" {'-' if terms[name] < 0.0 else '+'} {abs(terms[name]):.4g} {name}" for name in remaining
    )
