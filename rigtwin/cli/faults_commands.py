"""`rigtwin faults`: the campaign, and its table."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

from rigtwin.console import table, writable, write_json
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import load_table
from rigtwin.hardware.faults.campaign import Fault, FaultResult, draw_faults, try_fault
from rigtwin.hardware.faults.kinds import KINDS, FaultKind
from rigtwin.hardware.faults.processes import try_process_fault

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


def faults(parsed: Namespace) -> int:
    """Runs the campaign.

    Parameters
    ----------
    parsed : Namespace
        The command line of `rigtwin faults`.

    Returns
    -------
    int
        The exit code: 0 if every session was stopped as it must be, else 4.

    Raises
    ------
    RigtwinError
        For a mistake in the command line.
    """
    from experiments import find

    if parsed.seed < 0 or not 0 <= parsed.each <= 1000 or not 0 <= parsed.processes <= 1000:
        raise RigtwinError("--seed: expected 0 or more; --each and --processes: 0 to 1000")
    for out in (parsed.out, parsed.json):
        if out is not None:
            writable(out)
    channels = load_table(parsed.card)
    todo = _draw(parsed)
    results, undone = list[FaultResult](), list[str]()
    with (
        TemporaryDirectory(prefix="rigtwin-faults-") as folder,
        tqdm(todo, unit="fault", disable=None, leave=False) as bar,
    ):
        try:
            for fault in bar:
                bar.set_description(fault.kind.name)
                run = try_process_fault if fault.kind.place == "process" else try_fault
                try:
                    experiment = find(fault.experiment)
                    results.append(run(fault, experiment, channels, Path(folder)))
                except RigtwinError as error:
                    undone.append(f"{fault.kind.name}, seed {fault.seed}: {error}")
        except KeyboardInterrupt:
            print(f"interrupted after {len(results)} of {len(todo)}")
    rows = [
        _row(kind, [result for result in results if result.fault.kind == kind]) for kind in KINDS
    ]
    rows = [row for row in rows if row[2] != "0"]
    failed = [result for result in results if not result.ok]
    passed = len(results) - len(failed)
    kinds = f"{len(results)} faults of {len(rows)} kinds, seed {parsed.seed}"
    said = f"{kinds}: {passed} sessions ended as they must"
    print(table([HEADER, *rows]))
    for result in failed:
        print(f"failed: {_describe(result)}")
    for one in undone:
        print(f"not run: {one}")
    print(said)
    if parsed.out is not None:
        _write(parsed.out, said, rows, failed)
    if parsed.json is not None:
        write_json(parsed.json, [asdict(result) for result in results])
    return 0 if not failed and not undone else 4


def _draw(parsed: Namespace) -> list[Fault]:
    here = [kind for kind in KINDS if kind.place != "process"]
    apart = [kind for kind in KINDS if kind.place == "process"]
    todo = draw_faults(parsed.each * len(here), parsed.seed, here)
    return todo + draw_faults(parsed.processes * len(apart), parsed.seed + 1, apart)


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


def _describe(result: FaultResult) -> str:
    fault = result.fault
    return (
        f"{fault.kind.name} at tick {fault.at} of {fault.experiment}, place {fault.place}, "
        f"seed {fault.seed}: safe "
        f"{result.late} ticks late, {100 * result.exceeded:.0f} % of a limit, said {result.cause}: "
        f"{result.reason}"
    )


def _write(
    path: Path, said: str, rows: Iterable[tuple[str, ...]], failed: list[FaultResult]
) -> None:
    lines = [said + ".", "", "| " + " | ".join(HEADER) + " |", "|" + "---|" * len(HEADER)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines += ["", *(f"- failed: {_describe(result)}" for result in failed)]
    try:
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        before, mark, _ = old.partition(MARK)
        path.write_text(
            f"{before}{MARK}\n\n" + "\n".join(lines).rstrip() + "\n"
            if mark
            else "\n".join(lines) + "\n",
            "utf-8",
        )
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


MARK = "<!-- made by rigtwin faults -->"
"""In a page that has this line, everything after it is replaced."""
