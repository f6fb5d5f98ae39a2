"""Effects with the values that explain some evidence best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from rigtwin.components import Effect, Guide
from rigtwin.components.guide import THROUGH_FRICTION
from rigtwin.components.plant import P, Plant, with_parameters

Values = tuple[tuple[float, ...], ...]
"""Of effects, one tuple each, in the order of its parameters."""


@dataclass(frozen=True)
class Fit:
    """Effects with the values that explain the evidence best. misfit: χ² with tolerances and their
    prior; widths: standard deviation of each value; plant: with them; base: the nominal plant that
    uses its mechanical tolerances by `used` half widths, None where they were not taken."""

    effects: tuple[Effect, ...]
    values: Values
    misfit: float
    widths: Values
    plant: Plant = field(repr=False)
    base: Plant | None = field(default=None, repr=False, compare=False)
    used: tuple[float, ...] = field(default=(), repr=False, compare=False)

    @property
    def name(self) -> str:
        return " + ".join(effect.name for effect in self.effects) or "none"


def with_values(plant: P, effects: Sequence[Effect], values: Sequence[Sequence[float]]) -> P:
    """The plant with effects of these values.

    Parameters
    ----------
    plant
        Without them.
    effects
        Any that do not clash.
    values
        One tuple an effect, in the order of its parameters.

    Returns
    -------
    plant
        Of the same type.
    """
    for effect, numbers in zip(effects, values, strict=True):
        changes = dict(zip(effect.kind.parameters, numbers, strict=True))
        plant = with_parameters(plant, effect.group, changes)
    return plant


def clashes(effect: Effect, others: Sequence[Effect]) -> bool:
    """Whether an effect sets a parameter that another sets too.

    Parameters
    ----------
    effect
        The one.
    others
        The others.

    Returns
    -------
    bool
        True if they cannot stand together.
    """
    own = set(effect.kind.parameters)
    return any(other.group == effect.group and own & set(other.kind.parameters) for other in others)


def is_possible(effects: Sequence[Effect], plant: Plant) -> bool:
    """Whether each effect has what it acts through.

    Parameters
    ----------
    effects
        Of one explanation.
    plant
        Without them.

    Returns
    -------
    bool
        False if a guide's play, spring or Stribeck peak has no dry friction to act through.
    """
    dry = {effect.group for effect in effects if effect.kind.name == "coulomb"}
    return all(
        effect.of is not Guide
        or effect.kind.name not in THROUGH_FRICTION
        or effect.group in dry
        or getattr(plant, effect.group).coulomb > 0.0
        for effect in effects
    )


def without_each(fit: Fit) -> Iterator[tuple[Effect, tuple[Effect, ...], Values]]:
    """Leaves out each effect of a fit in turn.

    Parameters
    ----------
    fit
        Of one effect or more.

    Yields
    ------
    tuple
        The effect left out, the others, and their values.
    """
    for number, effect in enumerate(fit.effects):
        yield (
            effect,
            (*fit.effects[:number], *fit.effects[number + 1 :]),
            (*fit.values[:number], *fit.values[number + 1 :]),
        )
