"""`rigtwin faults`: faults put into sessions on the virtual card."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import rigtwin
from rigtwin.cli.options import add_settings, counting_bar, settings_of
from rigtwin.console import table, writable, write_json
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
from rigtwin.hardware.daq import CARD

if TYPE_CHECKING:
    from rigtwin.hardware.faults.kinds import FaultKind
    from rigtwin.hardware.faults.outcome import FaultResult

SUMMARY = "put faults into sessions on the virtual card; see that each is stopped"
MORE = "docs/faults.md"


HEADER = (
    "fault",
    "where",
    "sessions",
    "stopped",
    "never seen",
    "ticks to safe",
    "from its start",
    "of a limit",
    "reason",
    "readable",
)
PAGE_HEADER = (
    "where",
    "what breaks",
    "stopped",
    "never seen",
    "ticks until safe, maximum",
    "share of a limit, maximum",
)
"""Columns of the table that `--out` writes: one row for each place."""
MARK = "<!-- made by rigtwin faults -->"
"""In a page that has this line, everything after it is replaced."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--each",
        type=int,
        default=11,
        metavar="N",
        help="sessions of each kind in one process (default 11)",
    )
    parser.add_argument(
        "--processes",
        type=int,
        default=4,
        metavar="N",
        help="sessions of each kind that kills a process (default 4)",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="seed of the faults' times, tests and places (default 0)",
    )
    parser.add_argument(
        "--card",
        type=Path,
        default=CARD,
        metavar="CARD.toml",
        help="channel table (default: the shipped one)",
    )
    add_settings(parser)
    parser.add_argument("--out", "-o", type=Path, metavar="F.md", help="write the table there")
    parser.add_argument("--json", type=Path, metavar="J.json", help="write every outcome there")


def execute(parsed: argparse.Namespace) -> int:
    """Runs the campaign and prints its table.

    Returns
    -------
    int
        130 if it was interrupted, which says nothing of the rig and writes no file; 4 unless every
        session was stopped as it must be; else 0.
    """
    from rigtwin.hardware.faults.kinds import KINDS

    for out in (parsed.out, parsed.json):
        if out is not None:
            writable(out)
    with counting_bar("fault", "faults") as show:
        campaign = rigtwin.faults(
            seed=parsed.seed,
            per_kind=parsed.each,
            per_process_kind=parsed.processes,
            card=parsed.card,
            settings=settings_of(parsed),
            progress=lambda _kind, done, total: show(done, total),
        )
    tried = {
        kind: [result for result in campaign.results if result.fault.kind == kind] for kind in KINDS
    }
    rows = [_row(kind, results) for kind, results in tried.items() if results]
    passed = len(campaign.results) - len(campaign.failed)
    said = (
        f"{len(campaign.results)} faults of {len(rows)} kinds, seed {parsed.seed}: "
        f"{passed} sessions ended as they must"
    )
    print(table([HEADER, *rows]))
    for result in campaign.failed:
        print(f"failed: {_describe(result)}")
    for reason in campaign.undone:
        print(f"not run: {reason}")
    print(said)
    if campaign.interrupted:
        return 130
    if parsed.out is not None:
        _write(parsed.out, said, _page_rows(tried), list(campaign.failed))
    if parsed.json is not None:
        write_json(parsed.json, [asdict(result) for result in campaign.results])
    # A session that was not run proves nothing, so it counts as one that failed.
    return 0 if not campaign.failed and not campaign.undone else 4


def _row(kind: FaultKind, results: list[FaultResult]) -> tuple[str, ...]:
    """One line of the table."""
    seen = [result for result in results if result.late is not None]
    late = [result.late for result in seen if result.late is not None]
    start = [result.from_start for result in seen]
    return (
        kind.name,
        kind.place,
        str(len(results)),
        str(len(seen)),
        str(len(results) - len(seen)),
        f"at most {max(max(late), 0)}" if late else "",
        f"{sorted(start)[len(start) // 2]}, at most {max(start)}" if start else "",
        f"{100 * max((result.exceeded for result in results), default=0.0):.0f} %",
        f"{sum(result.right for result in results)} right",
        str(sum(result.readable for result in results)),
    )


def _page_rows(tried: Mapping[FaultKind, list[FaultResult]]) -> list[tuple[str, ...]]:
    """Return a row for each place: its kinds of fault, and the worst of their sessions."""
    rows = []
    for place in dict.fromkeys(kind.place for kind in tried):
        kinds = [kind for kind, results in tried.items() if kind.place == place and results]
        results = [result for kind in kinds for result in tried[kind]]
        late = [result.late for result in results if result.late is not None]
        if results:
            rows.append(
                (
                    place,
                    "; ".join(f"{kind.name}: {kind.meaning}" for kind in kinds),
                    f"{len(late)} of {len(results)}",
                    str(len(results) - len(late)),
                    str(max(0, *late)) if late else "",
                    f"{100 * max(result.exceeded for result in results):.0f} %",
                )
            )
    return rows


def _describe(result: FaultResult) -> str:
    fault = result.fault
    return (
        f"{fault.kind.name} at tick {fault.at} of {fault.experiment}, place {fault.place}, seed "
        f"{fault.seed}: safe {result.late} ticks late, {100 * result.exceeded:.0f} % of a limit, "
        f"said {result.cause}: {result.reason}"
    )


def _table_line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"


def _write(
    path: Path, said: str, rows: Iterable[tuple[str, ...]], failed: list[FaultResult]
) -> None:
    lines = [said + ".", "", _table_line(PAGE_HEADER), "|" + "---|" * len(PAGE_HEADER)]
    lines += [_table_line(row) for row in rows]
    lines += ["", *(f"- failed: {_describe(result)}" for result in failed)]
    try:
        old = path.read_text(encoding="utf-8") if path.is_file() else ""
    except (OSError, UnicodeDecodeError):
        raise RigtwinError(f"cannot read {path}, whose table is to be replaced") from None
    # A page may hold text before the mark, which is kept; what follows is replaced.
    before, mark, _ = old.partition(MARK)
    table_only = "\n".join(lines) + "\n"
    atomic_write(path, f"{before}{MARK}\n\n{table_only.rstrip()}\n" if mark else table_only)
