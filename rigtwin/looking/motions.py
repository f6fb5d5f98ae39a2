"""Positions of the joints, of a machine as measured and of its twin as predicted."""

from __future__ import annotations

from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

MOTIONS = ("position", "velocity")
"""Kinds of signal that determine a joint's position."""


def predicts_motion(machine: Machine) -> bool:
    """Return whether any predicted signal is a motion; otherwise the twin moves as measured."""
    return any(row.kind in MOTIONS for row in machine.rows)


def find_positions(
    machine: Machine, recording: RecordedTest, period: float, signals: Array | None = None
) -> dict[str, Array]:
    """Return the positions of the joints.

    Parameters
    ----------
    machine
        Machine the recording belongs to.
    recording
        Recording of the motion.
    period
        Time between two positions, in s; a multiple of the recording's period.
    signals
        Predicted signals, shape (signals, ticks); None for the machine as measured.

    Returns
    -------
    dict of Array
        Joint → position, in m or rad, shape (ticks,). Joints without a signal are left out.
    """
    # The model's period is a multiple of the recording's.
    every = round(period / recording.period)
    columns = {
        topic: {name: values[::every] for name, values in names.items()}
        for topic, names in recording.columns.items()
    }
    # Predicted motions replace the measured ones; all other channels stay as recorded.
    if signals is not None:
        for row, signal in zip(machine.rows, signals, strict=True):
            if row.kind in MOTIONS:
                columns[row.channel[0]][row.channel[1]] = signal
    return machine.physics.joint_positions(machine, columns, period)
