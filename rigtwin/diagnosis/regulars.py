"""Sets of effects that nearly every machine has: friction, mass, stiffness, offsets.

They are fitted together, and then one after another is left out, because an effect that is found
alone may stand for several of them at once.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.components import Effect, Guide, measures
from rigtwin.diagnosis.balance import balance_forces
from rigtwin.diagnosis.fit import Fit, Values
from rigtwin.diagnosis.fitter import Fitter, Screened
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.starts import GATEWAY, REGULAR, Start
from rigtwin.diagnosis.threads import Threads

GATEWAY_STARTS = 3
"""Sizes of the gateway from which regular effects are fitted together."""
FEW_REGULAR = 6
"""Regular effects up to which all of these sizes are tried."""
ELIMINATED = 4
"""Sets that are fitted of those from which one regular effect after another was left out."""


def start_balanced(fitter: Fitter, effects: Sequence[Effect]) -> list[Start]:
    """Start effects at the values with which the forces along the measured motion balance.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    effects
        Effects of one parameter each.

    Returns
    -------
    list of Start
        One start; none where no joint goes by itself.
    """
    balanced = balance_forces(fitter, effects)
    return [] if balanced is None else [(tuple(effects), balanced)]


def choose_regulars(
    effects: Sequence[Effect], screened: Sequence[Screened], worth: float
) -> tuple[Effect, ...]:
    """Choose the regular effects that promise anything, at every component that can have them.

    Parameters
    ----------
    effects
        Candidates.
    screened
        What each of them promises.
    worth
        Chi-square that an effect other than dry friction must promise.

    Returns
    -------
    tuple of Effect
        One of each kind, or one of each kind at each guide where joints are coupled.
    """
    promise = {each.effect: each.promise for each in screened}
    coupled = len({effect.group for effect in effects if effect.of is Guide}) > 1
    chosen: dict[tuple[str, str], Effect] = {}
    for effect in effects:
        name = effect.kind.name
        if measures(effect.of()):
            continue
        if name in REGULAR and (promise[effect] > worth or name == GATEWAY):
            at = effect.group if coupled and effect.of is Guide else ""
            chosen.setdefault((name, at), effect)
    return tuple(chosen.values())


def fit_together(
    fitter: Fitter, chosen: tuple[Effect, ...], price: float, threads: Threads
) -> tuple[Fit, list[Start]]:
    """Fit all chosen effects together, and start sets of fewer of them.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    chosen
        Effects that are fitted together.
    price
        Chi-square that each effect should gain.
    threads
        Threads that fit side by side.

    Returns
    -------
    tuple
        The fit of all, and starts of the sets that remain when the effect that is missed least is
        left out again and again.
    """

    def start_of(effect: Effect, number: int) -> tuple[float, ...]:
        if effect.kind.name != GATEWAY:
            return tuple(effect.nominal(fitter.plant).values())
        values = [value for value in fitter.starts(effect).values if value[0] > 0.0]
        return values[min(number, len(values) - 1)]

    count = GATEWAY_STARTS if len(chosen) <= FEW_REGULAR else 1
    starts: list[Values] = [
        tuple(start_of(effect, number) for effect in chosen) for number in range(count)
    ]
    starts += [values for _, values in start_balanced(fitter, chosen)]
    tries = threads.map(lambda values: fitter.refine(chosen, values), starts)
    whole = min(tries, key=lambda fit: fit.misfit)
    path = sorted(
        Linearised(fitter, whole).eliminate(), key=lambda each: each[0] + price * len(each[1])
    )
    reduced = [(effects, values) for _, effects, values in path[:ELIMINATED]]
    balanced = [start for effects, _ in reduced for start in start_balanced(fitter, effects)]
    return whole, [*balanced, *reduced]
