"""Proposals of effects that are worth a fit, from their simulated responses alone.

Let d be the whitened response to an effect beside a fit, r the residual of that fit, and both free
of what the tolerances absorb. The share s of the response explains the chi-square

    2 s d'r - s^2 d'd,

which is largest at s = d'r / d'd. An effect is added for what it explains of r. It replaces an
effect whose response it imitates (`imitation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, leave_one_out, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.imitation import LARGEST_SHARE, RESEMBLES, Imitation, Imitator
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.starts import LATE_BY_TIME
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.waves import blend_waves
from rigtwin.numerics.arrays import Array

IDENTICAL = 0.99999
"""Cosine of two responses from which they count as identical."""
ELSEWHERE = 6
"""Rank among the resembling effects up to which the same kind at another component is tried."""
SMALL_PART = 0.05
"""Share of an effect that is taken away for its local response."""
LATE = ("lag", "delay", "two_lags", "resonance")
"""Kinds that delay a signal."""


@dataclass(frozen=True)
class Proposal:
    """Effects that are worth a fit.

    Attributes
    ----------
    promised
        Misfit that the linear estimate gives the effects.
    effects
        Effects of the fit and the one that is added, last.
    values
        Starting values of each effect.
    space
        Tolerances about the fit.
    response
        Whitened response to the added effect, scaled to unit length, shape (size,).
    """

    promised: float
    effects: tuple[Effect, ...]
    values: Values
    space: Space = field(repr=False)
    response: NDArray[np.float32] = field(repr=False)


def propose_additions(
    fitter: Fitter, first: Fit, effects: Sequence[Effect], least: float, threads: Threads
) -> list[Proposal]:
    """Propose effects to add to a fit, by what their responses explain of its residual.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    first
        Fit that is extended.
    effects
        Candidate effects, all of them screened.
    least
        Chi-square that an addition must promise to explain.
    threads
        Threads that simulate in parallel.

    Returns
    -------
    list of Proposal
        Proposals in the order of the candidates.
    """
    space = Space(fitter.evidence, first.plant)
    residual = fitter.residual_at(first)
    current = space.misfit(residual)

    def propose(effect: Effect) -> Proposal | None:
        if clashes(effect, first.effects) or not is_possible(
            (*first.effects, effect), fitter.plant
        ):
            return None
        # An effect that replaces a tolerance must not be judged beside that tolerance.
        reduced = space.without_replaced((effect,))
        pairs = fitter.responses_beside(effect, first)
        if fitter.starts(effect).quadrature:
            pairs = [(start, shape) for _, start, shape in blend_waves(reduced, pairs, residual)]
        starts, responses = zip(*pairs, strict=True)
        shapes = np.stack(responses, axis=1).astype(np.float64)
        power, along = reduced.strengths(shapes, residual)
        power = np.maximum(power, 1e-300)
        # The share may correct the size of a response, but not its sign: a negative Coulomb
        # friction, for example, is not the mirror image of a positive one.
        share = np.clip(along / power, 0.0, LARGEST_SHARE)
        gains = 2.0 * share * along - share**2 * power
        best = int(np.argmax(gains))
        # Giving up the replaced tolerance costs misfit, which the effect has to make up for.
        gain = float(gains[best]) - (reduced.misfit(residual) - current)
        if gain <= least:
            return None
        promised = first.misfit - gain
        start = fitter.scale_start(effect, starts[best], float(share[best]))
        # At unit length the scalar product of two responses is the cosine between them
        # (`choose_distinct`).
        response = responses[best] / max(float(np.linalg.norm(responses[best])), 1e-30)
        extended, values = (*first.effects, effect), (*first.values, *start)
        return Proposal(promised, extended, values, space, response)

    proposals = threads.spread(propose, effects)
    return [proposal for proposal in proposals if proposal is not None]


def choose_distinct(proposals: Sequence[Proposal], count: int) -> list[Proposal]:
    """Choose the most promising proposals with distinct responses.

    An effect with an identical response is tried later, as a replacement of the chosen one.

    Parameters
    ----------
    proposals
        Additions to one fit.
    count
        Largest number of proposals to choose.

    Returns
    -------
    list of Proposal
        Chosen proposals, the most promising one first.
    """
    chosen: list[Proposal] = []
    for proposal in sorted(proposals, key=lambda proposal: proposal.promised):
        cosines = (abs(float(proposal.response @ member.response)) for member in chosen)
        if all(cosine < IDENTICAL for cosine in cosines):
            chosen.append(proposal)
        if len(chosen) == count:
            break
    return chosen


def propose_replacements(
    fitter: Fitter,
    fit: Fit,
    linearised: Linearised,
    effects: Sequence[Effect],
    count: int,
    threads: Threads,
) -> list[tuple[tuple[Effect, ...], Values]]:
    """Propose replacements of each effect of a fit by those with the most similar response.

    An effect that was fitted early may only resemble the effect that is present.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit whose effects are replaced in turn.
    linearised
        Residual of the fit, linearised in the values of its effects.
    effects
        Candidate effects, all of them screened.
    count
        Number of candidates tried in the place of each effect.
    threads
        Threads that simulate in parallel.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    starts = []
    residual = fitter.residual_at(fit)
    for number, (effect, remaining, values) in enumerate(leave_one_out(fit)):
        without = fitter.evidence.residual(with_values(fitter.plant, remaining, values))
        # The difference of the two targets is the size of the change: an effect may be imitated as
        # a whole, or only in small changes about its fitted value.
        targets = (without - residual, _local_response(fitter, fit, number, residual))
        imitator = Imitator(fitter, fit, linearised, [number], targets)
        possible = [
            candidate
            for candidate in effects
            if candidate not in fit.effects and is_possible((*remaining, candidate), fitter.plant)
        ]
        compatible = [item for item in possible if not clashes(item, fit.effects)]
        # `sorted` is stable, so that candidates that resemble alike keep their order.
        imitations = threads.spread(imitator.imitate, compatible)
        ranked = sorted(imitations, key=lambda imitation: -imitation.cosine)
        starts += _choose_replacements(fit, number, imitator, ranked, count)
        # A candidate that clashes with the replaced effect has no response beside it: try unseen.
        exclusive = [
            candidate
            for candidate in possible
            if clashes(candidate, (effect,)) and not clashes(candidate, remaining)
        ]
        starts += [
            _replace_effect(fit, number, candidate, fitter.starts(candidate).values[0])
            for candidate in exclusive[:count]
        ]
    return starts


