"""Where the joints stand, of a machine as measured and of its twin as predicted."""

from __future__ import annotations

from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording

MOTIONS = ("position", "velocity")
"""Kinds of signals that say where a joint stands."""


def predicts_motion(machine: Machine) -> bool:
    """Whether any of the signals that a twin predicts is a motion; else what moves the twin is what
    was measured."""
    return any(row.kind in MOTIONS for row in machine.rows)


def find_positions(
    machine: Machine, recording: Recording, period: float, signals: Array | None = None
) -> dict[str, Array]:
    """Where the joints stand.

    Parameters
    ----------
    machine
        That the recording is of.
    recording
        Of it.
    period
        s, from one position to the next; a whole number of the recording's.
    signals
        What a twin predicts, shape (signals, ticks); None for the machine itself, as measured.

    Returns
    -------
    dict of Array
        Joint → position, m or rad, shape (ticks,). Of joints that no signal speaks of, nothing.
    """
    every = round(period / recording.period)
    columns = {
        topic: {name: values[::every] for name, values in names.items()}
        for topic, names in recording.columns.items()
    }
    if signals is not None:
        for row, signal in zip(machine.rows, signals, strict=True):
            if row.kind in MOTIONS:
                columns[row.channel[0]][row.channel[1]] = signal
    return machine.physics.joint_positions(machine, columns, period)
