"""What a search for an effect starts from: values, steps, and how far the commands of a test went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.machine.machine import Machine
from rigtwin.recording import Recording

SHARES = (0.9999, 0.999, 0.98, 0.9, 0.75, 0.5, 0.3)
"""Of the time; a limit is looked for at the values that a command exceeds for the rest of it."""


@dataclass(frozen=True)
class Swing:
    """How far and fast a command went: the magnitude, in its unit, and the rate, unit/s, that it stays below for these
    `SHARES` of the time."""

    largest: tuple[float, ...]
    fastest: tuple[float, ...]


@dataclass(frozen=True)
class Trials:
    """Values to start from, one tuple each in the order of the effect's parameters; steps: fine ones for derivatives.
    quadrature: whether starts come in pairs a quarter of a wave apart, (amplitude, pitch, 0) and (amplitude, pitch, π/2), so
    that any phase is a blend of both. bounds: narrower ones than the parameters' own, by what the recording can show."""

    starts: tuple[tuple[float, ...], ...]
    steps: tuple[float, ...]
    quadrature: bool = False
    bounds: tuple[tuple[float, float], ...] | None = None


def swings(machine: Machine, recordings: Sequence[Recording]) -> dict[str, Swing]:
    """The swing of each command over all recordings, by the component that it moves."""
    found: dict[str, Swing] = {}
    for component in machine.components.values():
        if component.channel is None or component.channel[0] != "/command":
            continue
        columns = [(r.column(*component.channel), r.period) for r in recordings if r.has(*component.channel)]
        if not columns:
            continue
        size = np.concatenate([np.abs(column) for column, _ in columns])
        rate = np.concatenate([np.abs(np.diff(column)) / period for column, period in columns])
        found[component.name] = Swing(tuple(np.quantile(size, SHARES).tolist()), tuple(np.quantile(rate, SHARES).tolist()))
    return found
