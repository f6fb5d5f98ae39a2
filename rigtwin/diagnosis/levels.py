"""The gap of each signal before and after a correction."""

from __future__ import annotations

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Level
from rigtwin.signals.noise import rms


def signal_levels(evidence: Evidence, corrected: Plant) -> dict[str, Level]:
    """Each signal's own gap in the first recording, rms in units of its noise, before and after."""
    each = evidence.lines[0]
    counted = each.fade.max(axis=0) > 0.5
    found = {}
    before, after = (
        evidence.differences(plant)[0][:, counted] for plant in (evidence.plant, corrected)
    )
    for row, name in enumerate(evidence.names):
        noise = float(each.noise[row])
        found[name] = Level(rms(before[row]) / noise, rms(after[row]) / noise, 1.0)
    return found
