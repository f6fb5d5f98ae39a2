"""Size and rate of the commands in recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Schedule
from rigtwin.components.scales import SHARES, Swing
from rigtwin.description.machine import Machine
from rigtwin.recording import RecordedTest


def swings(machine: Machine, recordings: Sequence[RecordedTest]) -> dict[str, Swing]:
    """Return the swing of each command and of each channel that forces follow.

    Saturations and rate limits start from it: a limit that the commands never reach has no effect.

    Parameters
    ----------
    machine
        Machine the recordings belong to.
    recordings
        Recordings fitted jointly.

    Returns
    -------
    dict
        Quantiles of a signal's size and rate, by the component that it moves or changes.
    """
    by_component: dict[str, Swing] = {}
    for component in machine.components.values():
        followed = component.component_type is Schedule
        if component.channel is None or (component.channel[0] != "/command" and not followed):
            continue
        # A recording of a set may lack a command that another one has.
        columns = [
            (r.column(*component.channel), r.period)
            for r in recordings
            if r.has(*component.channel)
        ]
        if not columns:
            continue
        # The quantiles are over all recordings together: a limit has to fit all of them.
        size = np.concatenate([np.abs(column) for column, _ in columns])
        rate = np.concatenate([np.abs(np.diff(column)) / period for column, period in columns])
        largest, fastest = (tuple(np.quantile(part, SHARES).tolist()) for part in (size, rate))
        by_component[component.name] = Swing(largest, fastest)
    return by_component
