"""Starts of fits that a search would not reach by adding one effect after another.

A start is a set of effects and their values. Each function of this module adds starts for one
reason why the stepwise search fails: effects in series, effects of second order, rare effects, the
same kind at another component, and several minima of the misfit.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import combinations, product

from rigtwin.components import Effect, Guide, Schedule
from rigtwin.diagnosis.fit import Fit, Values, clashes, is_possible, leave_one_out, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.prices import is_rare

Start = tuple[tuple[Effect, ...], Values]
"""Effects, and the values from which they are fitted."""
REGULAR = ("coulomb", "viscous", "stiffness", "mass", "armature", "offset")
"""Kinds that nearly every machine has to some degree."""
GATEWAY = "coulomb"
"""Kind without which a play, a spring or a Stribeck peak in series has no response."""
LATE_BY_TIME = ("lag", "delay")
"""Kinds with a single parameter, the delay of a signal."""
IN_SERIES = ("compliance", "backlash")
"""Kinds that hide dry friction in series with them."""
UNFOLDED = {
    "two_lags": LATE_BY_TIME,
    "resonance": LATE_BY_TIME,
    "end_stops": ("stiffness", "position_force"),
}
"""Kinds that two others together resemble. At low frequencies a lag and a delay resemble an effect
of second order. A spring that hardens resembles stops at its ends."""
COMBINATIONS = 150
"""Largest number of combinations of starts that are simulated for one hypothesis."""
REFINED = 2
"""Number of these combinations that are fitted."""


def start_in_series(
    fitter: Fitter,
    leader: Fit,
    candidates: Sequence[Effect],
    known: Collection[frozenset[Effect]],
) -> list[Start]:
    """Start pairs of dry friction and a spring or play in series with it.

    The response to friction behind a soft spring differs from that to friction alone, and so does
    that to a play behind a spring. Therefore both values of a pair are varied together.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit to which the pair is added.
    candidates
        Candidate effects.
    known
        Sets of effects that are already scored.

    Returns
    -------
    list of pairs
        Effects, and the best combination of the pair's starts.
    """
    starts = []
    gates = [effect for effect in candidates if effect.kind.name == GATEWAY and effect.of is Guide]
    for gate in gates:
        # Pairs of the three: friction with a spring, friction with a play, and a play with a
        # spring.
        series = [gate] + [
            effect
            for effect in candidates
            if effect.group == gate.group and effect.kind.name in IN_SERIES
        ]
        for pair in combinations(series, 2):
            fitted = [
                (effect, values)
                for effect, values in zip(leader.effects, leader.values, strict=True)
                if effect not in pair
            ]
            remaining = tuple(effect for effect, _ in fitted)
            # A spring or play without dry friction has no response.
            has_friction = gate in pair or gate in remaining
            if (
                has_friction
                and frozenset((*remaining, *pair)) not in known
                and not any(clashes(effect, remaining) for effect in pair)
            ):
                values = tuple(values for _, values in fitted)
                starts.append(_start_pair(fitter, remaining, values, pair))
    return starts


def start_with_base(fitter: Fitter, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start a force that follows a channel together with the part of it that does not.

    A channel such as a temperature is far from zero throughout. In proportion to it alone, a force
    resembles one that follows nothing.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit to which the pair is added.
    candidates
        Candidate effects.

    Returns
    -------
    list of pairs
        Effects, and the best combination of the pair's starts.
    """
    components = fitter.evidence.machine.components
    following = [effect for effect in candidates if effect.of is Schedule]
    pairs = [
        (base, follower)
        for follower in following
        for base in candidates
        if base.of is Guide
        and base.kind.name == follower.kind.name
        and components[base.group].acts_on == components[follower.group].acts_on
    ]
    return [
        _start_pair(fitter, leader.effects, leader.values, pair)
        for pair in pairs
        if not any(effect in leader.effects or clashes(effect, leader.effects) for effect in pair)
    ]


