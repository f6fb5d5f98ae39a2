"""Direction of time in a recording: a cause precedes its consequence.

A dissipative machine explains its recording forwards in time and not backwards.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import rms, white_noise

STEPS = 2
"""Integration steps per tick of a rough prediction."""
LEAST_MISFIT = 10.0
"""Misfit of a signal, in units of its noise, below which the direction is not questioned."""
LEAST_RATIO = 3.0
"""Ratio of the forward to the backward misfit above which time runs backwards."""
MOST_UNEXPLAINED = 0.3
"""Share of a signal's swing that the backward prediction may miss. A swing that dies down faster
than predicted is missed in both directions, and less from its quiet end."""


def runs_backwards(
    machine: Machine, recording: RecordedTest, configuration: Configuration, predicted: Array
) -> bool:
    """Return whether the machine explains a recording far better backwards than forwards.

    Parameters
    ----------
    machine, recording, configuration
        Machine, recording and configuration of the twin, as for `find_faults`.
    predicted
        Signals predicted forwards, shape (rows, ticks).

    Returns
    -------
    bool
        False also where the direction is not observable: coupled joints with prescribed motion need
        the same torques forwards and backwards.
    """
    if machine.physics.reversible:
        return False
    measured = np.stack([recording.column(*row.channel) for row in machine.rows])
    forward = _misfits(measured, predicted)
    # The reversed prediction costs a simulation, so that it is made only if the forward one fails.
    if not np.isfinite(forward).all() or forward.max() < LEAST_MISFIT:
        return False
    # Without damping the equations of motion hold in both directions of time: t → -t leaves the
    # acceleration as it is. Only dissipation and delays tell them apart.
    columns = {
        topic: {name: values[::-1] for name, values in signals.items()}
        for topic, signals in recording.columns.items()
    }
    reversed_recording = replace(recording, columns=columns)
    model = machine.physics.model(machine, reversed_recording.inputs, configuration, STEPS)
    replayed = measured[:, ::-1]
    backward = _misfits(replayed, model.predict(configuration.plant))
    # `_misfits` leaves out straight lines, so that a prediction of 0 misses the swing about one.
    whole = _misfits(replayed, np.zeros_like(replayed))
    return (
        bool(np.isfinite(backward).all())
        and LEAST_RATIO * rms(backward) < rms(forward)
        and rms(backward) < MOST_UNEXPLAINED * rms(whole)
    )


def _misfits(measured: Array, predicted: Array) -> Array:
    """Return the standard deviation of each signal's residual about a straight line, shape (rows,).

    It is in units of the signal's noise. A straight line has no direction in time: a servo that
    lags behind a ramp does so backwards as well.
    """
    from scipy.signal import detrend  # Imported late: scipy is slow to load.

    residual = detrend(measured - predicted, axis=1)
    # A signal without visible noise, such as a computed command, must not have an infinite misfit.
    noise = [max(white_noise(row), 1e-12 * rms(row), 1e-300) for row in measured]
    return np.sqrt(np.mean(residual**2, axis=1)) / np.array(noise)
