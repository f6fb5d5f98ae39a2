"""Which effects are worth a fit beside others, or in the place of one: by what they change, without
fitting them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.starts import LATE_BY_TIME
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array

RESEMBLES = 0.6
"""Share of an effect's response that another must be able to explain to be tried in its place."""
SAME = 0.99999
"""Cosine of two responses from which they are the same."""
MOVED = 6
"""Rank among all that resemble an effect up to which the same kind elsewhere is tried too."""


LATE = ("lag", "delay", "two_lags", "resonance")
"""Kinds that make a signal late, each in its own way."""


@dataclass(frozen=True)
class Proposal:
    """Effects worth a fit. promised: the misfit that a linear estimate gives them; values: to start
    from; space: tolerances; response: of the effect that is added, of unit length, shape
    (size,)."""

    promised: float
    effects: tuple[Effect, ...]
    values: Values
    space: Space = field(repr=False)
    response: NDArray[np.float32] = field(repr=False)


def propose_additions(
    fitter: Fitter, first: Fit, effects: Sequence[Effect], least: float, threads: Threads
) -> list[Proposal]:
    """Further effects beside a fit, by how well their responses at the nominal plant, or beside
    it, resemble what it leaves.

    Parameters
    ----------
    fitter
        Of the evidence.
    first
        The fit.
    effects
        Candidates, all fitted alone before.
    least
        χ² that one must promise to explain.
    threads
        Work side by side.

    Returns
    -------
    list of Proposal
        In the order of the candidates.
    """
    space = Space(fitter.evidence, first.plant)
    residual = fitter.residual_at(first)
    taken = space.misfit(residual)

    def propose(effect: Effect) -> Proposal | None:
        if clashes(effect, first.effects) or not is_possible(
            (*first.effects, effect), fitter.plant
        ):
            return None
        starts, responses = zip(*fitter.responses_beside(effect, first), strict=True)
        # An effect that takes a tolerance's place is not what that tolerance may take up.
        own = space.without_replaced((effect,))
        power, alike = own.strengths(np.stack(responses, axis=1).astype(np.float64), residual)
        power = np.maximum(power, 1e-300)
        # A response may be too strong or too weak, but not the other way round.
        share = np.clip(alike / power, 0.0, 3.0)
        gains = 2.0 * share * alike - share**2 * power
        best = int(np.argmax(gains))
        gain = float(gains[best]) - (own.misfit(residual) - taken)
        if gain <= least:
            return None
        promised = first.misfit - gain
        start = fitter.scale_start(effect, starts[best], float(share[best]))
        response = responses[best] / max(float(np.linalg.norm(responses[best])), 1e-30)
        effects, values = (*first.effects, effect), (*first.values, *start)
        return Proposal(promised, effects, values, space, response)

    return [each for each in threads.spread(propose, effects) if each is not None]


def choose_distinct(proposals: Sequence[Proposal], count: int) -> list[Proposal]:
    """Choose the proposals that promise most, none of which does the same as another.

    What does the same is tried in the place of what is found.

    Parameters
    ----------
    proposals
        Additions to one fit.
    count
        How many to choose at most.

    Returns
    -------
    list of Proposal
        The most promising one first.
    """
    chosen: list[Proposal] = []
    for proposal in sorted(proposals, key=lambda each: each.promised):
        alike = (abs(float(proposal.response @ each.response)) for each in chosen)
        if all(one < SAME for one in alike):
            chosen.append(proposal)
        if len(chosen) == count:
            break
    return chosen


def propose_replacements(
    fitter: Fitter, fit: Fit, effects: Sequence[Effect], count: int, threads: Threads
) -> list[tuple[tuple[Effect, ...], Values]]:
    """Replace each effect of a fit in turn by those whose response is most like its own: what was
    found first may only resemble what is there.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        The fit.
    effects
        Candidates, all screened before.
    count
        Effects that are tried in the place of each.
    threads
        Threads that work side by side.

    Returns
    -------
    list of pairs
        Effects, and values to start from.
    """
    found = []
    here = fitter.residual_at(fit)
    for number, effect in enumerate(fit.effects):
        kept = (*fit.effects[:number], *fit.effects[number + 1 :])
        values = (*fit.values[:number], *fit.values[number + 1 :])
        without = fitter.evidence.residual(with_values(fitter.plant, kept, values))
        response = without - here

        def resemble(other: Effect, response: Array = response) -> tuple[float, Effect, Values]:
            starts, responses = zip(*fitter.responses_beside(other, fit), strict=True)
            # An effect that takes a tolerance's place is not what that tolerance may take up.
            space = fitter.space.without_replaced((other,))
            both = np.column_stack([np.stack(responses, axis=1).astype(np.float64), response])
            shapes = space.project_out(both)
            shapes, own = shapes[:, :-1], shapes[:, -1]
            along, power = shapes.T @ own, np.maximum(np.sum(shapes**2, axis=0), 1e-100)
            alike = np.maximum(along, 0.0) ** 2 / (power * float(own @ own) + 1e-300)
            best = int(np.argmax(alike))
            share = min(float(along[best] / power[best]), 3.0)
            return float(alike[best]), other, fitter.scale_start(other, starts[best], share)

        others = [
            other
            for other in effects
            if other not in fit.effects
            and not clashes(other, fit.effects)
            and is_possible((*kept, other), fitter.plant)
        ]
        rivals = [
            other
            for other in effects
            if other not in fit.effects
            and clashes(other, (effect,))
            and not clashes(other, kept)
            and is_possible((*kept, other), fitter.plant)
        ]
        scored = sorted(threads.spread(resemble, others), key=lambda item: -item[0])
        for rank, (gain, other, start) in enumerate(scored):
            resembles = rank < count and gain > RESEMBLES
            # The same at another component is the first thing to be asked about, and what else
            # may make this one late.
            elsewhere = rank < MOVED and other.kind.name == effect.kind.name
            late = other.group == effect.group and {other.kind.name, effect.kind.name} <= {*LATE}
            if resembles or elsewhere or late:
                found.append(_put(fit, number, other, start[0]))
            if {other.kind.name, effect.kind.name} <= {*LATE_BY_TIME} and (late or elsewhere):
                # To first order a lag does the same as a delay of equal size.
                found.append(_put(fit, number, other, fit.values[number]))
        # An effect that sets a parameter of the one that it replaces has no response beside it.
        found += [
            _put(fit, number, other, fitter.starts(other).values[0]) for other in rivals[:count]
        ]
    return found


def _put(
    fit: Fit, number: int, other: Effect, start: tuple[float, ...]
) -> tuple[tuple[Effect, ...], Values]:
    """The effects of a fit with one of them replaced, and values to start from."""
    effects, values = list(fit.effects), list(fit.values)
    effects[number], values[number] = other, start
    return tuple(effects), tuple(values)
