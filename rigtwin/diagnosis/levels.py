"""The gap of each signal before and after a correction."""

from __future__ import annotations

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.gap import Level


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
    before, after = (
        np.sqrt(lines.mean(evidence.differences(plant)[0] ** 2)) / lines.noise
        for plant in (evidence.plant, corrected)
    )
    return {
        name: Level(float(before[row]), float(after[row]), 1.0)
        for row, name in enumerate(evidence.names)
    }
