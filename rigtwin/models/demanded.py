"""A test that is still to come, in the form of a recording: a model is driven by either."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording


def pose_as_recorded(machine: Machine, signals: Mapping[str, Array], period: float) -> Recording:
    """Signals of components as their channels would hold them.

    Parameters
    ----------
    machine
        Its description.
    signals
        Component with a channel → command or reading, shape (ticks,).
    period
        s, of a tick.

    Returns
    -------
    Recording
        Of these channels alone.
    """
    columns: dict[str, dict[str, Array]] = {}
    for name, signal in signals.items():
        channel = machine.components[name].channel
        assert channel is not None
        columns.setdefault(channel[0], {})[channel[1]] = signal
    ticks = len(next(iter(signals.values())))
    return Recording(
        path=Path("test"),
        machine=machine.name,
        experiment="",
        period=period,
        time=np.arange(ticks) * period,
        columns=columns,
        controller={},
    )
