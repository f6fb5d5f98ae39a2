"""Explanations found on the beginnings of recordings and followed to their ends.

What swings with little damping, or falls over, answers a small change with another motion
altogether after a while: seen from the nominal plant the misfit of a whole recording then has many
valleys. That of its beginning has one, and each longer stretch leads on to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigtwin.components import Effect
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.pairs import fit_pairs
from rigtwin.diagnosis.search import Search, detection_limit

SHARES = tuple(1.5**-power for power in range(8, 0, -1))
"""Of the recordings that are looked at in turn: what is known of one leads into the next."""
SHORTEST = 250
"""Ticks of a beginning at least."""
CARRIED = 4
"""Explanations that are followed from one beginning to the next."""
PATIENCE = 2
"""Beginnings that nothing explains after which no more are searched."""


def fit_beginnings(search: Search, tried: Sequence[Fit]) -> list[Fit]:
    """Explanations of the whole recordings by way of their beginnings, where none that was found at
    once will do.

    Parameters
    ----------
    search
        On the whole recordings.
    tried
        What was found there.

    Returns
    -------
    list of Fit
        With the tolerances taken at them; none if what was found leaves little.
    """
    evidence = search.fitter.evidence
    if _suffices(min(tried, key=search.cost), evidence, search):
        return []
    carried: list[Fit] = []
    missed = 0
    for share in SHARES:
        if share * min(recording.ticks for recording in evidence.recordings) < SHORTEST:
            continue
        part = evidence.beginning(share)
        coarse = Fitter(part.halve_steps())
        least = detection_limit(part, search.thresholds)
        here = replace(search, coarse=coarse, fitter=Fitter(part), least=least, told=lambda _: None)
        carried = _follow(carried, here)
        if missed < PATIENCE and not (carried and _suffices(carried[0], part, search)):
            carried = _best([*carried, *_look(here)], search)
            missed += bool(carried) and not _suffices(carried[0], part, search)
    return _follow(carried, search)


def _follow(carried: Sequence[Fit], search: Search) -> list[Fit]:
    """The explanations fitted to more, from the values that they had; the best first."""
    fits = search.threads.map(
        lambda fit: search.fitter.settle(search.coarse.refine(fit.effects, fit.values)), carried
    )
    return _best(fits, search)


def _best(fits: Sequence[Fit], search: Search) -> list[Fit]:
    """The best of each combination of effects, the best first."""
    distinct: dict[frozenset[Effect], Fit] = {}
    for fit in sorted(fits, key=search.cost):
        distinct.setdefault(frozenset(fit.effects), fit)
    return list(distinct.values())[:CARRIED]


def _look(search: Search) -> list[Fit]:
    """What explains a beginning; nothing if there is no gap in it."""
    nothing, tried = search.fit_singles()
    if nothing.misfit - search.cost(tried[0]) <= search.least:
        return []
    return tried + fit_pairs(search, nothing, tried)


def _suffices(fit: Fit, evidence: Evidence, search: Search) -> bool:
    """Whether little is left."""
    expected = evidence.expected_misfit(fit.plant)
    return fit.misfit - expected <= search.thresholds.unexplained * expected
