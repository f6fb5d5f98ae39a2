"""Model inputs of a test that is still to be run."""

from __future__ import annotations

from collections.abc import Mapping

from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs


def inputs_of_test(machine: Machine, signals: Mapping[str, Array], period: float) -> Inputs:
    """Arrange the demands of a test by channel.

    Parameters
    ----------
    machine
        Machine under test.
    signals
        Component with a channel → command or reading, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    Inputs
        These channels alone.
    """
    columns: dict[str, dict[str, Array]] = {}
    for name, signal in signals.items():
        channel = machine.components[name].channel
        assert channel is not None
        columns.setdefault(channel[0], {})[channel[1]] = signal
    return Inputs(machine.name, period, columns)
