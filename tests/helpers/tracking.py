"""Tracking errors of a recorded test."""

from __future__ import annotations

import numpy as np

from controllers import Commands, Measurements
from rigtwin.description.configuration import Configuration
from rigtwin.recording import RecordedTest
from rigtwin.simulation.ideal import simulate_ideal
from rigtwin.simulation.metrics import Tracking, compute_tracking
from rigtwin.simulation.structure_motion import models_output


def tracking_of(recording: RecordedTest, configuration: Configuration) -> Tracking:
    """Compute e1 and e2 of a recorded test.

    Parameters
    ----------
    recording
        Recording of a model-in-the-loop test. True values of a twin are used where it has them.
    configuration
        Settings of the test.

    Returns
    -------
    Tracking
        rms errors.
    """
    known = "/truth" in recording.columns
    structure = (
        recording.column("/truth", "structure")
        if known
        else recording.column("/sensor", "structure_lvdt")
    )
    load_cell = recording.column("/truth" if known else "/sensor", "load_cell")
    commands, sensed = (
        np.column_stack([recording.column(topic, name) for name in names])
        for topic, names in (("/command", Commands._fields), ("/sensor", Measurements._fields))
    )
    asked = models_output(configuration, commands, sensed)
    return compute_tracking(
        simulate_ideal(configuration, commands[:, 0]), asked, structure, load_cell
    )
