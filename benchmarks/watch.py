"""False alarms of a watch on nominal tests, and its delay on tests with an effect.

python -m benchmarks.watch --hours 10            # nominal tests, one seed each
python -m benchmarks.watch --effects             # each effect from the middle of a test on
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

import rigtwin

TESTS = (
    "drop",
    "road1.6",
    "road10",
    "passive",
    "semi-active",
    "active",
    "single-mass",
    "single-mass-road",
    "friction-road",
    "imposed",
    "imposed-fast",
    "gas-spring",
)
STEP = 4.0
"""Length of a judged piece, s. It is eight times faster than real time, with the same blocks."""
JUDGED = 34.0
"""Mean judged length of `TESTS`, s."""
LATER = 10.0
"""Start of an effect within its test, s."""
MOVING = ("imposed", "road10")
EFFECTS = {
    "coulomb@rail": 60.0,
    "viscous@rail": 150.0,
    "coulomb@motor": 30.0,
    "gain@motor": 0.95,
    "cogging@motor": 15.0,
    "stiffness@tyre": 55000.0,
    "delay@structure_cylinder": 0.004,
    "backlash@structure_cylinder": 4e-4,
    "deadband@ground_cylinder": 4e-4,
    "gain@load_cell": 1.03,
    "offset@structure_lvdt": 5e-4,
    "gain@suspension_lvdt": 1.02,
}


def watch_nominal(case: tuple[str, int]) -> tuple[str, int, float, float, str]:
    """Watch a nominal test: return name, seed, judged time, s, highest level, and alarm."""
    name, seed = case
    with TemporaryDirectory() as folder:
        path = Path(folder) / "test.mcap"
        rigtwin.run("suspension-rig", name, seed=seed, path=path)
        watch = rigtwin.watch(path, suspects=False, step=STEP)
        return name, seed, watch.seconds, watch.highest, str(watch.alarm or "")


def watch_effect(case: tuple[str, float, str, int]) -> str:
    """Watch a test with an effect and return its row of the table."""
    name, value, test, seed = case
    with TemporaryDirectory() as folder:
        path = Path(folder) / "test.mcap"
        rigtwin.run(
            "suspension-rig",
            test,
            seed=seed,
            effects={name: value},
            effects_from=LATER,
            path=path,
        )
        first: list[str] = []

        def note_first_suspect(now: rigtwin.Watch) -> None:
            if now.alarm is not None and now.alarm.suspects and not first:
                first.append(_describe(now.alarm))

        alarm = rigtwin.watch(path, on_update=note_first_suspect).alarm
        if alarm is None:
            return f"| {name} = {value:g} | {test} | none | | |"
        after = f"{alarm.time - LATER:.2f} s"
        return f"| {name} = {value:g} | {test} | {after} | {''.join(first)} | {_describe(alarm)} |"


def _describe(alarm: rigtwin.Alarm) -> str:
    """Return the most probable suspect of an alarm, as text."""
    if not alarm.suspects:
        return "none"
    return f"{alarm.suspects[0].effect}, {100.0 * alarm.suspects[0].probability:.0f} %"


def _nominal_cases(hours: float, seed: int) -> Iterator[tuple[str, int]]:
    """Yield test and seed until the judged time reaches `hours`."""
    wanted = math.ceil(3600.0 * hours / JUDGED)
    return islice(((name, seed + n) for n in count() for name in TESTS), wanted)


def main() -> int:
    """Print the alarms of effects, and of nominal tests."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--effects", action="store_true")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parsed = parser.parse_args()
    with ProcessPoolExecutor(parsed.workers) as pool:
        if parsed.effects:
            print("| effect | test | alarm after | first suspect | at the end |")
            print("|---|---|---|---|---|")
            cases = [
                (name, value, test, parsed.seed)
                for test in MOVING
                for name, value in EFFECTS.items()
            ]
            for row in pool.map(watch_effect, cases):
                print(row, flush=True)
        total, alarms, highest = 0.0, 0, 0.0
        nominal = list(_nominal_cases(parsed.hours, parsed.seed))
        for name, seed, length, level, alarm in tqdm(
            pool.map(watch_nominal, nominal), total=len(nominal), disable=not nominal or None
        ):
            total, highest = total + length, max(highest, level)
            if alarm:
                alarms += 1
                print(f"{name} {seed}: {alarm}", flush=True)
        if nominal:
            print(
                f"{total / 3600.0:.2f} h of {len(nominal)} nominal tests: {alarms} false alarms; "
                f"the highest CUSUM was {highest:.2f} of its limit"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