def start_unfolded(fitter: Fitter, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start two effects in the place of one that they resemble together.

    The first effect of a hypothesis is the one that explains most alone, and neither of the two
    may explain as much.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit whose effects are replaced in turn.
    candidates
        Candidate effects.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    starts = []
    for effect, remaining, values in leave_one_out(leader):
        pair = [
            candidate
            for candidate in candidates
            if candidate.group == effect.group
            and candidate.kind.name in UNFOLDED.get(effect.kind.name, ())
        ]
        if (
            len(pair) == 2
            and not any(candidate in remaining for candidate in pair)
            and not any(clashes(candidate, remaining) for candidate in pair)
        ):
            starts.append(_start_pair(fitter, remaining, values, (pair[0], pair[1])))
    return starts


def _start_pair(
    fitter: Fitter, effects: Sequence[Effect], values: Values, pair: tuple[Effect, Effect]
) -> Start:
    """Start a pair of effects beside others at the best combination of the pair's starts."""
    both = (*effects, *pair)
    first, second = (fitter.starts(effect).values for effect in pair)
    starts = [(*values, *start) for start in product(first, second)]
    # The combinations are only simulated. The best one is fitted by the search.
    return both, min(starts, key=lambda start: _misfit(fitter, both, start))


def are_late_twins(one: Sequence[Effect], other: Sequence[Effect]) -> bool:
    """Return whether two hypotheses differ only by a delay in the place of a lag.

    Both resemble each other so closely that only further effects show which of them is present.

    Parameters
    ----------
    one, other
        Effects of the hypotheses.
    """
    differences = set(one) ^ set(other)
    late = {effect.kind.name for effect in differences} == {*LATE_BY_TIME}
    return late and len(differences) == 2 and len({effect.group for effect in differences}) == 1


def start_regular_instead(fitter: Fitter, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start each regular effect in the place of a rare effect of the same component.

    A rare effect must be compared with the regular ones even if their responses differ.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit whose rare effects are replaced.
    candidates
        Candidate effects.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    starts: list[Start] = []
    for effect, remaining, values in leave_one_out(leader):
        if not is_rare(effect):
            continue
        for candidate in candidates:
            if (
                candidate.group == effect.group
                and candidate.kind.name in REGULAR
                and candidate not in remaining
                and not clashes(candidate, remaining)
                and is_possible((*remaining, candidate), fitter.plant)
            ):
                # The smallest start disturbs the fitted values least.
                start = min(fitter.starts(candidate).values, key=lambda start: abs(start[0]))
                starts.append(((*remaining, candidate), (*values, start)))
    return starts


def start_elsewhere(
    fitter: Fitter,
    leader: Fit,
    candidates: Sequence[Effect],
    known: Collection[frozenset[Effect]],
) -> list[Start]:
    """Start each effect in turn at every other component that may have it.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    leader
        Fit whose effects are moved in turn.
    candidates
        Candidate effects.
    known
        Sets of effects that are already scored.

    Returns
    -------
    list of pairs
        Effects, and the values of the leader.
    """
    starts = []
    for number, (effect, remaining, _) in enumerate(leave_one_out(leader)):
        for candidate in candidates:
            effects = (*leader.effects[:number], candidate, *leader.effects[number + 1 :])
            if (
                candidate != effect
                and candidate.kind == effect.kind
                and not clashes(candidate, remaining)
                and is_possible(effects, fitter.plant)
                and frozenset(effects) not in known
            ):
                # Effects of one kind have the same parameters, so the values serve at the other
                # component as well.
                starts.append((effects, leader.values))
    return starts


def start_otherwise(fitter: Fitter, fit: Fit) -> list[Start]:
    """Start the effects of a fit at the best combinations of their single starts.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit whose effects are started again.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted. Empty where there are too many
        combinations.
    """
    starts = [fitter.starts(effect).values for effect in fit.effects]
    # The number of combinations grows exponentially with that of the effects.
    if math.prod(len(values) for values in starts) > COMBINATIONS:
        return []
    ranked = sorted(product(*starts), key=lambda values: _misfit(fitter, fit.effects, values))
    return [(fit.effects, values) for values in ranked[:REFINED]]


def _misfit(fitter: Fitter, effects: Sequence[Effect], values: Values) -> float:
    """Return the misfit of effects with given values, without fitting them."""
    plant = with_values(fitter.plant, effects, values)
    return fitter.space.misfit(fitter.evidence.residual(plant))
