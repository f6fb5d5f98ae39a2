"""Effects found one after another: the best explanation gets one more, as long as that explains
enough of what is left.

What is found first may only resemble what is there, so two leaders are followed: the best of all,
and the best with dry friction, without which a play, a spring or a Stribeck peak is nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product

from rigtwin.components import Effect, Guide
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import (
    Fit,
    Fitter,
    Values,
    clashes,
    is_possible,
    with_values,
    without_each,
)
from rigtwin.diagnosis.thresholds import STANDARD, NamingRules, Thresholds

CONTAINED = {"two_lags": "lag"}
"""Kind → the simpler one that it becomes at the end of its range."""
TRIED, SETTLED = 8, 3
"""Further effects that are fitted beside a leader, and those fitted again with the tolerances taken
at them."""
REPLACED = 6
"""Explanations with one effect replaced that are settled at most."""
GATEWAY = "coulomb"
"""Kind without which others do nothing."""
SECOND_ORDER = ("two_lags", "resonance")
"""Kinds that a lag and a delay may be taken for."""
BEHIND = ("compliance", "backlash")
"""Kinds that hide their gateway."""


def penalised_cost(fit: Fit, price: float) -> float:
    """χ² of a fit with a price on its parameters.

    Parameters
    ----------
    fit
        Of any effects.
    price
        χ² for each parameter.

    Returns
    -------
    float
        What explanations are ranked by, the least first.
    """
    return fit.misfit + price * sum(len(effect.kind.parameters) for effect in fit.effects)


def drop_needless(
    tried: Sequence[Fit], least: float, thresholds: Thresholds = STANDARD
) -> list[Fit]:
    """The fits less those in which a simpler effect would do as well.

    Parameters
    ----------
    tried
        Fits of any effects.
    least
        χ² by which the less simple one must do better.
    thresholds
        What figures are held against.

    Returns
    -------
    list of Fit
        Those that stay, in their order.
    """
    misfits = {frozenset((e.kind.name, e.group) for e in fit.effects): fit.misfit for fit in tried}
    most = max((fit.misfit for fit in tried), default=0.0)
    found = []
    for fit in tried:
        names = {(e.kind.name, e.group) for e in fit.effects}
        simpler = [
            frozenset((names - {(kind, group)}) | {(CONTAINED[kind], group)})
            for kind, group in names
            if kind in CONTAINED
        ]
        enough = max(least, thresholds.slight * (most - fit.misfit))
        if not any(other in misfits and misfits[other] - fit.misfit < enough for other in simpler):
            found.append(fit)
    return found


def within_tolerance(fit: Fit, evidence: Evidence, thresholds: Thresholds = STANDARD) -> bool:
    """Whether one of the effects is no more than its declared tolerance.

    Parameters
    ----------
    fit
        Of any effects.
    evidence
        That it was fitted to.
    thresholds
        What figures are held against.

    Returns
    -------
    bool
        True if it explains nothing but a tolerance.
    """
    return any(
        _is_tolerated(effect, values[0], evidence, thresholds.within_tolerance)
        for effect, values in zip(fit.effects, fit.values, strict=True)
    )


def _is_tolerated(effect: Effect, value: float, evidence: Evidence, widths: float) -> bool:
    """Whether a value is off nominal by at most so many tolerances."""
    parameter = effect.kind.parameters[0]
    tolerance = evidence.machine.tolerance_of(effect.group, parameter)
    if tolerance is None:
        return False
    width = evidence.width(tolerance)
    if tolerance.relative:
        width = tolerance.half_width * abs(effect.nominal(evidence.plant)[parameter])
    return abs(value - effect.nominal(evidence.plant)[parameter]) <= widths * width


Start = tuple[tuple[Effect, ...], Values]
"""Effects, and values to start from."""
MapFits = Callable[[Callable[..., Fit], Iterable[object]], list[Fit]]


@dataclass(frozen=True)
class Growth:
    """What a search needs. search, fitter: on coarse and on fine evidence; least: χ² of a
    finding; rules: when further effects are taken."""

    search: Fitter
    fitter: Fitter
    effects: Sequence[Effect]
    least: float
    rules: NamingRules
    thresholds: Thresholds

    def cost(self, fit: Fit) -> float:
        """What the fits are ranked by."""
        return penalised_cost(fit, self.thresholds.price)

    def drop_needless(self, fits: Sequence[Fit]) -> list[Fit]:
        """The fits less those in which a simpler effect would do as well."""
        return drop_needless(fits, self.least, self.thresholds)


def fit_stepwise(
    tried: Sequence[Fit], first: Fit, growth: Growth, map_fits: MapFits
) -> tuple[list[Fit], list[Fit]]:
    """Adds one effect after another to the best explanation, then replaces and removes each.

    Parameters
    ----------
    tried
        Fits of one and of two effects.
    first
        The best of one.
    growth
        What the search needs.
    map_fits
        Runs fits side by side.

    Returns
    -------
    two lists of Fit
        Further fits, and the chain of fits that leads to the best one.
    """
    found: list[Fit] = []
    before: dict[int, Fit] = {id(fit): first for fit in tried if len(fit.effects) == 2}
    level = sorted(
        growth.drop_needless([fit for fit in tried if len(fit.effects) == 2]), key=growth.cost
    )
    while level and len(level[0].effects) < growth.rules.most:
        following: list[Fit] = []
        for leader in _leaders(level):
            further = _extend(leader, growth, map_fits)
            before |= {id(fit): leader for fit in further}
            following += further
        found += following
        level = sorted(growth.drop_needless(following), key=growth.cost)
    best = min(growth.drop_needless([*tried, *found]), key=growth.cost)
    if len(best.effects) > 1:
        replaced = _replace_each(best, [*tried, *found], growth, map_fits)
        # One that came of another's chain is no step of its own.
        before |= {id(fit): before[id(best)] for fit in replaced if id(best) in before}
        found += replaced
        best = min(growth.drop_needless([best, *replaced]), key=growth.cost)
        for fit in _prune(best, growth):
            before[id(fit)] = best
            found.append(fit)
            best = fit
    chain = [best]
    while id(chain[0]) in before:
        chain.insert(0, before[id(chain[0])])
    return found, chain


def _leaders(level: Sequence[Fit]) -> list[Fit]:
    """The best, and the best with a gateway effect if it has none."""
    through = [fit for fit in level if any(effect.kind.name == GATEWAY for effect in fit.effects)]
    return list({id(fit): fit for fit in (level[0], *through[:1])}.values())


def _extend(leader: Fit, growth: Growth, map_fits: MapFits) -> list[Fit]:
    """Fits of one effect more that explain enough of what a leader leaves."""
    evidence = growth.fitter.evidence
    hopes = sorted(
        growth.search.propose_additions(leader, growth.effects, growth.least),
        key=lambda hope: hope.promised,
    )[:TRIED]
    found = map_fits(
        lambda hope: growth.search.refine(hope.effects, hope.values, hope.space), hopes
    )
    found += map_fits(
        lambda start: growth.search.refine(*start),
        [*_gateway_starts(leader, growth), *_unfold(leader, growth)],
    )
    found = map_fits(growth.fitter.refit_with_tolerances, sorted(found, key=growth.cost)[:SETTLED])
    # What the noise of a measured motion makes of friction at its reversals is no further effect.
    left = max(leader.misfit - evidence.expected_misfit(leader.plant), 0.0)
    enough = max(growth.thresholds.second * growth.least, growth.rules.more * left)
    accepted = []
    for fit in found:
        further = len(fit.effects) - len(leader.effects)
        if leader.misfit - fit.misfit > further * enough and not within_tolerance(
            fit, evidence, growth.thresholds
        ):
            accepted.append(fit)
    return accepted


def _gateway_starts(leader: Fit, growth: Growth) -> list[Start]:
    """Starts for a gateway and what acts through it at once: friction behind a soft spring hardly
    resembles friction alone."""
    search, found = growth.search, []
    for gate in growth.effects:
        if gate.kind.name != GATEWAY or gate.of is not Guide or clashes(gate, leader.effects):
            continue
        for other in growth.effects:
            if (
                other.group != gate.group
                or other.kind.name not in BEHIND
                or len(leader.effects) + 2 > growth.rules.most
            ):
                continue
            found.append(_pair_start(search, leader.effects, leader.values, (gate, other)))
    return found


def _pair_start(
    search: Fitter, effects: Sequence[Effect], values: Values, pair: tuple[Effect, Effect]
) -> Start:
    """A pair of effects beside others, with the best of all pairs of their starts."""
    both = (*effects, *pair)
    one, two = (search.starts(effect).values for effect in pair)
    starts = [(*values, *start) for start in product(one, two)]
    residuals = (
        search.evidence.residual(with_values(search.plant, both, start)) for start in starts
    )
    return both, min(
        (search.space.misfit(residual), start)
        for residual, start in zip(residuals, starts, strict=True)
    )[1]


def _unfold(leader: Fit, growth: Growth) -> list[Start]:
    """Starts with a lag and a delay where the leader has one effect of second order: at low
    frequencies they are alike."""
    found = []
    for effect, rest, values in without_each(leader):
        pair = [
            each
            for each in growth.effects
            if each.group == effect.group and each.kind.name in ("lag", "delay")
        ]
        if (
            effect.kind.name in SECOND_ORDER
            and len(pair) == 2
            and not any(clashes(each, rest) for each in pair)
        ):
            found.append(_pair_start(growth.search, rest, values, (pair[0], pair[1])))
    return found


def _prune(best: Fit, growth: Growth) -> list[Fit]:
    """The fit with one effect after another taken out that explains nothing any more, now that the
    others are there."""
    found: list[Fit] = []
    while len(best.effects) > 1:
        fewer = [
            (rest, values)
            for _, rest, values in without_each(best)
            if is_possible(rest, growth.fitter.plant)
        ]
        tries = [growth.fitter.refine(*each) for each in fewer]
        simpler = min(tries, key=growth.cost, default=best)
        if simpler is best or simpler.misfit - best.misfit > growth.least:
            break
        best = growth.fitter.refit_with_tolerances(simpler)
        found.append(best)
    return found


def _replace_each(best: Fit, tried: Sequence[Fit], growth: Growth, map_fits: MapFits) -> list[Fit]:
    """What may stand in each effect's place, now that the others are known."""
    known = {frozenset(fit.effects) for fit in tried}
    alike = [
        pair
        for pair in growth.search.propose_replacements(best, growth.effects)
        if frozenset(pair[0]) not in known
    ]
    others = sorted(map_fits(lambda pair: growth.search.refine(*pair), alike), key=growth.cost)
    far = best.misfit + growth.thresholds.near * max(
        growth.fitter.nothing.misfit - best.misfit, 0.0
    )
    return map_fits(
        growth.fitter.refit_with_tolerances, [fit for fit in others[:REPLACED] if fit.misfit < far]
    )
