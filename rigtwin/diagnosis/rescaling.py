"""Starts that scale all forces and inertias of a hypothesis together.

Where no force is measured, the equation of motion of a joint that a servo or a force moves,

    m·a + viscous·v + coulomb·sign(v) + … = position_gain·(command − position) − damping_gain·v
    m·a + viscous·v + coulomb·sign(v) + … = gain·command,

holds with all its coefficients scaled by a common factor as well. A search may therefore correct
gain, mass and friction where a different damping alone is the cause: the same motion, at another
scale. Of all scales, those at which one coefficient is nominal need the fewest effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigtwin.components import Effect, ForceActuator, measures
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
    "armature",
    "gain",
    "position_gain",
    "damping_gain",
)
"""Kinds whose magnitude is a coefficient of the equation of motion."""
BOTH = "gains"
"""Kind that multiplies the position and the damping gain of its servo."""
GAINS = ("position_gain", "damping_gain")
BASIC = ("mass", "armature", "gain", *GAINS)
"""Kinds whose nominal value is scaled too where the hypothesis leaves it nominal. Nominal friction
is small enough to be left as it is."""
NEAR = 0.05
"""Relative distance within which two coefficients count as equal."""
LONGER = 1
"""Number of effects by which a scaled hypothesis may exceed its leader. What is nearly nominal is
left out of it later."""


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
    # A friction that fades has the name of a coefficient, but a time besides.
    nominal = {
        effect: _magnitude(effect, plant)
        for effect in candidates
        if effect.kind.name in SCALED and len(effect.kind.parameters) == 1 and _is_scaled(effect)
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
        scaled = {effect: factor * value for effect, value in fitted.items()}
        for effect, value in nominal.items():
            if effect.kind.name in BASIC:
                scaled.setdefault(effect, factor * value)
        changed = {e: v for e, v in scaled.items() if not _equal(v, nominal[e])}
        pairs = [*others, *_join_gains(changed, nominal, candidates)]
        effects = tuple(effect for effect, _ in pairs)
        if frozenset(effects) == frozenset(leader.effects):
            continue
        if 0 < len(pairs) <= len(leader.effects) + LONGER and _is_consistent(effects, plant):
            starts.append((effects, tuple(values for _, values in pairs)))
    return starts


def _is_scaled(effect: Effect) -> bool:
    """Return whether an effect's magnitude is a coefficient, and not a factor on a reading."""
    return effect.of is ForceActuator if effect.kind.name == "gain" else not measures(effect.of())


def _equal(value: float, other: float) -> bool:
    return abs(value - other) <= NEAR * max(abs(value), abs(other))


def _join_gains(
    changed: Mapping[Effect, float], nominal: Mapping[Effect, float], candidates: Sequence[Effect]
) -> list[tuple[Effect, tuple[float, ...]]]:
    """Return effects and values, with one factor for both gains of a servo that have the same."""
    pairs = {effect: (value,) for effect, value in changed.items()}
    for both in (effect for effect in candidates if effect.kind.name == BOTH):
        gains = [e for e in changed if e.group == both.group and e.kind.name in GAINS]
        ratios = [changed[effect] / nominal[effect] for effect in gains if nominal[effect] > 0.0]
        if len(ratios) == len(GAINS) and _equal(ratios[0], ratios[1]):
            pairs = {effect: value for effect, value in pairs.items() if effect not in gains}
            pairs[both] = (ratios[0],)
    return list(pairs.items())


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
