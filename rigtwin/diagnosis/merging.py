"""Starts with one effect in the place of two.

A delay of all commands resembles viscous friction at every joint, and the mass of a link resembles
friction and gravity at two. A search that began with such effects cannot replace them one by one:
beside one of them, the effect that is present explains little.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import DAMPING
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.proposals import LARGEST_SHARE, RESEMBLES
from rigtwin.diagnosis.starts import LATE_BY_TIME, Start
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array

SUBSTITUTES = 2
"""Number of effects tried in the place of each two."""


def start_merged(
    fitter: Fitter, leader: Fit, candidates: Sequence[Effect], threads: Threads
) -> list[Start]:
    """Start a hypothesis with one effect in the place of each two.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit whose effects are merged.
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
    linearised = Linearised(fitter, leader)
    for pair in combinations(range(len(leader.effects)), 2):
        kept = [number for number in range(len(leader.effects)) if number not in pair]
        effects = tuple(leader.effects[number] for number in kept)
        values = tuple(leader.values[number] for number in kept)
        possible = [
            candidate
            for candidate in candidates
            if candidate not in leader.effects
            and is_possible((*effects, candidate), fitter.plant)
            and not clashes(candidate, effects)
        ]
        without = fitter.evidence.residual(with_values(fitter.plant, effects, values))
        missing = without - fitter.residual_at(leader)

        def substitute(
            candidate: Effect,
            kept: Sequence[int] = kept,
            effects: tuple[Effect, ...] = effects,
            missing: Array = missing,
        ) -> tuple[float, Start]:
            cosine, start, moves = _imitate(fitter, leader, candidate, missing, linearised, kept)
            moved = linearised.move(kept, moves)
            return cosine, ((*effects, candidate), (*moved, start))

        # `sorted` is stable, so that candidates that resemble alike keep their order.
        ranked = sorted(threads.spread(substitute, possible), key=lambda item: -item[0])
        starts += [start for cosine, start in ranked[:SUBSTITUTES] if cosine > RESEMBLES]
    return starts


def _imitate(
    fitter: Fitter,
    leader: Fit,
    candidate: Effect,
    missing: Array,
    linearised: Linearised,
    kept: Sequence[int],
) -> tuple[float, tuple[float, ...], Array]:
    """Return how well a candidate and changes of the kept effects imitate a missing response.

    The result is the squared cosine between the candidate's response and the missing one, both
    free of what the kept effects absorb, the candidate's start, and the moves of the kept effects.
    """
    starts, responses = zip(*fitter.responses_beside(candidate, leader), strict=True)
    shapes = np.stack(responses, axis=1).astype(np.float64)
    space = fitter.space.without_replaced((candidate,))
    columns = linearised.columns_of(kept)
    projected = space.project_out(np.column_stack([columns, shapes, missing]))
    along_columns, others = projected[:, : columns.shape[1]], projected[:, columns.shape[1] :]
    normal = along_columns.T @ along_columns
    normal += np.diag(DAMPING * np.diag(normal) + 1e-12)
    absorbed = np.linalg.solve(normal, along_columns.T @ others)
    free = others - along_columns @ absorbed
    shapes, target = free[:, :-1], free[:, -1]
    along, power = shapes.T @ target, np.maximum(np.sum(shapes**2, axis=0), 1e-100)
    cosines = np.maximum(along, 0.0) ** 2 / (power * float(target @ target) + 1e-300)
    best = int(np.argmax(cosines))
    share = min(float(along[best] / power[best]), LARGEST_SHARE)
    (start,) = fitter.scale_start(candidate, starts[best], share)
    return float(cosines[best]), start, share * absorbed[:, best] - absorbed[:, -1]


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
