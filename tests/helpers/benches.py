"""What the referee's benches write, as a file would hold it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from referee.bench_cases import BenchCase, record
from rigtwin.recording import RecordedTest


def recording_of(case: BenchCase) -> RecordedTest:
    data = record(case)
    time = np.arange(len(data.first)) * case.period
    if case.machine == "actuator":
        columns = {"/command": {"position": data.first}, "/sensor": {"position": data.second}}
        return RecordedTest(
            Path("actuator"), "position-actuator", "", case.period, time, columns, {}
        )
    columns = {"/sensor": {"displacement": data.first, "force": data.second}}
    return RecordedTest(Path("damper"), "damper-bench", "", case.period, time, columns, {})
