"""Declared tolerances that a correction uses up: what it leaves beside them is noise.

A tolerance is no effect, so it is not named. Where a part of the gap lies within it, the answer
says so, or that part would look like an unmodelled residual.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.components import Effect
from rigtwin.components.plant import parameter_of, select
from rigtwin.components.quantity import Quantity, fields
from rigtwin.diagnosis.cross_validation import with_effects
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Estimate, Tolerated
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.units import write
from rigtwin.diagnosis.words import enumerate_words

USED_UP = 1.0
"""Deviation from nominal, in half widths, from which a tolerance counts as used up."""


def find_used_up(evidence: Evidence, fit: Fit, named: Sequence[Effect]) -> tuple[Tolerated, ...]:
    """Find the tolerances at whose end, or beyond, the corrected twin fits best.

    Parameters
    ----------
    evidence
        Evidence that the correction explains to within noise and declared tolerances.
    fit
        Fit of the best hypothesis.
    named
        Its effects that are named.

    Returns
    -------
    tuple of Tolerated
        Values that fit best, with the declared tolerances as their intervals.
    """
    plant = with_effects(evidence.plant, fit, named)
    space = Space(evidence, plant, effects=named)
    amounts = space.estimate_tolerances(evidence.residual(plant))
    tolerated = []
    for tolerance, amount in zip(evidence.machine.tolerances, amounts, strict=True):
        if not tolerance.is_declared or abs(amount) < USED_UP:
            continue
        nominal = parameter_of(evidence.plant, tolerance.group, tolerance.parameter)
        width = evidence.width(tolerance)
        (component,) = select(evidence.plant, [tolerance.group])
        quantity = fields(type(component))[tolerance.parameter]
        assert isinstance(quantity, Quantity)
        unit = evidence.machine.unit(tolerance.group, quantity)
        estimate = Estimate(
            nominal + float(amount) * width, nominal - width, nominal + width, nominal, unit
        )
        tolerated.append(Tolerated(tolerance.group, tolerance.parameter, estimate))
    return tuple(tolerated)


def describe_used_up(tolerated: Sequence[Tolerated]) -> list[str]:
    """Say which tolerances are used up, as a note of the answer; no note without any."""
    if not tolerated:
        return []
    values = []
    for part in tolerated:
        value, low, high = (
            write(number, part.estimate.unit)
            for number in (part.estimate.value, part.estimate.low, part.estimate.high)
        )
        values.append(f"{part.parameter}@{part.component} {value} (declared {low} to {high})")
    return [f"the twin fits best at the end of declared tolerances: {enumerate_words(values)}"]
