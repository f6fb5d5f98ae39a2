"""Which effects are worth a fit beside others, or in the place of one: by what they change, without
fitting them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.ranking import LATE
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array

LOOKALIKES, RESEMBLES = 3, 0.6
"""Effects that are tried in another's place at most, if they can explain this share of what it
does."""


@dataclass(frozen=True)
class Proposal:
    """Effects worth a fit. promised: the misfit that a linear estimate gives them; values: to start
    from; space: tolerances."""

    promised: float
    effects: tuple[Effect, ...]
    values: Values
    space: Space = field(repr=False)


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
        own = space.beside((effect,))
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
        return Proposal(promised, (*first.effects, effect), (*first.values, *start), space)

    return [each for each in threads.spread(propose, effects) if each is not None]


def propose_replacements(
    fitter: Fitter, fit: Fit, effects: Sequence[Effect], threads: Threads
) -> list[tuple[tuple[Effect, ...], Values]]:
    """The effects of a fit with each in turn replaced by those whose response is most like its
    own: what was found first may only resemble what is there.

    Parameters
    ----------
    fitter
        Of the evidence.
    fit
        The fit.
    effects
        Candidates, all fitted alone before.
    threads
        Work side by side.

    Returns
    -------
    list of pairs
        Effects, and values to start from.
    """
    found = []
    here = fitter.evidence.residual(fit.plant)
    for number in range(len(fit.effects)):
        rest = [place for place in range(len(fit.effects)) if place != number]
        kept = tuple(fit.effects[place] for place in rest)
        values_kept = tuple(fit.values[place] for place in rest)
        plant = with_values(fitter.plant, kept, values_kept)
        own = fitter.space.project_out((fitter.evidence.residual(plant) - here)[:, None])[:, 0]
        without = Fit(kept, values_kept, fit.misfit, (), plant)
        fitter.residual_at(without)

        def resemble(
            other: Effect, own: Array = own, without: Fit = without
        ) -> tuple[float, Effect, Values]:
            starts, responses = zip(*fitter.responses_instead(other, without), strict=True)
            apart = fitter.space.project_out(np.stack(responses, axis=1).astype(np.float64))
            along, power = apart.T @ own, np.maximum(np.sum(apart**2, axis=0), 1e-300)
            resemblance = np.maximum(along, 0.0) ** 2 / power
            best = int(np.argmax(resemblance))
            share = min(float(along[best] / power[best]), 3.0)
            return float(resemblance[best]), other, fitter.scale_start(other, starts[best], share)

        others = [
            other
            for other in effects
            if other not in fit.effects
            and not clashes(other, kept)
            and is_possible((*kept, other), fitter.plant)
        ]
        scored = sorted(threads.spread(resemble, others), key=lambda item: -item[0])
        effect, rough = fit.effects[number], fitter.evidence.machine.rough
        for rank, (gain, other, start) in enumerate(scored):
            resembles = rank < LOOKALIKES and gain > RESEMBLES * float(own @ own)
            # The same at another component is the first thing to be asked about, and what else
            # may make this one late.
            elsewhere = rough and other.kind.name == effect.kind.name
            late = other.group == effect.group and {other.kind.name, effect.kind.name} <= {*LATE}
            if resembles or elsewhere or late:
                changed, values = list(fit.effects), list(fit.values)
                changed[number], values[number] = other, start[0]
                found.append((tuple(changed), tuple(values)))
    return found
