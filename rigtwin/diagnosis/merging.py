"""Starts with one effect in the place of two, or of all effects of one component.

A delay of all commands resembles viscous friction at every joint, and the mass of a link resembles
friction and gravity at two. Dry, quadratic and Stribeck friction of one joint together resemble its
viscous friction. A search that began with such effects cannot replace them one by one: beside the
others, the effect that is present explains little.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, combinations

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.imitation import RESEMBLES, Imitator
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.starts import LATE_BY_TIME, Start
from rigtwin.diagnosis.threads import Threads

SUBSTITUTES = 2
"""Number of effects tried in the place of each merged set."""


def start_merged(
    fitter: Fitter,
    leader: Fit,
    linearised: Linearised,
    candidates: Sequence[Effect],
    threads: Threads,
) -> list[Start]:
    """Start a hypothesis with one effect in the place of two, or of all of a component.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit whose effects are merged.
    linearised
        Residual of the leader, linearised in the values of its effects.
    candidates
        Candidate effects, all of them screened.
    threads
        Threads that simulate in parallel.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    starts: list[Start] = []
    pairs = combinations(range(len(leader.effects)), 2)
    for merged in chain(pairs, _find_crowded_components(leader)):
        effects = tuple(e for number, e in enumerate(leader.effects) if number not in merged)
        values = tuple(v for number, v in enumerate(leader.values) if number not in merged)
        possible = [
            candidate
            for candidate in candidates
            if candidate not in leader.effects
            and is_possible((*effects, candidate), fitter.plant)
            and not clashes(candidate, effects)
        ]
        without = fitter.evidence.residual(with_values(fitter.plant, effects, values))
        missing = without - fitter.residual_at(leader)
        imitator = Imitator(fitter, leader, linearised, merged, (missing,))
        imitations = threads.spread(imitator.imitate, possible)
        # `sorted` is stable, so that candidates that resemble alike keep their order.
        ranked = sorted(imitations, key=lambda imitation: -imitation.cosine)[:SUBSTITUTES]
        starts += [
            ((*effects, close.candidate), (*imitator.place_beside(close), close.start))
            for close in ranked
            if close.cosine > RESEMBLES
        ]
    return starts


def _find_crowded_components(fit: Fit) -> list[tuple[int, ...]]:
    """Return the numbers of the effects of each component that has more than two."""
    numbers: dict[str, list[int]] = {}
    for number, effect in enumerate(fit.effects):
        numbers.setdefault(effect.group, []).append(number)
    return [tuple(members) for members in numbers.values() if len(members) > 2]


def start_with_summed_delays(leader: Fit) -> list[Start]:
    """Start one lag or delay in the place of two.

    In a closed loop only the sum of two delays is observable, so that either alone, with the sum of
    both times, may explain the data.

    Parameters
    ----------
    leader
        Fit whose lags and delays are merged.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    starts: list[Start] = []
    late = [n for n, effect in enumerate(leader.effects) if effect.kind.name in LATE_BY_TIME]
    for kept in late:
        for removed in late:
            if removed != kept:
                values = list(leader.values)
                values[kept] = (values[kept][0] + values[removed][0],)
                effects = list(leader.effects)
                del values[removed], effects[removed]
                starts.append((tuple(effects), tuple(values)))
    return starts
