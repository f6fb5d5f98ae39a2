"""How often the diagnosis is right on benches that it never saw: `python -m benchmarks.benches
--cases 80 --seed 2027`."""

from __future__ import annotations

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from tqdm import tqdm

from referee.bench_cases import BenchCase, draw_case, record
from rigtwin.description.catalogue import find
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.recording import Recording


def recording_of(case: BenchCase, again: int = 0) -> Recording:
    """The case as a file would hold it."""
    data = record(case, again)
    time = np.arange(len(data.first)) * case.period
    if case.machine == "actuator":
        columns = {"/command": {"position": data.first}, "/sensor": {"position": data.second}}
        return Recording(Path("actuator"), "position-actuator", "", case.period, time, columns, {})
    columns = {"/sensor": {"displacement": data.first, "force": data.second}}
    return Recording(Path("damper"), "damper-bench", "", case.period, time, columns, {})


def answered(
    number: int, seed: int
) -> tuple[BenchCase, str, frozenset[str], frozenset[str], float]:
    """(the case, verdict, kinds named, those in any class, seconds)."""
    case = draw_case(number, seed)
    recording = recording_of(case)
    machine = find(recording.machine)
    found = diagnose(machine, [recording], held_out=[recording_of(case, 1)])
    named = frozenset(effect.name.kind for effect in found.effects)
    member = frozenset(name.kind for effect in found.effects for name in effect.alternatives)
    return case, found.verdict, named, member, found.answer.seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=80)
    parser.add_argument("--seed", type=int, default=2027)
    parsed = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(answered, number, parsed.seed) for number in range(parsed.cases)]
        answers = [job.result() for job in tqdm(jobs, disable=None, leave=False)]
    count = Counter()
    for case, verdict, named, member, _ in answers:
        count["exactly" if named == case.names else "wrong"] += 1
        count["all in it found"] += case.names <= member
        count["a name that is not in it"] += bool(named - case.names)
        if not case.names:
            count["nulls"] += 1
            count["false alarms"] += verdict != "no gap"
        if named != case.names:
            print(
                f"  {case.machine} {case.seed}: {verdict}; in it {sorted(case.names)}, "
                f"named {sorted(named)}; {case.truth}"
            )
    for name, value in count.items():
        print(f"{name:28s} {value} of {len(answers)}")
    print(f"median time {np.median([seconds for *_, seconds in answers]):.1f} s")


if __name__ == "__main__":
    main()
