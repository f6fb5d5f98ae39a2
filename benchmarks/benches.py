"""Accuracy of the diagnosis on random benches.

python -m benchmarks.benches --cases 80 --seed 2027
"""

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
from rigtwin.recording import RecordedTest


def recording_of(case: BenchCase, again: int = 0) -> RecordedTest:
    """Return the recording of a case; again: number of the repetition."""
    data = record(case, again)
    time = np.arange(len(data.first)) * case.period
    if case.machine == "actuator":
        columns = {"/command": {"position": data.first}, "/sensor": {"position": data.second}}
        return RecordedTest(
            Path("actuator"), "position-actuator", "", case.period, time, columns, {}
        )
    columns = {"/sensor": {"displacement": data.first, "force": data.second}}
    return RecordedTest(Path("damper"), "damper-bench", "", case.period, time, columns, {})


def diagnose_case(
    number: int, seed: int
) -> tuple[BenchCase, str, frozenset[str], frozenset[str], float]:
    """Return case, verdict, named kinds, kinds in a look-alike class, and time, s."""
    case = draw_case(number, seed)
    recording = recording_of(case)
    machine = find(recording.machine)
    diagnosis = diagnose(machine, [recording], held_out=[recording_of(case, 1)])
    named = frozenset(effect.name.kind for effect in diagnosis.effects)
    member = frozenset(name.kind for effect in diagnosis.effects for name in effect.alternatives)
    return case, diagnosis.verdict, named, member, diagnosis.answer.seconds


def main() -> None:
    """Print how often the diagnosis names exactly the effects of a bench."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=80)
    parser.add_argument("--seed", type=int, default=2027)
    parsed = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(diagnose_case, number, parsed.seed) for number in range(parsed.cases)]
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
