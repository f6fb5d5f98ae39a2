"""Motions and curves of the suspension rig for films and the page."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from rigtwin.description.physics import Columns
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.render.curves import Curve
from rigtwin.render.style import COLOURS

SMOOTHING = 20.0
"""Cut-off of the zero-phase filter of what is shown, Hz: the mains hum would shake the rig."""
SHORTEST = 50
"""Ticks below which signals are shown unfiltered."""


def joint_positions(columns: Columns, period: float) -> dict[str, Array]:
    """Return joint → position at every tick, m; empty without the sensors that tell them."""
    sensed = columns.get("/sensor", {})
    if not {"structure_lvdt", "suspension_lvdt"} <= set(sensed):
        return {}
    structure = _smooth(sensed["structure_lvdt"], period)
    travel = _smooth(sensed["suspension_lvdt"], period)
    ground = np.zeros_like(structure)
    if "ground_lvdt" in sensed:
        ground = _smooth(sensed["ground_lvdt"], period)
    return {"ground": ground, "carriage": structure - travel, "structure": structure}


def list_curves(recording: RecordedTest) -> list[Curve]:
    """Return the suspension's force and travel."""
    measured, commanded = COLOURS["measured"], COLOURS["commanded"]
    curves = [
        ("force, N", "measured", measured, "/sensor", "load_cell", 1.0),
        ("force, N", "demanded", commanded, "/command", "force", 1.0),
        ("travel, mm", "measured", measured, "/sensor", "suspension_lvdt", 1e3),
    ]
    return [
        Curve(axis, label, colour, scale * recording.column(topic, name))
        for axis, label, colour, topic, name, scale in curves
        if recording.has(topic, name)
    ]


def _smooth(signal: Array, period: float) -> Array:
    if 0.45 / period <= SMOOTHING or len(signal) < SHORTEST:
        return signal
    return sosfiltfilt(butter(2, SMOOTHING, fs=1.0 / period, output="sos"), signal)
