"""Measured, nominal and corrected signals of every sensor, as the report overlays them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.numerics.arrays import Array

LOOKED_AT = 1.0
"""Duration of the stretch that is in view at first, s."""
COUNTS = 0.5
"""Weight from which a tick counts in an error."""


@dataclass(frozen=True)
class Overlay:
    """One sensor of one recording: measured, nominal and corrected.

    All signals are in the band of the model, without the mains line, so that they can be compared.

    Attributes
    ----------
    recording
        File name of the recording.
    held_out
        Whether the correction was fitted without this recording.
    sensor, kind, unit
        Name of the sensor, its kind and the SI unit of its signal.
    time
        Time, s, shape (ticks,).
    measured, nominal, corrected
        Signals in `unit`, shape (ticks,).
    counts
        Weight of each tick, 0 to 1, shape (ticks,); 0 where the state of the model is not known.
    noise
        Rms noise of the sensor, in `unit`.
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

    def _rms_residual(self, predicted: Array) -> float:
        residual = (self.measured - predicted)[self.counts > COUNTS]
        return float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0

    @property
    def swing(self) -> float:
        """Standard deviation of the measured signal in `unit`; at least the sensor's noise."""
        counted = self.measured[self.counts > COUNTS]
        # A sensor that stands still would have an infinite error in percent.
        return max(float(np.std(counted)) if len(counted) else 0.0, self.noise)

    @property
    def before(self) -> float:
        """Rms of measured minus nominal, in `unit`."""
        return self._rms_residual(self.nominal)

    @property
    def after(self) -> float:
        """Rms of measured minus corrected, in `unit`."""
        return self._rms_residual(self.corrected)

    @property
    def before_percent(self) -> float:
        """Rms of measured minus nominal, in percent of `swing`."""
        return 100.0 * self.before / self.swing

    @property
    def after_percent(self) -> float:
        """Rms of measured minus corrected, in percent of `swing`."""
        return 100.0 * self.after / self.swing

    @property
    def worst(self) -> tuple[float, float]:
        """First and last time, s, of the second with the largest error of the corrected signal.

        Without a correction, the corrected signal is the nominal one.
        """
        period = float(self.time[1] - self.time[0]) if len(self.time) > 1 else 1.0
        ticks = min(max(round(LOOKED_AT / period), 1), len(self.time))
        power = (self.counts > COUNTS) * (self.measured - self.corrected) ** 2
        # Differences of the cumulative sum are the sums over all windows of that length.
        sums = np.concatenate([[0.0], np.cumsum(power)])
        start = int(np.argmax(sums[ticks:] - sums[:-ticks]))
        return float(self.time[start]), float(self.time[start + ticks - 1])


def overlay(
    evidence: Evidence, corrected: Plant, held_out: Evidence | None = None
) -> tuple[Overlay, ...]:
    """Overlay every observed sensor of every recording with its predictions.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    corrected
        Corrected plant.
    held_out
        Recordings that the correction was not fitted to. None without any.

    Returns
    -------
    tuple of Overlay
        Overlays of the held-out recordings first. Within a recording, the sensor with the largest
        gap in noise floors comes first.
    """
    overlays: list[Overlay] = []
    if held_out is not None:
        overlays += _overlay_recordings(held_out, corrected, True)
    return (*overlays, *_overlay_recordings(evidence, corrected, False))


def _overlay_recordings(evidence: Evidence, corrected: Plant, held_out: bool) -> Sequence[Overlay]:
    overlays: list[Overlay] = []
    for recording, lines, nominal, after in zip(
        evidence.recordings,
        evidence.lines,
        evidence.predict(evidence.plant),
        evidence.predict(corrected),
        strict=True,
    ):
        ticks = lines.measured.shape[1]
        of_recording = [
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
        overlays += sorted(of_recording, key=lambda sensor: -sensor.before / sensor.noise)
    return overlays
