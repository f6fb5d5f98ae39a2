"""A test under supervision, taken from the command line of `rigtwin run` or `rigtwin session`, and
how it went."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rigtwin
from rigtwin.cli.options import settings_of
from rigtwin.console import late, table
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from tqdm import tqdm

    from rigtwin import DryRun, Machine
    from rigtwin.hardware.session.test import AnyTest


def add_supervised(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("on the rig (docs/rig.md)")
    group.add_argument(
        "--target",
        choices=("twin", "daq"),
        default="twin",
        help="run on the twin or on the card (default twin)",
    )
    group.add_argument(
        "--card",
        type=Path,
        metavar="CARD.toml",
        help="channel table; with the twin: its converters, ramps, limits",
    )
    group.add_argument(
        "--dry-run",
        action="store_true",
        help="with --target daq: run the exact session on the virtual card instead",
    )
    group.add_argument(
        "--real-time", action="store_true", help="run the twin at the pace of the clock"
    )
    group.add_argument(
        "--arm",
        action="store_true",
        help="arm without asking; make sure that everybody is clear of the rig",
    )
    group.add_argument(
        "--without-dry-run",
        metavar="NAME",
        help="arm without a dry run; NAME, who takes responsibility, is recorded",
    )
    group.add_argument(
        "--stop-file",
        type=Path,
        metavar="F",
        help="stop when this file appears; signals and keys stop anyway",
    )
    group.add_argument(
        "--live",
        type=int,
        nargs="?",
        const=8765,
        default=0,
        metavar="PORT",
        help="live view for Foxglove (default port 8765)",
    )


def require_card(parsed: argparse.Namespace, machine: Machine) -> None:
    """Raises RigtwinError for a session that needs a channel table and has none, or for options
    that only a session on the card has."""
    if parsed.target == "twin" and (parsed.dry_run or parsed.without_dry_run or parsed.arm):
        raise RigtwinError("--dry-run, --without-dry-run and --arm require --target daq")
    if parsed.card is None and parsed.target == "daq":
        raise RigtwinError("--target daq needs the card's channel table: --card CARD.toml")
    if parsed.card is None and parsed.real_time and machine.physics.card is None:
        raise RigtwinError(
            f"--real-time of {machine.name} needs a channel table of it: --card CARD.toml"
        )


def plan(parsed: argparse.Namespace, name: str) -> AnyTest:
    """The test of a command line. Raises RigtwinError."""
    return rigtwin.plan_test(
        name,
        machine=parsed.machine,
        card=parsed.card,
        settings=settings_of(parsed),
        seed=parsed.seed,
        effects=parsed.effect,
    )


def run(parsed: argparse.Namespace, name: str, path: Path) -> int:
    """Runs a test under supervision and tells how it ended. Returns the exit code."""
    test = plan(parsed, name)
    with _bar(test) as bar:
        options: dict[str, Any] = {
            "path": path,
            "machine": parsed.machine,
            "seed": parsed.seed,
            "settings": settings_of(parsed),
            "stop_file": parsed.stop_file,
            "progress": bar.update,
        }
        if parsed.target == "daq" and parsed.dry_run:
            rehearsed = rigtwin.dry_run(name, parsed.card, effects=parsed.effect, **options)
            bar.close()
            return _tell_dry_run(parsed, test, path, rehearsed)
        # A dry run is over in seconds and has no live view.
        options["live"] = parsed.live
        if parsed.target == "daq":
            if parsed.effect:
                raise RigtwinError("--effect is the twin's; the rig has its own")
            ended = rigtwin.run_on_card(
                name,
                parsed.card,
                arm=lambda ready: parsed.arm or _ask_to_arm(ready),
                without_dry_run=parsed.without_dry_run,
                **options,
            )
        else:
            ended = rigtwin.run_on_twin(
                name, card=parsed.card, real_time=parsed.real_time, effects=parsed.effect, **options
            )
    if ended is None:
        print("not armed; nothing moved")
        return 1
    return _tell(test, path, ended.ticks, ended.cause, ended.completed)


def _tell_dry_run(parsed: argparse.Namespace, test: AnyTest, path: Path, rehearsal: DryRun) -> int:
    from rigtwin.hardware.session.dry_run import ledger

    ticks = rehearsal.recording.ticks if rehearsal.recording is not None else 0
    code = _tell(test, path, ticks, rehearsal.cause, rehearsal.passed)
    if rehearsal.peaks:
        rows: list[tuple[str, ...]] = [("predicted", "peak", "limit", "margin")]
        for peak in rehearsal.peaks:
            values = (f"{peak.peak:.4g} {peak.unit}", f"{peak.limit:g} {peak.unit}")
            rows.append((peak.name, *values, f"{100 * peak.margin:.0f} %"))
        print(table(rows))
    for lacking in rehearsal.obstacles:
        print(f"before it may be armed: {lacking}")
    if rehearsal.passed and not test.effects and ledger(parsed.card).exists():
        print(f"dry run passed, noted in {ledger(parsed.card)}")
    return code


def _tell(test: AnyTest, path: Path, ticks: int, cause: str, completed: bool) -> int:
    seconds = ticks * test.period
    print(f"{test.experiment}: {seconds:.3f} s recorded in {path}; {cause}")
    lateness = rigtwin.load(path).lateness if ticks else {}
    if lateness:
        print(late(lateness))
    return 0 if completed else 3


def _ask_to_arm(test: AnyTest) -> bool:
    from rigtwin.hardware.realtime import list_shortcomings

    for lacking in list_shortcomings():
        print(f"this computer lacks {lacking}")
    if not sys.stdin.isatty():
        raise RigtwinError(
            "no terminal to ask for arming; say --arm if everybody is clear of the rig"
        )
    print(
        f"{test.experiment} on card {test.table.device}. Any key stops it. Everybody clear of the "
        "rig?"
    )
    try:
        return input("type arm to go: ").strip() == "arm"
    except EOFError:
        # The end of the input is no consent.
        return False


def _bar(test: AnyTest) -> tqdm:
    from tqdm import tqdm

    return tqdm(
        total=test.ticks,
        unit="tick",
        unit_scale=True,
        disable=None,
        desc=test.experiment,
        leave=False,
    )
