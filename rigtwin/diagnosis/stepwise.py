"""Effects found one after another: the best explanations get one more, as long as that explains
enough of what is left.

What is found first may only resemble what is there, so several leaders are followed: the best, and
the best with dry friction, without which a play, a spring or a Stribeck peak is nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from rigtwin.components import Effect, Guide
from rigtwin.description.machine import Structure
from rigtwin.diagnosis.balance import balance_forces
from rigtwin.diagnosis.fit import Fit, Values, clashes, with_values, without_each
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.held_out_judge import HeldOutJudge
from rigtwin.diagnosis.proposals import propose_additions
from rigtwin.diagnosis.ranking import drop_needless, penalised_cost, within_tolerance
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import NamingRules, Thresholds

TRIED, SETTLED = 4, 2
"""Further effects that are fitted beside a leader, and those fitted again with the tolerances taken
at them."""
FIRST, LEADERS = 4, 2
"""Single effects that get one more, and explanations of any greater number."""
PATIENCE = 2
"""Effects that may be added without a gain on what is held out."""
BEHIND_BEST = 0.5
"""Share of what the best explains that another leader may lack."""
REGULAR = ("coulomb", "viscous", "stiffness", "mass", "offset")
"""Kinds that nearly every machine has more or less of."""
GATEWAY_STARTS = 3
"""Sizes of the gateway that they are fitted together from."""
GATEWAY = "coulomb"
"""Kind without which others do nothing."""
LEAST_MISSED = 2
"""Effects that are left out in turn of several, those that would be missed least."""
SECOND_ORDER = ("two_lags", "resonance")
"""Kinds that a lag and a delay may be taken for."""
BEHIND = ("compliance", "backlash")
"""Kinds that hide their gateway."""
Start = tuple[tuple[Effect, ...], Values]
"""Effects, and values to start from."""


@dataclass(frozen=True)
class Growth:
    """What a search needs. search: on coarse evidence; judge: of fits to fine evidence; least: χ²
    of a finding."""

    search: Fitter
    judge: HeldOutJudge
    effects: Sequence[Effect]
    least: float
    thresholds: Thresholds

    @property
    def rules(self) -> NamingRules:
        """When further effects are taken."""
        return self.thresholds.rough

    @property
    def fitter(self) -> Fitter:
        """On fine evidence."""
        return self.judge.fitter

    def cost(self, fit: Fit) -> float:
        """What the fits are ranked by."""
        return penalised_cost(fit, self.thresholds.price)

    def drop_needless(self, fits: Sequence[Fit]) -> list[Fit]:
        """The fits less those in which a simpler effect would do as well."""
        return drop_needless(fits, self.least, self.thresholds)

    def leaves_noise(self, fits: Sequence[Fit]) -> bool:
        """Whether one of them, with a parameter an effect, leaves less than any further effect must
        explain: then nothing as simple remains to be tried."""
        enough = self.thresholds.second * self.least
        expected = self.fitter.evidence.expected_misfit
        return any(
            _count_parameters(fit) == len(fit.effects) and fit.misfit - expected(fit.plant) < enough
            for fit in fits
        )


def fit_stepwise(singles: Sequence[Fit], growth: Growth, threads: Threads) -> list[Fit]:
    """Adds one effect after another to the best explanations.

    Parameters
    ----------
    singles
        Fits of one effect.
    growth
        What the search needs.
    threads
        Runs fits side by side.

    Returns
    -------
    list of Fit
        Of two effects and more.
    """
    level = sorted(growth.drop_needless(singles), key=growth.cost)
    found = [] if growth.leaves_noise(level) else _fit_regulars(growth, threads)
    costs: list[float] = []
    while level and not growth.leaves_noise(level):
        costs.append(min(threads.spread(growth.judge.cost, level[:LEADERS])))
        if len(costs) > PATIENCE and min(costs[-PATIENCE:]) >= min(costs[:-PATIENCE]):
            # What is held out asks for no more.
            break
        following: list[Fit] = []
        for leader in _leaders(level, growth.fitter.nothing.misfit):
            if len(leader.effects) < growth.rules.most:
                following += _extend(leader, growth, threads)
        found += following
        level = sorted(growth.drop_needless(following), key=growth.cost)
    return found


def _fit_regulars(growth: Growth, threads: Threads) -> list[Fit]:
    """What nearly every machine has, all of it together, and then without one after another: what
    is found in turn may stand for several of them at once."""
    chosen = _choose_regulars(growth)
    if len(chosen) < 2:
        return []
    search = growth.search

    def start_of(effect: Effect, number: int) -> tuple[float, ...]:
        if effect.kind.name != GATEWAY:
            return tuple(effect.nominal(growth.search.plant).values())
        values = [v for v in search.starts(effect).values if v[0] > 0.0]
        return values[min(number, len(values) - 1)]

    starts = [
        tuple(start_of(effect, number) for effect in chosen) for number in range(GATEWAY_STARTS)
    ]
    if (balanced := balance_forces(search, chosen)) is not None:
        starts.append(balanced)
    tries = threads.map(lambda values: search.refine(tuple(chosen), values), starts)
    found = [min(tries, key=growth.cost)]
    while len(found[-1].effects) > 1:
        fewer = search.predict_without(found[-1])[:LEAST_MISSED]
        found.append(
            min(threads.map(lambda each: search.refine(*each[1:]), fewer), key=growth.cost)
        )
    return [fit for fit in found if not within_tolerance(fit, search.evidence, growth.thresholds)]


def _choose_regulars(growth: Growth) -> list[Effect]:
    """The regular effects: one of each kind, and where joints act on each other each at every
    guide, as any of them moves all."""
    coupled = growth.fitter.evidence.machine.structure is Structure.COUPLED
    chosen: dict[object, Effect] = {}
    for effect in growth.effects:
        if effect.kind.name in REGULAR:
            at = effect.group if coupled and effect.of is Guide else ""
            chosen.setdefault((effect.kind, at), effect)
    return list(chosen.values())


def _leaders(level: Sequence[Fit], nothing: float) -> list[Fit]:
    """The best of different effects, and the best with a gateway effect if none of them has it.
    nothing: misfit without effects."""
    distinct = list({frozenset(fit.effects): fit for fit in reversed(level)}.values())[::-1]
    best = distinct[0].misfit
    distinct = [fit for fit in distinct if fit.misfit - best <= BEHIND_BEST * (nothing - best)]
    through = [fit for fit in level if any(effect.kind.name == GATEWAY for effect in fit.effects)]
    return list(
        {
            id(fit): fit
            for fit in (
                *distinct[: FIRST if len(distinct[0].effects) == 1 else LEADERS],
                *through[:1],
            )
        }.values()
    )


def _extend(leader: Fit, growth: Growth, threads: Threads) -> list[Fit]:
    """Fits of one effect more that explain enough of what a leader leaves."""
    evidence = growth.fitter.evidence
    hopes = sorted(
        propose_additions(growth.search, leader, growth.effects, growth.least, threads),
        key=lambda hope: hope.promised,
    )[:TRIED]
    found = threads.map(
        lambda hope: growth.search.refine(hope.effects, hope.values, hope.space), hopes
    )
    found += threads.map(
        lambda start: growth.search.refine(*start),
        [*_gateway_starts(leader, growth), *_unfold(leader, growth)],
    )
    found = threads.map(growth.fitter.settle, sorted(found, key=growth.cost)[:SETTLED])
    # What the noise of a measured motion makes of friction at its reversals is no further effect.
    left = max(leader.misfit - evidence.expected_misfit(leader.plant), 0.0)
    enough = max(growth.thresholds.second * growth.least, growth.rules.more * left)
    accepted = []
    for fit in found:
        further = _count_parameters(fit) - _count_parameters(leader)
        if leader.misfit - fit.misfit > further * enough and not within_tolerance(
            fit, evidence, growth.thresholds
        ):
            accepted.append(fit)
    return accepted


def _count_parameters(fit: Fit) -> int:
    return sum(len(effect.kind.parameters) for effect in fit.effects)


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
