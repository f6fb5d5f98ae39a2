"""How long whole commands take, from the shell and back, beside those of another checkout.

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

HERE = Path(__file__).parents[1]
PROGRAM = "import sys; from rigtwin.cli import main; sys.exit(main(sys.argv[1:]))"
FIRST_LOOK = re.compile(r"first look, ([0-9.]+) s")


class Taken(NamedTuple):
    """s. look: until a diagnosis told its first look; none if it tells none."""

    whole: float
    look: float | None


def take(checkout: Path, arguments: Sequence[str], environment: Mapping[str, str]) -> Taken:
    """One command of a checkout, in a process of its own."""
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        cwd=checkout,
        env={**environment, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=False,
    )
    whole = time.perf_counter() - began
    if done.returncode not in (0, 3, 4):
        sys.exit(f"{' '.join(arguments)}: {done.stderr.strip() or done.returncode}")
    told = FIRST_LOOK.search(done.stderr)
    return Taken(whole, None if told is None else float(told[1]))


def commands(folder: Path, recordings: Sequence[Path]) -> dict[str, list[str]]:
    """What is measured: name → arguments. The run comes first, as others read its file."""
    own = folder / "road10.mcap"
    return {
        "run road10, 45 s": ["run", "road10", "--seed", "3", "--out", str(own)],
        "--help": ["--help"],
        "info": ["info", str(own)],
        "plot": ["plot", str(own), "-o", str(folder / "plot.png")],
        **{f"diagnose {each.name}": ["diagnose", str(each.resolve())] for each in recordings},
    }


def main() -> None:
    """Prints a table: each round, and the median."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recordings", nargs="*", type=Path, help="to diagnose too")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="another checkout")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument("--cold", action="store_true", help="with nothing compiled before")
    parsed = parser.parse_args()
    checkouts = {"here": HERE}
    if parsed.against is not None:
        checkouts["there"] = parsed.against.resolve()
    print(f"{'command':34} {'of':6} {'median':>7}   s in each round")
    with TemporaryDirectory() as work:
        for name, arguments in commands(Path(work), parsed.recordings).items():
            found: dict[str, list[Taken]] = {each: [] for each in checkouts}
            for turn in range(parsed.rounds + 1):
                # In turns, so that a slow minute slows both.
                for each, checkout in checkouts.items():
                    with TemporaryDirectory() as empty:
                        environment = dict(os.environ)
                        if parsed.cold:
                            environment["XDG_CACHE_HOME"] = empty
                        taken = take(checkout, arguments, environment)
                    # Before the first round both compile what they need.
                    if turn or parsed.cold:
                        found[each].append(taken)
            for each, several in found.items():
                _tell(name, each, [one.whole for one in several])
                looks = [one.look for one in several if one.look is not None]
                if looks:
                    _tell("    its first look", each, looks)


def _tell(name: str, of: str, seconds: Sequence[float]) -> None:
    told = "  ".join(f"{each:.2f}" for each in seconds)
    print(f"{name:34.34} {of:6} {statistics.median(seconds):7.2f}   {told}", flush=True)


if __name__ == "__main__":
    main()
