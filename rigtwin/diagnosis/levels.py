"""The gap of each signal before and after a correction."""

from __future__ import annotations

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.gap import Level
from rigtwin.signals.noise import rms


def signal_levels(evidence: Evidence, corrected: Plant) -> dict[str, Level]:
    """Return the gap of each signal in the first recording, before and after a correction.

    Parameters
    ----------
    evidence
        Recordings about their nominal plant.
    corrected
        Plant with the correction.

    Returns
    -------
    dict
        Name of the signal → rms residual before and after, in units of the signal's noise. Noise
        alone has 1.
    """
    lines = evidence.lines[0]
    counted = lines.fade.max(axis=0) > 0.5
    levels = {}
    before, after = (
        evidence.differences(plant)[0][:, counted] for plant in (evidence.plant, corrected)
    )
    for row, name in enumerate(evidence.names):
        noise = float(lines.noise[row])
        levels[name] = Level(rms(before[row]) / noise, rms(after[row]) / noise, 1.0)
    return levels
