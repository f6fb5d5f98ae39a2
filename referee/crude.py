"""A baseline for the diagnosis: simulate the closed loop with every effect, name the best fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controllers import Measurements
from machines import DEFAULT_MACHINE
from rigtwin.components import RigPlant, Scales, Swing, candidates
from rigtwin.description.catalogue import find
from rigtwin.diagnosis.fit import with_values
from rigtwin.diagnosis.swing import swings
from rigtwin.recording import load
from rigtwin.signals.noise import white_noise
from rigtwin.simulation.runner import simulate, without_limits

TRIED = 24
"""Number of cases that the baseline runs on: each takes about two hundred simulations."""
SECONDS = 6.0
"""Part of a test that is compared, s."""
BETTER = 0.98
"""Share of the nominal misfit below which an effect is named."""
NO_SIZES = Scales(1.0, (-1.0, 1.0), 1.0, 1.0, 1.0, 1.0, 1.0)
"""Placeholder scales: the search starts of the rig do not depend on its motion."""


def black_box(path: Path) -> str:
    """Return the effect whose closed loop fits a recording best, tick by tick, or `none`."""
    recording = load(path)
    machine = find(DEFAULT_MACHINE)
    configuration = machine.configuration_of(recording)
    ticks = min(recording.ticks, round(SECONDS / recording.period))
    unlimited = without_limits(
        configuration._replace(
            timing=configuration.timing._replace(timestep=0.5 * recording.period)
        )
    )
    demands = np.column_stack(
        [recording.column("/command", name)[:ticks] for name in ("ground", "structure", "force")]
    )
    measured = np.stack(
        [recording.column("/sensor", name)[:ticks] for name in Measurements._fields]
    )
    noise = np.array([white_noise(row) for row in measured])

    def misfit(plant: RigPlant) -> float:
        # The closed loop amplifies every difference, so this misfit is far from convex.
        truth = simulate(unlimited._replace(plant=plant), demands, 0).truth.T
        return float(np.mean(((measured - truth) / noise[:, None]) ** 2))

    best, name = BETTER * misfit(configuration.plant), "none"
    swing = swings(machine, (recording,))
    for effect in candidates(configuration.plant):
        if effect.searched:
            starts = effect.starts(
                configuration.plant, swing.get(effect.component, Swing()), lambda: NO_SIZES
            )
            for start in starts.values[:8]:
                if (value := misfit(with_values(configuration.plant, (effect,), (start,)))) < best:
                    best, name = value, effect.name
    return name
