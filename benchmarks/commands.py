"""Run time of whole commands from the shell, compared with another checkout.

python -m benchmarks.commands                                # --help, info, plot, run
python -m benchmarks.commands rig.mcap --against ../older    # and diagnose, with its first look
python -m benchmarks.commands --cold                         # with nothing compiled before
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

CHECKOUT = Path(__file__).parents[1]
PROGRAM = "import sys; from rigtwin.cli import main; sys.exit(main(sys.argv[1:]))"
FIRST_LOOK = re.compile(r"first look, ([0-9.]+) s")


class RunTime(NamedTuple):
    """Run time of one command.

    Attributes
    ----------
    whole : float
        Run time, s.
    look : float or None
        Time until a diagnosis printed its first look, s. None if it printed none.
    """

    whole: float
    look: float | None


def run_command(
    checkout: Path, arguments: Sequence[str], environment: Mapping[str, str]
) -> RunTime:
    """Run a command of a checkout in a new process and return its run time."""
    start = time.perf_counter()
    finished = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        cwd=checkout,
        env={**environment, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=False,
    )
    whole = time.perf_counter() - start
    # Codes 3 and 4 report a trip and an alarm: results, not failures.
    if finished.returncode not in (0, 3, 4):
        sys.exit(f"{' '.join(arguments)}: {finished.stderr.strip() or finished.returncode}")
    first_look = FIRST_LOOK.search(finished.stderr)
    return RunTime(whole, None if first_look is None else float(first_look[1]))


def commands(folder: Path, recordings: Sequence[Path]) -> dict[str, list[str]]:
    """Return the arguments of the measured commands by name; later ones read the run's file."""
    recording = folder / "road10.mcap"
    return {
        "run road10, 45 s": ["run", "road10", "--seed", "3", "--out", str(recording)],
        "--help": ["--help"],
        "info": ["info", str(recording)],
        "plot": ["plot", str(recording), "-o", str(folder / "plot.png")],
        **{f"diagnose {path.name}": ["diagnose", str(path.resolve())] for path in recordings},
    }


def main() -> None:
    """Print a table of all rounds and their median."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recordings", nargs="*", type=Path, help="to diagnose too")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="another checkout")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument("--cold", action="store_true", help="with nothing compiled before")
    parsed = parser.parse_args()
    checkouts = {"here": CHECKOUT}
    if parsed.against is not None:
        checkouts["there"] = parsed.against.resolve()
    print(f"{'command':34} {'of':6} {'median':>7}   s in each round")
    with TemporaryDirectory() as work:
        for name, arguments in commands(Path(work), parsed.recordings).items():
            times: dict[str, list[RunTime]] = {label: [] for label in checkouts}
            for round_number in range(parsed.rounds + 1):
                # Alternating: a slow minute slows both checkouts.
                for label, checkout in checkouts.items():
                    with TemporaryDirectory() as empty:
                        environment = dict(os.environ)
                        if parsed.cold:
                            environment["XDG_CACHE_HOME"] = empty
                        run_time = run_command(checkout, arguments, environment)
                    # Round 0 compiles and is not counted.
                    if round_number or parsed.cold:
                        times[label].append(run_time)
            for label, runs in times.items():
                _print_row(name, label, [run.whole for run in runs])
                looks = [run.look for run in runs if run.look is not None]
                if looks:
                    _print_row("    its first look", label, looks)


def _print_row(name: str, label: str, seconds: Sequence[float]) -> None:
    """Print one row of the table."""
    rounds = "  ".join(f"{value:.2f}" for value in seconds)
    print(f"{name:34.34} {label:6} {statistics.median(seconds):7.2f}   {rounds}", flush=True)


if __name__ == "__main__":
    main()
