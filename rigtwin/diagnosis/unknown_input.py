"""Where an effect acts that nobody has a name for: which component, disturbed in any way it could
be, explains most.

Each component gets a set of disturbances at its place, functions of what it goes through: its
motion, speed, force, the time. Their strengths are fitted together, linearly. A sensor's
disturbance shows in that sensor alone; an actuator's moves all that hangs on it; a force on what
moves shows wherever that motion is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array

PRICE = 20.0
"""Of each disturbance, in χ²."""
ROUNDS = 4
"""Times that a disturbance is fitted anew at what was found."""
SETTLING, UNMOVED = 2, 0.05
"""Times that the tolerances are taken anew, and half widths by which none may have moved for it to
end."""
FOLLOWED = 6
"""Components that are fitted so; those that come last at first stay there."""


@dataclass(frozen=True)
class DisturbanceFit:
    """How well a component, disturbed freely, explains the evidence. misfit: χ²; gained: by how
    much that is less than without, at a price for each form; forms: what the disturbance goes with,
    the strongest first."""

    component: str
    misfit: float
    gained: float
    forms: tuple[str, ...]


class _Disturbance:
    """All forms of one component's disturbance in every recording, and what they do."""

    def __init__(self, component: str, evidence: Evidence, plant: Plant) -> None:
        forms = list(zip(*(each.forms(component, plant) for each in evidence.models), strict=True))
        self.component, self.names = component, [same[0].name for same in forms]
        self._evidence, self._plant = evidence, plant
        self._enter = forms[0][0].entry
        strength = max(each.disturbance_size(self._enter) for each in evidence.models)
        sizes = [
            float(np.sqrt(np.mean(np.concatenate([form.signal for form in same]) ** 2)))
            for same in forms
        ]
        # One row a form, one column a tick; each of the same strength.
        self._forms = [
            np.stack(
                [
                    strength / max(size, 1e-300) * same[number].signal
                    for same, size in zip(forms, sizes, strict=True)
                ]
            )
            for number in range(len(evidence.models))
        ]

    def predict(self, strengths: Array) -> list[Array]:
        """The signals under the disturbance, shape (rows, ticks) for each recording."""
        return [
            each.predict_disturbed(self._plant, self._enter, strengths @ forms)
            for each, forms in zip(self._evidence.models, self._forms, strict=True)
        ]

    def fit(self, space: Space, rounds: int) -> tuple[float, float, Array]:
        """Gauss-Newton: misfit without it and with it, and what would be missing without each
        form."""
        here = np.zeros(len(self.names))
        predicted = self.predict(here)
        residual = self._evidence.residual_of(predicted)
        without = misfit = space.misfit(residual)
        worth = np.zeros_like(here)
        for _ in range(rounds):
            columns = []
            for number in range(len(here)):
                there = here.copy()
                there[number] += 1.0
                columns.append(
                    self._evidence.whiten(
                        [b - a for a, b in zip(predicted, self.predict(there), strict=True)]
                    )
                )
            normal, gradient = space.normal_equations(np.stack(columns, axis=1), residual)
            normal += np.diag(1e-6 * np.diag(normal) + 1e-9)
            move = np.linalg.solve(normal, gradient)
            gained = 0.0
            for share in (1.0, 0.5, 0.2):
                tried = self.predict(here + share * move)
                left = self._evidence.residual_of(tried)
                if (value := space.misfit(left)) < misfit:
                    gained = misfit - value
                    here, predicted, residual, misfit = here + share * move, tried, left, value
                    break
            worth = here**2 / np.diag(np.linalg.inv(normal))
            if gained < 0.02 * misfit:
                break
        return without, misfit, worth


def locate_disturbance(
    evidence: Evidence, plant: Plant, effects: Sequence[Effect] = (), follow: bool = True
) -> tuple[DisturbanceFit, ...]:
    """Every component disturbed freely.

    Parameters
    ----------
    evidence
        The recordings.
    plant
        With the effects that are known already.
    effects
        These effects.
    follow
        Whether to fit the foremost anew at what was found, as large disturbances need.

    Returns
    -------
    tuple of DisturbanceFit
        The one that explains most first.
    """
    plant, space = _use_tolerances(evidence, plant, effects)
    disturbances = [
        _Disturbance(component, evidence, plant) for component in evidence.models[0].components()
    ]
    with Threads() as threads:
        found = sorted(
            threads.map(lambda each: _fit_component(each, space, 1), disturbances),
            key=lambda each: each.misfit,
        )
        if follow:
            foremost = [each.component for each in found[:FOLLOWED]]
            again = threads.map(
                lambda each: _fit_component(each, space, ROUNDS),
                [each for each in disturbances if each.component in foremost],
            )
            found = sorted([*again, *found[FOLLOWED:]], key=lambda each: each.misfit)
    return tuple(found)


def _use_tolerances(
    evidence: Evidence, plant: Plant, effects: Sequence[Effect]
) -> tuple[Plant, Space]:
    """The plant that uses its mechanical tolerances, and the tolerances about it: what they do is
    not linear, and the rest of it would be taken for a disturbance, or hide one."""
    mechanical = np.array([each.mechanical for each in evidence.machine.tolerances], bool)
    used, space = np.zeros(len(mechanical)), Space(evidence, plant, None, effects)
    found = plant
    for _ in range(SETTLING):
        wanted = np.where(mechanical, space.estimate_tolerances(evidence.residual(found)), 0.0)
        if np.max(np.abs(wanted - used), initial=0.0) < UNMOVED:
            break
        used, found = wanted, evidence.shift(plant, wanted.tolist())
        space = Space(evidence, found, used, effects)
    return found, space


def _fit_component(disturbance: _Disturbance, space: Space, rounds: int) -> DisturbanceFit:
    without, misfit, worth = disturbance.fit(space, rounds)
    order = np.argsort(-worth)
    forms = tuple(
        dict.fromkeys(disturbance.names[form] for form in order[:3] if worth[form] > PRICE)
    )
    priced = misfit + PRICE * len(disturbance.names)
    return DisturbanceFit(disturbance.component, priced, without - priced, forms)
