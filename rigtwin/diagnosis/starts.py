"""Where fits of sets of effects start: sets and values that a search would not come to by adding
one effect after another."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import combinations, product

from rigtwin.components import Effect, Guide
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, leave_one_out, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.prices import is_rare

Start = tuple[tuple[Effect, ...], Values]
"""Effects, and the values that a fit starts from."""
REGULAR = ("coulomb", "viscous", "stiffness", "mass", "armature", "offset")
"""Kinds that nearly every machine has more or less of."""
GATEWAY = "coulomb"
"""Kind without which a play, a spring or a Stribeck peak in series with it does nothing."""
LATE_BY_TIME = ("lag", "delay")
"""Kinds of one parameter, the time by which a signal is late."""
IN_SERIES = ("compliance", "backlash")
"""Kinds in series with dry friction that hide it."""
SECOND_ORDER = ("two_lags", "resonance")
"""Kinds that a lag together with a delay resembles."""
COMBINATIONS, FOLLOWED = 150, 2
"""Combinations of starts that are tried of one hypothesis at most, and those that are fitted."""


def start_in_series(
    fitter: Fitter,
    leader: Fit,
    candidates: Sequence[Effect],
    known: Collection[frozenset[Effect]],
) -> list[Start]:
    """Start pairs of dry friction and what is in series with it.

    Friction behind a soft spring hardly resembles friction alone, nor does a play resemble one
    behind a spring, so that both values of a pair are tried together.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit beside whose effects the pair is tried.
    candidates
        Effects that are searched.
    known
        Sets of effects that were fitted already.

    Returns
    -------
    list of pairs
        Effects, and the best of all pairs of their starts.
    """
    found = []
    gates = [each for each in candidates if each.kind.name == GATEWAY and each.of is Guide]
    for gate in gates:
        series = [gate] + [
            each for each in candidates if each.group == gate.group and each.kind.name in IN_SERIES
        ]
        for pair in combinations(series, 2):
            rest = [
                (effect, values)
                for effect, values in zip(leader.effects, leader.values, strict=True)
                if effect not in pair
            ]
            kept = tuple(effect for effect, _ in rest)
            rubs = gate in pair or gate in kept
            if (
                rubs
                and frozenset((*kept, *pair)) not in known
                and not any(clashes(each, kept) for each in pair)
            ):
                values = tuple(values for _, values in rest)
                found.append(_start_pair(fitter, kept, values, pair))
    return found


def start_unfolded(fitter: Fitter, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start a lag and a delay in the place of an effect of second order, which they resemble at low
    frequencies; parameters as of `start_in_series`."""
    found = []
    for effect, rest, values in leave_one_out(leader):
        pair = [
            each
            for each in candidates
            if each.group == effect.group and each.kind.name in ("lag", "delay")
        ]
        if (
            effect.kind.name in SECOND_ORDER
            and len(pair) == 2
            and not any(clashes(each, rest) for each in pair)
        ):
            found.append(_start_pair(fitter, rest, values, (pair[0], pair[1])))
    return found


def _start_pair(
    fitter: Fitter, effects: Sequence[Effect], values: Values, pair: tuple[Effect, Effect]
) -> Start:
    """A pair of effects beside others, at the best of all pairs of their starts."""
    both = (*effects, *pair)
    one, two = (fitter.starts(effect).values for effect in pair)
    starts = [(*values, *start) for start in product(one, two)]
    return both, min(starts, key=lambda start: _misfit(fitter, both, start))


def start_merged(leader: Fit) -> list[Start]:
    """Start one lag or delay in the place of two: in a loop only their sum can be seen, and the
    data may be explained by either alone; parameters as of `start_in_series`."""
    found = []
    for effect, rest, values in leave_one_out(leader):
        if effect.kind.name not in LATE_BY_TIME:
            continue
        time = leader.values[leader.effects.index(effect)][0]
        for number, other in enumerate(rest):
            if other.kind.name in LATE_BY_TIME:
                both = ((values[number][0] + time),)
                found.append((rest, (*values[:number], both, *values[number + 1 :])))
    return found


def start_regular_instead(fitter: Fitter, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start each regular effect in the place of a rare one of its component, however unlike they
    are: what few machines have has to be compared with what all have; parameters as of
    `start_in_series`."""
    found: list[Start] = []
    for effect, rest, values in leave_one_out(leader):
        if not is_rare(effect):
            continue
        for other in candidates:
            if (
                other.group == effect.group
                and other.kind.name in REGULAR
                and other not in rest
                and not clashes(other, rest)
                and is_possible((*rest, other), fitter.plant)
            ):
                start = min(fitter.starts(other).values, key=lambda each: abs(each[0]))
                found.append(((*rest, other), (*values, start)))
    return found


def start_elsewhere(
    fitter: Fitter,
    leader: Fit,
    candidates: Sequence[Effect],
    known: Collection[frozenset[Effect]],
) -> list[Start]:
    """Start each effect in turn at every other component that may have it; parameters as of
    `start_in_series`."""
    found = []
    for number, effect in enumerate(leader.effects):
        kept = (*leader.effects[:number], *leader.effects[number + 1 :])
        for other in candidates:
            effects = (*leader.effects[:number], other, *leader.effects[number + 1 :])
            if (
                other != effect
                and other.kind == effect.kind
                and not clashes(other, kept)
                and is_possible(effects, fitter.plant)
                and frozenset(effects) not in known
            ):
                found.append((effects, leader.values))
    return found


def start_otherwise(fitter: Fitter, fit: Fit) -> list[Start]:
    """Start the effects of a fit at the best combinations of their own starts; none where there are
    too many."""
    starts = [fitter.starts(effect).values for effect in fit.effects]
    if math.prod(len(each) for each in starts) > COMBINATIONS:
        return []
    ranked = sorted(product(*starts), key=lambda values: _misfit(fitter, fit.effects, values))
    return [(fit.effects, values) for values in ranked[:FOLLOWED]]


def _misfit(fitter: Fitter, effects: Sequence[Effect], values: Values) -> float:
    plant = with_values(fitter.plant, effects, values)
    return fitter.space.misfit(fitter.evidence.residual(plant))
