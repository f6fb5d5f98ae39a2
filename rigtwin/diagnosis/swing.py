"""How far and how fast the commands of some recordings went."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components.effect import SHARES, Swing
from rigtwin.description.machine import Machine
from rigtwin.recording import Recording


def swings(machine: Machine, recordings: Sequence[Recording]) -> dict[str, Swing]:
    """The swing of each command over all recordings, by the component that it moves."""
    found: dict[str, Swing] = {}
    for component in machine.components.values():
        if component.channel is None or component.channel[0] != "/command":
            continue
        columns = [
            (r.column(*component.channel), r.period)
            for r in recordings
            if r.has(*component.channel)
        ]
        if not columns:
            continue
        size = np.concatenate([np.abs(column) for column, _ in columns])
        rate = np.concatenate([np.abs(np.diff(column)) / period for column, period in columns])
        largest, fastest = (tuple(np.quantile(each, SHARES).tolist()) for each in (size, rate))
        found[component.name] = Swing(largest, fastest)
    return found