def _local_response(fitter: Fitter, fit: Fit, number: int, residual: Array) -> Array:
    """Return the response to one effect of a fit, extrapolated from a small part of it.

    The whole response of damping that tames a resonance, for example, resembles nothing: the
    machine oscillates without it. A small part of it resembles that of any other damping.
    """
    effect, values = fit.effects[number], list(fit.values)
    nominal = effect.nominal(fitter.plant)
    names = effect.kind.parameters[: effect.kind.magnitudes]
    nearer = list(values[number])
    for place, name in enumerate(names):
        nearer[place] += SMALL_PART * (nominal[name] - nearer[place])
    values[number] = tuple(nearer)
    # Only magnitudes go back towards nominal. The shapes of an absent effect have no meaning.
    moved = fitter.evidence.residual(with_values(fitter.plant, fit.effects, values))
    return (moved - residual) / SMALL_PART


def _choose_replacements(
    fit: Fit, number: int, imitator: Imitator, ranked: Sequence[Imitation], count: int
) -> list[tuple[tuple[Effect, ...], Values]]:
    """Choose among imitations, the closest first, those tried in the place of one effect.

    Beside the closest ones, these are the same kind at other components, and other kinds that delay
    the same signal or one that resembles it: the questions that an engineer would ask first.
    """
    effect = fit.effects[number]
    starts = []
    for rank, imitation in enumerate(ranked):
        candidate = imitation.candidate
        kinds = {candidate.kind.name, effect.kind.name}
        resembles = rank < count and imitation.cosine > RESEMBLES
        elsewhere = rank < ELSEWHERE and candidate.kind.name == effect.kind.name
        late = kinds <= {*LATE} and (candidate.group == effect.group or rank < ELSEWHERE)
        if resembles or elsewhere or late:
            values = list(imitator.place_beside(imitation))
            values.insert(number, imitation.start)
            effects = list(fit.effects)
            effects[number] = candidate
            starts.append((tuple(effects), tuple(values)))
        if kinds <= {*LATE_BY_TIME} and (late or elsewhere):
            # To first order a lag equals a delay of the same time: 1 / (1 + T s) = exp(-T s) + ...
            starts.append(_replace_effect(fit, number, candidate, fit.values[number]))
    return starts


def _replace_effect(
    fit: Fit, number: int, candidate: Effect, start: tuple[float, ...]
) -> tuple[tuple[Effect, ...], Values]:
    """Return the effects of a fit with one replaced, and the values from which they are fitted."""
    effects, values = list(fit.effects), list(fit.values)
    effects[number], values[number] = candidate, start
    return tuple(effects), tuple(values)
