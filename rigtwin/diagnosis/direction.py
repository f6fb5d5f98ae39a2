"""Which way a recording's time runs: causes come before what they bring about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms, white_noise

STEPS = 2
"""Of integration a tick, for a rough prediction."""
DIFFERS = 10.0
"""Times its noise by which a signal has to be off before its direction is asked for."""
NEARER = 3.0
"""Times that the prediction from the end has to be nearer."""


def runs_backwards(
    machine: Machine, recording: Recording, configuration: Configuration, predicted: Array
) -> bool:
    """Whether the machine explains a recording far better from its end than from its beginning.

    Parameters
    ----------
    machine, recording, configuration
        As of `find_faults`.
    predicted
        Of the recording as it is, shape (rows, ticks).

    Returns
    -------
    bool
        False also where it cannot be told: joints that act on each other and are moved as measured
        need the same torques either way.
    """
    if machine.physics.reversible:
        return False
    measured = np.stack([recording.column(*row.channel) for row in machine.rows])
    forth = _misfits(measured, predicted)
    if not np.isfinite(forth).all() or forth.max() < DIFFERS:
        return False
    columns = {
        topic: {name: values[::-1] for name, values in signals.items()}
        for topic, signals in recording.columns.items()
    }
    turned = replace(recording, columns=columns)
    model = machine.physics.model(machine, turned.inputs, configuration, STEPS)
    back = _misfits(measured[:, ::-1], model.predict(configuration.plant))
    return bool(np.isfinite(back).all()) and NEARER * rms(back) < rms(forth)


def _misfits(measured: Array, predicted: Array) -> Array:
    """rms of what each signal differs by, its mean apart, in units of its noise; shape (rows,)."""
    left = measured - predicted
    left = left - left.mean(axis=1, keepdims=True)
    noise = [max(white_noise(row), 1e-12 * rms(row), 1e-300) for row in measured]
    return np.sqrt(np.mean(left**2, axis=1)) / np.array(noise)
