"""Starting values from the balance of forces along a measured motion.

The simulated motion of a lightly damped joint depends on the whole past, so that a twin without the
joint's friction soon departs from the measurement. The equation of motion, evaluated along the
measured motion, holds at every moment. Its error F0, the missing force, changes in proportion to
most effects. With the change D_i of the missing force for the trial value of effect i,

    min over s of |F0 + sum_i s_i D_i|^2

is a linear least-squares problem, as in the identification of robots by their inverse dynamics
model [Gautier, Khalil, IEEE Trans. Robot. Autom. 8 (1992) 368].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Values, with_values
from rigtwin.diagnosis.fitter import Fitter


def balance_forces(fitter: Fitter, effects: Sequence[Effect]) -> Values | None:
    """Return the magnitudes of several effects with which the missing force is least.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    effects
        Effects with a single parameter.

    Returns
    -------
    tuple or None
        Magnitudes within the effects' bounds. None where no measured joint moves freely, or the
        missing force is not finite.
    """
    evidence, plant = fitter.evidence, fitter.plant
    missing = evidence.missing_force(plant)
    if missing is None:
        return None
    nominal = np.array([effect.nominal(plant)[effect.kind.parameters[0]] for effect in effects])
    # The difference quotient is taken over a whole start of a search and not over a small step: the
    # force is linear in the effect, and a large change is less disturbed by rounding.
    trial = np.array([fitter.starts(effect).values[0][0] for effect in effects])
    columns = np.empty((len(missing), len(effects)))
    for number, effect in enumerate(effects):
        changed = evidence.missing_force(with_values(plant, [effect], [(float(trial[number]),)]))
        # Whether a joint moves freely is a property of the machine, not of the effect.
        assert changed is not None
        columns[:, number] = changed - missing
    if not (np.isfinite(columns).all() and np.isfinite(missing).all()):
        return None
    # Columns are collinear where two effects cause proportional forces. `lstsq` then returns the
    # solution of least norm, where a solver of normal equations would fail.
    shares = np.linalg.lstsq(columns, -missing, rcond=None)[0]
    low, high = fitter.bounds(effects)
    # The solution is linear and may leave the physical range; a fit starts within it.
    magnitudes = np.clip(nominal + shares * (trial - nominal), low, high)
    return tuple((float(value),) for value in magnitudes)
