"""A recording with ticks missing: a session in real time leaves out those that it missed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.recording import Recording

LONGEST = 0.05
"""s that may be filled in; the machine went on with the commands that it had."""


def mend(recording: Recording) -> tuple[Recording, NDArray[np.bool_]]:
    """Fills in what is missing.

    Parameters
    ----------
    recording
        Of which ticks may be missing.

    Returns
    -------
    tuple of Recording and array
        Without ticks missing, from its last long gap on; and which of its ticks were recorded,
        shape (ticks,). Of others, commands are those before and signals lie on a line.
    """
    steps = np.diff(recording.time)
    long = np.flatnonzero(np.abs(steps) > LONGEST)
    if len(long):
        recording = recording.between(float(recording.time[long[-1] + 1]), math.inf)
        steps = np.diff(recording.time)
    places = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / recording.period), 1.0))])
    places = places.astype(int)
    ticks = np.arange(places[-1] + 1)
    recorded = np.zeros(len(ticks), bool)
    recorded[places] = True
    if recorded.all():
        return recording, recorded
    before = np.searchsorted(places, ticks, side="right") - 1
    columns = {
        topic: {
            name: values[before] if topic == "/command" else np.interp(ticks, places, values)
            for name, values in names.items()
        }
        for topic, names in recording.columns.items()
    }
    time = recording.time[0] + recording.period * ticks
    return replace(recording, time=time, columns=columns), recorded
