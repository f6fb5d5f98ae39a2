"""How often a watch raises an alarm where nothing is wrong, and how soon where something is.

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
"""s that are judged at a time: eight times as fast as at the pace of a test, by the same blocks."""
JUDGED = 34.0
"""s of a test that are judged, in the mean of `TESTS`."""
LATER = 10.0
"""s, from when on an effect is there."""
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
    """One nominal test: name, seed, the s that were judged, the highest level, the alarm if any."""
    name, seed = case
    with TemporaryDirectory() as folder:
        path = Path(folder) / "test.mcap"
        rigtwin.run("suspension-rig", name, seed=seed, path=path)
        watch = rigtwin.watch(path, suspects=False, step=STEP)
        return name, seed, watch.seconds, watch.highest, str(watch.alarm or "")


def watch_effect(case: tuple[str, float, str, int]) -> str:
    """One effect in a test: a row of the table."""
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

        def told(now: rigtwin.Watch) -> None:
            if now.alarm is not None and now.alarm.suspects and not first:
                first.append(_describe(now.alarm))

        alarm = rigtwin.watch(path, told=told).alarm
        if alarm is None:
            return f"| {name} = {value:g} | {test} | none | | |"
        after = f"{alarm.time - LATER:.2f} s"
        return f"| {name} = {value:g} | {test} | {after} | {''.join(first)} | {_describe(alarm)} |"


def _describe(alarm: rigtwin.Alarm) -> str:
    """The likeliest suspect."""
    if not alarm.suspects:
        return "none"
    return f"{alarm.suspects[0].effect}, {100.0 * alarm.suspects[0].probability:.0f} %"


def _nominal_cases(hours: float, seed: int) -> Iterator[tuple[str, int]]:
    wanted = math.ceil(3600.0 * hours / JUDGED)
    return islice(((name, seed + n) for n in count() for name in TESTS), wanted)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--effects", action="store_true")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        if given.effects:
            print("| effect | test | alarm after | first suspect | at the end |")
            print("|---|---|---|---|---|")
            cases = [
                (name, value, test, given.seed)
                for test in MOVING
                for name, value in EFFECTS.items()
            ]
            for row in pool.map(watch_effect, cases):
                print(row, flush=True)
        total, alarms, highest = 0.0, 0, 0.0
        nominal = list(_nominal_cases(given.hours, given.seed))
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
