"""Options and output that several commands share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigtwin.console import assigned_settings
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    import rigtwin


def add_settings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override one setting, e.g. rail.coulomb=60",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="F.toml",
        help="override settings from a TOML file, before --set",
    )


def settings_of(parsed: argparse.Namespace) -> list[Path | Mapping[str, Any]]:
    """Return the changes of --config and --set, in that order."""
    return [*([parsed.config] if parsed.config else []), *assigned_settings(parsed.set)]


def add_effect(parser: argparse.ArgumentParser, summary: str) -> None:
    parser.add_argument(
        "--effect", action="append", default=[], metavar="KIND@COMPONENT=VALUE", help=summary
    )


def add_machine(
    parser: argparse.ArgumentParser, what: str = "the machine", default: str | None = None
) -> None:
    parser.add_argument(
        "--machine",
        default=default,
        metavar="F.toml",
        help=f"{what}, by name or description "
        f"(default: {default or 'the one that the recording names'})",
    )


def add_without(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="EFFECT",
        help="effect to remove from the twin first, e.g. coulomb@rail",
    )


def add_held_out(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--held-out",
        action="extend",
        nargs="+",
        type=Path,
        default=[],
        metavar="recording",
        help="recordings of the same machine to judge on",
    )


def add_columns(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="KEY=SOURCE",
        help="statement about a column of a log, e.g. elbow.position=q2, 'elbow.force=-tau2 [Nm]', "
        "'*.position=[deg]', 'time=t [ms]', time=0.002",
    )
    parser.add_argument(
        "--test",
        default="",
        metavar="KIND",
        help="kind of the test: 'inverse dynamics', 'position commands', servos or "
        "'force commands' (default: concluded from the log)",
    )


def columns_of(parsed: argparse.Namespace) -> dict[str, str]:
    """Return the statements of --column. Raise RigtwinError for a text without a source."""
    stated: dict[str, str] = {}
    for text in parsed.column:
        key, equals, source = text.partition("=")
        if not equals or not key.strip():
            raise RigtwinError(f"--column {text}: expected KEY=SOURCE, such as elbow.position=q2")
        if key.strip() in stated:
            raise RigtwinError(f"--column {text}: {key.strip()} is stated twice")
        stated[key.strip()] = source.strip()
    return stated


def read_recordings(
    parsed: argparse.Namespace,
) -> tuple[list[rigtwin.Recording], list[rigtwin.Recording]]:
    """Return the recordings to explain and those held out; logs of a model are described first."""
    import rigtwin
    from rigtwin.api.describing import needs_description, record_logs

    stated = columns_of(parsed)
    paths, held_out = parsed.recordings, parsed.held_out
    if not needs_description(parsed.machine, paths):
        if stated or parsed.test:
            raise RigtwinError("--column and --test require a log and a model, --machine arm.xml")
        load = rigtwin.load
        return [load(p, parsed.machine) for p in paths], [load(p, parsed.machine) for p in held_out]
    described = rigtwin.describe(parsed.machine, paths[0], columns=stated, test=parsed.test)
    print(described, file=sys.stderr)
    return record_logs(described, paths), record_logs(described, held_out)


def add_workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="number of parallel processes (default: one per core)",
    )
    parser.add_argument(
        "--cluster", metavar="ADDRESS", help="work on a dask cluster instead, e.g. tcp://host:8786"
    )


def add_stretch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--from",
        dest="start",
        type=float,
        default=0.0,
        metavar="S",
        help="start at this time (default 0)",
    )
    parser.add_argument(
        "--until", type=float, metavar="S", help="stop at this time (default: the end)"
    )


def add_json(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--json", type=Path, metavar="F.json", help=f"also write {what}")


@contextmanager
def counting_bar(unit: str, title: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that updates a progress bar with the jobs done and the total."""
    from tqdm import tqdm

    with tqdm(disable=None, desc=title, unit=unit, leave=False, file=sys.stderr) as bar:

        def show(done: int, total: int) -> None:
            # The total is known only once jobs are counted.
            bar.total = total
            bar.update(done - bar.n)

        yield show
