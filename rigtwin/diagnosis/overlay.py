"""Measured, nominal and corrected signals beside each other, sensor by sensor: what a diagnosis
says, in the engineer's own data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.numerics.arrays import Array

LOOKED_AT = 1.0
"""s, the stretch that is shown first."""
COUNTS = 0.5
"""Weight of a tick from which it counts in errors."""


@dataclass(frozen=True)
class Overlay:
    """One sensor of one recording.

    recording: its file's name; held_out: whether the correction was not fitted to it; sensor, kind
    and unit: as the machine's rows have them; time: s; measured, nominal, corrected: in that unit,
    shape (ticks,), as the model predicts them (in its band, mains line taken out); counts: ticks
    whose state is known; noise: rms, in
    the unit.
    """

    recording: str
    held_out: bool
    sensor: str
    kind: str
    unit: str
    time: Array
    measured: Array
    nominal: Array
    corrected: Array
    counts: Array
    noise: float

    def _rms(self, predicted: Array) -> float:
        left = (self.measured - predicted)[self.counts > COUNTS]
        return float(np.sqrt(np.mean(left**2))) if len(left) else 0.0

    @property
    def swing(self) -> float:
        """Standard deviation of what was measured, at least its noise, in its unit."""
        there = self.measured[self.counts > COUNTS]
        return max(float(np.std(there)) if len(there) else 0.0, self.noise)

    @property
    def before(self) -> float:
        """rms of measured less nominal, in the sensor's unit."""
        return self._rms(self.nominal)

    @property
    def after(self) -> float:
        """rms of measured less corrected, in the sensor's unit."""
        return self._rms(self.corrected)

    @property
    def before_percent(self) -> float:
        """The same in percent of the measured signal's standard deviation."""
        return 100.0 * self.before / self.swing

    @property
    def after_percent(self) -> float:
        """The same in percent of the measured signal's standard deviation."""
        return 100.0 * self.after / self.swing

    @property
    def worst(self) -> tuple[float, float]:
        """First and last time, s, of the second in which the corrected prediction is worst; where
        nothing was corrected, that is the nominal one."""
        period = float(self.time[1] - self.time[0]) if len(self.time) > 1 else 1.0
        ticks = min(max(round(LOOKED_AT / period), 1), len(self.time))
        power = (self.counts > COUNTS) * (self.measured - self.corrected) ** 2
        sums = np.concatenate([[0.0], np.cumsum(power)])
        start = int(np.argmax(sums[ticks:] - sums[:-ticks]))
        return float(self.time[start]), float(self.time[start + ticks - 1])


def overlay(
    evidence: Evidence, corrected: Plant, held_out: Evidence | None = None
) -> tuple[Overlay, ...]:
    """Every observed sensor of every recording as measured and as predicted.

    Parameters
    ----------
    evidence
        What the diagnosis was made of.
    corrected
        The plant with what was found.
    held_out
        Recordings that it was not fitted to.

    Returns
    -------
    tuple of Overlay
        Held-out recordings first; in each, the sensor with the largest gap in units of its noise
        first.
    """
    found: list[Overlay] = []
    if held_out is not None:
        found += _overlay_each(held_out, corrected, True)
    return (*found, *_overlay_each(evidence, corrected, False))


def _overlay_each(evidence: Evidence, corrected: Plant, held_out: bool) -> Sequence[Overlay]:
    found: list[Overlay] = []
    for recording, lines, nominal, after in zip(
        evidence.recordings,
        evidence.lines,
        evidence.predict(evidence.plant),
        evidence.predict(corrected),
        strict=True,
    ):
        ticks = lines.measured.shape[1]
        each = [
            Overlay(
                recording=recording.path.name,
                held_out=held_out,
                sensor=row.name,
                kind=row.kind,
                unit=row.unit,
                time=recording.time[0] + lines.period * np.arange(ticks),
                measured=lines.measured[index],
                nominal=nominal[index],
                corrected=after[index],
                counts=lines.fade[index],
                noise=float(lines.noise[index]),
            )
            for index, row in enumerate(evidence.machine.rows)
        ]
        found += sorted(each, key=lambda one: -one.before / one.noise)
    return found
