"""Regular effects, which nearly every machine has: friction, mass, stiffness, offsets.

They are fitted together, and then left out one after another. A stepwise search alone may stop at a
single effect that resembles several regular effects at once.
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
"""Number of sizes of dry friction from which regular effects are fitted together."""
FEW_REGULAR = 6
"""Largest number of regular effects for which all of these sizes are tried."""
ELIMINATED = 4
"""Number of reduced sets of regular effects that are fitted."""


def start_balanced(fitter: Fitter, effects: Sequence[Effect]) -> list[Start]:
    """Start effects at the values with which the forces along the measured motion balance.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    effects
        Effects with a single parameter.

    Returns
    -------
    list of Start
        A single start. Empty where no joint moves freely.
    """
    balanced = balance_forces(fitter, effects)
    return [] if balanced is None else [(tuple(effects), balanced)]


def choose_regulars(
    effects: Sequence[Effect], screened: Sequence[Screened], least: float
) -> tuple[Effect, ...]:
    """Choose the regular effects that promise to explain something.

    Parameters
    ----------
    effects
        Candidate effects.
    screened
        Screened candidates with their promises.
    least
        Chi-square that an effect other than dry friction must promise.

    Returns
    -------
    tuple of Effect
        One effect of each kind. Where joints are coupled, one of each kind at each guide.
    """
    promise = {entry.effect: entry.promise for entry in screened}
    coupled = len({effect.group for effect in effects if effect.of is Guide}) > 1
    chosen: dict[tuple[str, str], Effect] = {}
    for effect in effects:
        name = effect.kind.name
        if measures(effect.of()):
            continue
        # Dry friction is always chosen: springs and plays in series with it need it.
        if name in REGULAR and (promise[effect] > least or name == GATEWAY):
            place = effect.group if coupled and effect.of is Guide else ""
            chosen.setdefault((name, place), effect)
    return tuple(chosen.values())


def fit_together(
    fitter: Fitter, chosen: tuple[Effect, ...], price: float, threads: Threads
) -> tuple[Fit, list[Start]]:
    """Fit all chosen effects together, and start subsets of them.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    chosen
        Effects fitted jointly.
    price
        Chi-square that an effect should gain.
    threads
        Threads that fit in parallel.

    Returns
    -------
    tuple
        Joint fit, and starts of the subsets that remain when the effect of least gain is left out
        repeatedly.
    """

    def choose_start(effect: Effect, number: int) -> tuple[float, ...]:
        # Only the size of dry friction is varied: its response is the least linear one.
        if effect.kind.name != GATEWAY:
            return tuple(effect.nominal(fitter.plant).values())
        values = [value for value in fitter.starts(effect).values if value[0] > 0.0]
        return values[min(number, len(values) - 1)]

    # Every joint fit of many effects is slow, so only one size is tried.
    count = GATEWAY_STARTS if len(chosen) <= FEW_REGULAR else 1
    starts: list[Values] = [
        tuple(choose_start(effect, number) for effect in chosen) for number in range(count)
    ]
    starts += [values for _, values in start_balanced(fitter, chosen)]
    tries = threads.map(lambda values: fitter.refine(chosen, values), starts)
    whole = min(tries, key=lambda fit: fit.misfit)
    # The linearised fit is precise enough to rank the subsets: misfit plus price per effect.
    subsets = sorted(
        Linearised(fitter, whole).eliminate(),
        key=lambda subset: subset[0] + price * len(subset[1]),
    )
    reduced = [(effects, values) for _, effects, values in subsets[:ELIMINATED]]
    balanced = [start for effects, _ in reduced for start in start_balanced(fitter, effects)]
    return whole, [*balanced, *reduced]
