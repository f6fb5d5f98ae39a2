"""Magnitudes to start from, by the balance of forces along a measured motion.

How a joint that swings with little damping goes on depends on all that acts on it before, so a twin
without its friction says little of what is there. The forces that its measured motion takes depend
on what acts at each moment alone, and most effects change them in proportion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Values, with_values
from rigtwin.diagnosis.fitter import Fitter


def balance_forces(fitter: Fitter, effects: Sequence[Effect]) -> Values | None:
    """The magnitudes of several effects with which least force is missing.

    Parameters
    ----------
    fitter
        Of the evidence.
    effects
        Of one parameter each.

    Returns
    -------
    tuple or None
        Within the effects' bounds; None where nothing that goes by itself is observed, or its
        forces do not tell.
    """
    evidence, plant = fitter.evidence, fitter.plant
    missing = evidence.missing_force(plant)
    if missing is None:
        return None
    nominal = np.array([effect.nominal(plant)[effect.kind.parameters[0]] for effect in effects])
    tried = np.array([fitter.starts(effect).values[0][0] for effect in effects])
    columns = np.empty((len(missing), len(effects)))
    for number, effect in enumerate(effects):
        there = evidence.missing_force(with_values(plant, [effect], [(float(tried[number]),)]))
        assert there is not None
        columns[:, number] = there - missing
    if not (np.isfinite(columns).all() and np.isfinite(missing).all()):
        return None
    shares = np.linalg.lstsq(columns, -missing, rcond=None)[0]
    low, high = fitter.bounds(effects)
    found = np.clip(nominal + shares * (tried - nominal), low, high)
    return tuple((float(value),) for value in found)
