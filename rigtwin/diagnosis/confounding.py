"""Confounded parameters: declared values that the data determine only together with fitted ones.

Let δ be the whitened response to a relative change of a declared value p, and J the responses to
relative changes of the fitted values q, both free of what the tolerances absorb. If

    |δ + J e| ≪ |δ|    with e = −(JᵀJ)⁻¹ Jᵀ δ,

then a change of p is undone by the changes d ln q_i = e_i d ln p. The data determine only the
combinations q_i · p^−e_i, such as the ratio of a friction to a mass in a free swing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Confounded, Name
from rigtwin.diagnosis.fit import Fit, clashes, with_values
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

SCALING = ("mass", "gain", "gains", "position_gain")
"""Kinds that scale all forces or motions of a joint, so that others may undo them."""
STEP = 0.02
"""Relative change of each value."""
UNDONE = 0.15
"""Share of the response to a declared value that fitted values leave where they undo it."""
CHANGE, VISIBLE = 0.1, 60.0
"""A declared value counts if a relative change of `CHANGE` changes the data by this chi-square."""
INVOLVED, STEEPEST = 0.1, 3.0
"""Smallest exponent of a fitted value that is reported, and largest one of a physical law. Larger
ones undo a change by the difference of two responses that resemble each other."""


def find_confounded(
    evidence: Evidence, fit: Fit, named: Sequence[Effect], candidates: Sequence[Effect]
) -> tuple[Confounded, ...]:
    """Find the declared values on which the fitted ones depend.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    fit
        Best hypothesis.
    named
        Effects that are named.
    candidates
        Effects of the machine.

    Returns
    -------
    tuple of Confounded
        One entry for each declared value whose change the fitted values would undo.
    """
    searched = evidence.thin()
    # Two scales of one component are one thing: the fitted one says it.
    scaled = {effect.group for effect in fit.effects if effect.kind.name in SCALING}
    scaling = [
        effect
        for effect in candidates
        if effect.kind.name in SCALING
        and effect.group not in scaled
        and not clashes(effect, fit.effects)
        and _declared(effect, searched) > 0.0
    ]
    if not named or not scaling:
        return ()
    base = searched.residual(fit.plant)
    responses = [_response(searched, fit, n, base) for n in range(len(fit.effects))]
    jacobian = np.column_stack(responses)
    entries = (_find_dependence(searched, fit, named, effect, jacobian, base) for effect in scaling)
    return tuple(entry for entry in entries if entry is not None)


def _find_dependence(
    evidence: Evidence,
    fit: Fit,
    named: Sequence[Effect],
    effect: Effect,
    jacobian: Array,
    base: Array,
) -> Confounded | None:
    """Return how fitted values depend on the declared value of an effect; None if they do not.

    `jacobian` has the responses to relative changes of the fitted values, and `base` is the
    residual of the fit.
    """
    # A tolerance of the declared value would absorb the very response that is studied; naming the
    # effect fixes that tolerance.
    space = Space(evidence, fit.plant, effects=(*fit.effects, effect))
    value = _declared(effect, evidence)
    changed = with_values(fit.plant, (effect,), ((value * (1.0 + STEP),),))
    response = (evidence.residual(changed) - base) / STEP
    projected = space.project_out(np.column_stack([jacobian, response]))
    columns, target = projected[:, :-1], projected[:, -1]
    # The response is per unit of relative change, and its χ² grows with the square of that change.
    if float(target @ target) * CHANGE**2 < VISIBLE:
        return None
    # The least-squares solution e of target + columns e = 0, the module's equation.
    exponents = -np.linalg.lstsq(columns, target, rcond=None)[0]
    if not _undoes(columns, exponents, target) or np.abs(exponents).max() > STEEPEST:
        return None
    # Columns that resemble each other share an exponent; a simple law is reported if it holds.
    simple = np.clip(np.round(exponents), -1.0, 1.0)
    exponents = simple if _undoes(columns, simple, target) else exponents
    involved = tuple(
        (Name(member.component, member.kind.name), float(exponent))
        for member, exponent in zip(fit.effects, exponents, strict=True)
        if member in named and abs(exponent) > INVOLVED
    )
    if not involved:
        return None
    unit = evidence.machine.unit(effect.group, next(iter(effect.quantities().values())))
    return Confounded(Name(effect.component, effect.kind.name), value, unit, involved)


def _undoes(columns: Array, exponents: Array, target: Array) -> bool:
    """Return whether changes of the fitted values undo the response to a declared one."""
    rest = target + columns @ exponents
    return float(rest @ rest) <= UNDONE**2 * float(target @ target)


def _declared(effect: Effect, evidence: Evidence) -> float:
    return effect.nominal(evidence.plant)[effect.kind.parameters[0]]


def _response(evidence: Evidence, fit: Fit, number: int, base: Array) -> Array:
    """Return the whitened response to a relative change of the magnitudes of one effect."""
    values, count = list(fit.values), fit.effects[number].kind.magnitudes
    moved = [value * (1.0 + STEP) for value in values[number][:count]]
    values[number] = (*moved, *values[number][count:])
    plant = with_values(fit.base or evidence.plant, fit.effects, values)
    return (evidence.residual(plant) - base) / STEP
