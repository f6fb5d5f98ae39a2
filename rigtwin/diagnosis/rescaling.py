"""Starts that scale all forces and inertias of a hypothesis together.

Where no force is measured, the equation of motion of a servo's joint

    m·a + viscous·v + coulomb·sign(v) + … = position_gain·(command − position) − damping_gain·v

holds with all its coefficients scaled by a common factor as well. A search may therefore correct
gain, mass and friction where a different damping alone is the cause: the same motion, at another
scale. Of all scales, those at which one coefficient is nominal need the fewest effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.fit import Fit, clashes, is_possible
from rigtwin.diagnosis.starts import Start

SCALED = (
    "coulomb",
    "viscous",
    "offset",
    "asymmetry",
    "stiffness",
    "mass",
    "position_gain",
    "damping_gain",
)
"""Kinds whose magnitude is a coefficient of the equation of motion."""
BOTH = "gains"
"""Kind that multiplies the position and the damping gain of its servo."""
GAINS = ("position_gain", "damping_gain")
NEAR = 0.02
"""Relative distance from nominal within which a scaled coefficient counts as nominal."""


def start_rescaled(plant: Plant, leader: Fit, candidates: Sequence[Effect]) -> list[Start]:
    """Start a hypothesis at every scale at which it needs fewer effects.

    Parameters
    ----------
    plant
        Nominal plant.
    leader
        Fit whose forces and inertias are scaled.
    candidates
        Candidate effects.

    Returns
    -------
    list of pairs
        Effects, and the values from which they are fitted.
    """
    nominal = {
        effect: _magnitude(effect, plant) for effect in candidates if effect.kind.name in SCALED
    }
    fitted = _coefficients_of(leader, nominal)
    others = [
        (effect, values)
        for effect, values in zip(leader.effects, leader.values, strict=True)
        if effect not in nominal and effect.kind.name != BOTH
    ]
    pivots = [nominal[effect] / value for effect, value in fitted.items() if value != 0.0]
    starts: list[Start] = []
    for factor in (1.0, *(pivot for pivot in pivots if pivot > 0.0)):
        scaled = {effect: factor * fitted.get(effect, value) for effect, value in nominal.items()}
        changed = [
            (effect, (value,))
            for effect, value in scaled.items()
            if abs(value - nominal[effect]) > NEAR * abs(value)
        ]
        pairs = [*others, *changed]
        effects = tuple(effect for effect, _ in pairs)
        if 0 < len(pairs) < len(leader.effects) and _is_consistent(effects, plant):
            starts.append((effects, tuple(values for _, values in pairs)))
    return starts


def _magnitude(effect: Effect, plant: Plant) -> float:
    return next(iter(effect.nominal(plant).values()))


def _coefficients_of(leader: Fit, nominal: Mapping[Effect, float]) -> dict[Effect, float]:
    """Return the coefficients that a fit changes, with a factor on both gains multiplied out."""
    fitted = {
        effect: values[0]
        for effect, values in zip(leader.effects, leader.values, strict=True)
        if effect in nominal
    }
    for effect, values in zip(leader.effects, leader.values, strict=True):
        if effect.kind.name == BOTH:
            for member, value in nominal.items():
                if member.group == effect.group and member.kind.name in GAINS:
                    fitted[member] = values[0] * fitted.get(member, value)
    return fitted


def _is_consistent(effects: Sequence[Effect], plant: Plant) -> bool:
    """Return whether effects may form one hypothesis."""
    return is_possible(tuple(effects), plant) and not any(
        clashes(effect, [*effects[:number], *effects[number + 1 :]])
        for number, effect in enumerate(effects)
    )
