"""Recordings with missing ticks, which a session in real time leaves out when it is late."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.recording import RecordedTest

LONGEST = 0.05
"""Longest gap that is filled in, in s. During it the machine kept its last commands."""


def mend(recording: RecordedTest) -> tuple[RecordedTest, NDArray[np.bool_]]:
    """Fill in missing ticks.

    Parameters
    ----------
    recording
        Recording in which ticks may be missing.

    Returns
    -------
    tuple of RecordedTest and array
        Recording after its last long gap, without missing ticks, and whether each tick was
        recorded, shape (ticks,). In filled ticks, commands are held and signals interpolated.
    """
    steps = np.diff(recording.time)
    # Nobody knows what the machine did in a long gap; only what follows is used.
    long = np.flatnonzero(np.abs(steps) > LONGEST)
    if len(long):
        recording = recording.between(float(recording.time[long[-1] + 1]), math.inf)
        steps = np.diff(recording.time)
    # Steps are rounded to whole periods; each step moves on by at least one tick.
    places = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / recording.period), 1.0))])
    places = places.astype(int)
    ticks = np.arange(places[-1] + 1)
    recorded = np.zeros(len(ticks), bool)
    recorded[places] = True
    if recorded.all():
        return recording, recorded
    # The last recorded tick at or before each tick.
    before = np.searchsorted(places, ticks, side="right") - 1
    columns = {
        topic: {
            # The card held its last command; sensors went on moving.
            name: values[before] if topic == "/command" else np.interp(ticks, places, values)
            for name, values in names.items()
        }
        for topic, names in recording.columns.items()
    }
    time = recording.time[0] + recording.period * ticks
    return replace(recording, time=time, columns=columns), recorded
