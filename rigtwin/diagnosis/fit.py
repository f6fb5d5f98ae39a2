"""Fitted effects: the values that explain some evidence best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.components import Effect, Guide
from rigtwin.components.guide_effects import THROUGH_FRICTION
from rigtwin.components.plant import P, Plant, parameter_of, with_parameters
from rigtwin.numerics.arrays import Array

Values = tuple[tuple[float, ...], ...]
"""Values of several effects: one tuple per effect, in the order of its kind's parameters."""


@dataclass(frozen=True)
class Fit:
    """Effects with the values that explain the evidence best.

    Attributes
    ----------
    effects
        Fitted effects.
    values
        Values of each effect, in the units of its parameters.
    misfit
        Chi-square of the residual, profiled over the tolerances with their prior.
    widths
        Standard deviation of each value.
    plant
        Nominal plant with the fitted effects.
    base
        Nominal plant with its mechanical tolerances moved by `used`. None where the tolerances were
        not estimated at the fit.
    used
        Displacement of each mechanical tolerance in `base`, in half widths.
    """

    effects: tuple[Effect, ...]
    values: Values
    misfit: float
    widths: Values
    plant: Plant = field(repr=False)
    base: Plant | None = field(default=None, repr=False, compare=False)
    used: tuple[float, ...] = field(default=(), repr=False, compare=False)

    @property
    def name(self) -> str:
        """Names of the effects, joined by a plus sign."""
        return " + ".join(effect.name for effect in self.effects) or "none"


def split_values(effects: Sequence[Effect], vector: Array) -> Values:
    """Cut a vector of all parameters, shape (parameters,), into the values of each effect."""
    cuts = np.cumsum([len(effect.kind.parameters) for effect in effects])[:-1]
    return tuple(tuple(part.tolist()) for part in np.split(vector, cuts)) if effects else ()


def with_values(plant: P, effects: Sequence[Effect], values: Sequence[Sequence[float]]) -> P:
    """Set effects of a plant to given values.

    Parameters
    ----------
    plant
        Plant without the effects.
    effects
        Effects that do not clash with each other.
    values
        Values of each effect, in the order of its kind's parameters.

    Returns
    -------
    plant
        Plant of the same type with the effects.
    """
    for effect, numbers in zip(effects, values, strict=True):
        changes = dict(zip(effect.kind.parameters, numbers, strict=True))
        plant = with_parameters(plant, effect.group, changes)
    return plant


def clashes(effect: Effect, effects: Sequence[Effect]) -> bool:
    """Return whether an effect sets or multiplies a parameter that another effect sets.

    Parameters
    ----------
    effect
        Effect that may be added.
    effects
        Effects of a hypothesis.

    Returns
    -------
    bool
        True if the effect and the hypothesis exclude each other.
    """
    sets, changes = _changed(effect)
    for member in effects:
        if member.group == effect.group:
            member_sets, member_changes = _changed(member)
            if sets & member_changes or changes & member_sets:
                return True
    return False


def _changed(effect: Effect) -> tuple[set[str], set[str]]:
    """Return the parameters that an effect sets, and those that it sets or multiplies."""
    parameters = set(effect.kind.parameters)
    return parameters, parameters | set(effect.kind.multiplied)


def is_possible(effects: Sequence[Effect], plant: Plant) -> bool:
    """Return whether every effect has the dry friction that it acts through.

    Parameters
    ----------
    effects
        Effects of one hypothesis.
    plant
        Plant without the effects.

    Returns
    -------
    bool
        False if a play, a spring or a Stribeck peak of a guide has no dry friction in series.
    """
    # Either a fitted friction or that of the plant will do: the kinds of `THROUGH_FRICTION` act in
    # series with it.
    dry = {effect.group for effect in effects if effect.kind.name == "coulomb"}
    return all(
        effect.of is not Guide
        or effect.kind.name not in THROUGH_FRICTION
        or effect.group in dry
        or parameter_of(plant, effect.group, "coulomb") > 0.0
        for effect in effects
    )


def leave_one_out(fit: Fit) -> Iterator[tuple[Effect, tuple[Effect, ...], Values]]:
    """Leave out each effect of a fit in turn.

    Parameters
    ----------
    fit
        Fit of at least one effect.

    Yields
    ------
    tuple
        Effect that is left out, the remaining effects, and their values.
    """
    for number, effect in enumerate(fit.effects):
        yield (
            effect,
            (*fit.effects[:number], *fit.effects[number + 1 :]),
            (*fit.values[:number], *fit.values[number + 1 :]),
        )
