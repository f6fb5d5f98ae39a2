"""Values of effects that somebody already suspects, without a search for others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.library import find
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.balance import balance_forces
from rigtwin.diagnosis.effect_fit import EffectFit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, clashes, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import SUFFICIENT_MISFIT
from rigtwin.diagnosis.known_effects_covariance import (
    TIED,
    find_covariance,
    find_doubts,
    list_parameters,
    relative_errors_of,
)
from rigtwin.diagnosis.minima import leave_minimum
from rigtwin.diagnosis.tolerance_refit import PERTURBATIONS, refit_with_tolerances
from rigtwin.errors import RigtwinError

SHARES = (1.0, 0.3)
"""Shares of the effects' separate values from which they are fitted together."""
LINEAR = ("coulomb", "viscous", "offset", "stiffness", "mass", "armature")
"""Kinds of one parameter in which the forces along a given motion are linear."""


def find_effects(machine: Machine, names: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects of these names.

    Raises
    ------
    RigtwinError
        For an unknown name, or two that set one parameter.
    """
    # A description may limit what a search tries. Whoever names an effect wants it fitted.
    chosen: list[Effect] = []
    for name in names:
        effect = find(name, machine.plant)
        if clashes(effect, chosen):
            raise RigtwinError(
                f"{name} changes a parameter that another effect of {', '.join(names)} changes too"
            )
        chosen.append(effect)
    return tuple(chosen)


def fit_effects(
    evidence: Evidence,
    effects: Sequence[Effect],
    held_out: Evidence | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> EffectFit:
    """Fit effects together.

    The values minimise the whitened residual's χ² with all declared tolerances free beside them
    (Gauss-Newton). Each start comes from the effects' separate fits, so that a poor local optimum
    shows as a disagreement.

    Parameters
    ----------
    evidence
        Recordings, about their nominal plant.
    effects
        Effects to fit.
    held_out
        Recordings that the values are judged on and not fitted to.
    progress
        Called with 1 after each fit.

    Returns
    -------
    EffectFit
        Values, intervals, and how well they explain the data.

    Raises
    ------
    RigtwinError
        For no effect, or one that cannot act on this machine together with the others.
    """
    effects = tuple(effects)
    _require_possible(evidence, effects)
    exact = Fitter(evidence)
    fit, optima = _fit_jointly(exact, effects, progress)
    covariance = find_covariance(exact, fit)
    parameters = list_parameters(evidence.machine, fit, covariance)
    plant = with_values(evidence.plant, effects, fit.values)
    return EffectFit(
        effects=effects,
        values=fit.values,
        parameters=parameters,
        covariance=covariance,
        error_before=relative_errors_of(evidence, evidence.plant),
        error_after=relative_errors_of(evidence, plant),
        held_out_before=relative_errors_of(held_out, evidence.plant),
        held_out_after=relative_errors_of(held_out, plant),
        warnings=tuple(find_doubts(exact, fit, parameters, covariance, optima)),
        machine=replace(evidence.machine, plant=plant),
        described=evidence.machine,
        evidence=evidence,
        held_out=held_out,
    )


def _fit_jointly(
    exact: Fitter, effects: tuple[Effect, ...], progress: Callable[[int], object]
) -> tuple[Fit, list[Fit]]:
    """Fit effects on coarse evidence from several starts, and the best optimum on all of it.

    Returns the precise fit, and the coarse optima, the best first.
    """
    evidence = exact.evidence
    thinned = evidence.thin().halve_steps()
    # A model that integrates nothing has nothing coarser.
    coarse = exact if thinned.models == evidence.models else Fitter(thinned)
    optima = _find_optima(coarse, effects, progress)
    # Asked before sorting: the first start is the one that the others are compared with.
    settled = _is_settled(coarse, optima)
    optima.sort(key=lambda fit: fit.misfit)
    optima[0] = leave_minimum(coarse, optima[0])
    # A settled optimum needs no further starts nearby.
    fit = refit_with_tolerances(exact, optima[0], () if settled else PERTURBATIONS)
    progress(1)
    return fit, optima


def _require_possible(evidence: Evidence, effects: tuple[Effect, ...]) -> None:
    """Raise RigtwinError unless there are effects, and each has what it acts through."""
    if not effects:
        possible = ", ".join(effect.name for effect in evidence.machine.effects())
        raise RigtwinError(f"no effect to fit; expected some of {possible}")
    if not is_possible(effects, evidence.plant):
        names = ", ".join(effect.name for effect in effects)
        raise RigtwinError(
            f"{names}: an effect lacks what it acts through, as play lacks dry friction"
        )


def _find_optima(
    fitter: Fitter, effects: tuple[Effect, ...], progress: Callable[[int], object]
) -> list[Fit]:
    """Fit from one start after another, until no further start can find another optimum."""
    optima: list[Fit] = []
    for start in _list_starts(fitter, effects, progress):
        optima.append(fitter.refine(effects, start))
        progress(1)
        if _is_settled(fitter, optima):
            break
    return optima


def _list_starts(
    fitter: Fitter, effects: tuple[Effect, ...], progress: Callable[[int], object]
) -> list[list[tuple[float, ...]]]:
    """Return starts of the joint fit.

    Where forces are linear in all parameters, one linear least-squares solution lies near the
    optimum, and a second start tells whether it is the only one. Otherwise the effects are fitted
    alone: shares of these fits, and one effect after another.
    """
    if all(effect.kind.name in LINEAR for effect in effects):
        return _start_linear(fitter, effects)
    alone: dict[Effect, Fit] = {}
    for effect in effects:
        # A refinement of friction does nothing by itself: it starts at its own first size.
        if is_possible((effect,), fitter.plant):
            alone[effect] = fitter.fit_one(fitter.screen(effect))
            progress(1)
    values = [
        alone[effect].values[0] if effect in alone else fitter.starts(effect).values[0]
        for effect in effects
    ]
    starts = [
        [
            fitter.scale_start(effect, value, share)[0]
            for effect, value in zip(effects, values, strict=True)
        ]
        for share in SHARES
    ]
    if len(alone) > 1:
        starts.append(_start_in_turn(fitter, effects, alone, values))
    # `fit_one` has refined a single effect from all its starts already.
    return starts if len(effects) > 1 else starts[:1]


def _is_settled(fitter: Fitter, optima: Sequence[Fit]) -> bool:
    """Return whether no further start can find another optimum of effects with linear forces.

    The first fit leaves no more than noise, or all fits agree. Where the model leaves more than
    noise, the rest counts as noise.
    """
    first, expected = optima[0], fitter.evidence.expected
    if any(effect.kind.name not in LINEAR for effect in first.effects):
        return False
    # No other optimum can be better by more than noise.
    if first.misfit < SUFFICIENT_MISFIT * expected:
        return True
    excess = max(first.misfit / expected, 1.0)
    return len(optima) > 1 and all(
        abs(rival.misfit - first.misfit) < TIED * excess
        and np.all(np.abs(np.subtract(a, b)) <= np.sqrt(excess) * np.asarray(width))
        for rival in optima[1:]
        for a, b, width in zip(first.values, rival.values, first.widths, strict=True)
    )


def _start_linear(fitter: Fitter, effects: tuple[Effect, ...]) -> list[list[tuple[float, ...]]]:
    """Return two starts of effects in which forces are linear.

    The first is the least-squares solution of the balance of forces, or of the prediction's
    residual where no balance can be formed: a Gauss-Newton step from there is the same solution.
    """
    small = [
        fitter.scale_start(effect, fitter.starts(effect).values[0], SHARES[-1])[0]
        for effect in effects
    ]
    balanced = balance_forces(fitter, effects)
    if balanced is None:
        return [[tuple(effect.nominal(fitter.plant).values()) for effect in effects], small]
    return [list(balanced), small]


def _start_in_turn(
    fitter: Fitter,
    effects: tuple[Effect, ...],
    alone: dict[Effect, Fit],
    values: list[tuple[float, ...]],
) -> list[tuple[float, ...]]:
    """Return the fit that adds one effect after another, the one that explains most first."""
    # Small starts of the later effects leave most of the data to the effect that explained most by
    # itself.
    order = sorted(alone, key=lambda effect: alone[effect].misfit)
    fit = alone[order[0]]
    for effect in order[1:]:
        small = fitter.scale_start(effect, values[effects.index(effect)], SHARES[-1])
        chosen = (*fit.effects, effect)
        if is_possible(chosen, fitter.plant):
            fit = fitter.refine(chosen, [*fit.values, *small])
    fitted = dict(zip(fit.effects, fit.values, strict=True))
    return [fitted.get(e, value) for e, value in zip(effects, values, strict=True)]
