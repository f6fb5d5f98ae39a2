"""Estimate an unknown input of each component, to locate an effect that the library lacks.

The input of a component is a sum of forms, functions of its position, speed, force and of time
(`models.basis`):

    u(t) = Σ a_i φ_i(t).

The strengths a_i are fitted by Gauss-Newton to the whitened residual, with the tolerances as
nuisance parameters. The component whose input explains most is where the effect acts: the input of
a sensor shows in that sensor alone, that of an actuator in everything it drives, and a force on a
moving part wherever its motion is seen.
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
"""χ² that each form of an input must gain, so that a component with many forms has no advantage."""
ROUNDS = 4
"""Gauss-Newton steps of the foremost components."""
STEP_SHARES = (1.0, 0.5, 0.2)
"""Shares of a Gauss-Newton step that are tried in turn until the misfit falls."""
CONVERGED = 0.02
"""Share of the misfit that a Gauss-Newton step must gain for another to follow."""
TOLERANCE_ROUNDS, UNMOVED = 2, 0.05
"""Largest number of estimates of the tolerances, and the change in half widths that ends them."""
FOLLOWED = 6
"""Components that are fitted iteratively; the others keep their place after one step."""


@dataclass(frozen=True)
class DisturbanceFit:
    """Fit of an unknown input at one component.

    Attributes
    ----------
    component
        Name of the component.
    misfit
        χ² with the input, plus `PRICE` for each form.
    gained
        Decrease of χ² against the fit without the input, less that price.
    forms
        Names of the forms that contribute, the strongest first, three at most.
    """

    component: str
    misfit: float
    gained: float
    forms: tuple[str, ...]


class _Disturbance:
    """Forms of one component's unknown input in every recording, and their responses."""

    def __init__(self, component: str, evidence: Evidence, plant: Plant) -> None:
        forms = list(
            zip(*(model.forms(component, plant) for model in evidence.models), strict=True)
        )
        self.component = component
        self.names = [by_recording[0].name for by_recording in forms]
        self._evidence, self._plant = evidence, plant
        self._entry = forms[0][0].entry
        strength = max(model.disturbance_size(self._entry) for model in evidence.models)
        sizes = [
            float(np.sqrt(np.mean(np.concatenate([form.signal for form in by_recording]) ** 2)))
            for by_recording in forms
        ]
        # All forms are scaled to one rms, which conditions the normal equations. For each recording
        # there is one row per form and one column per tick.
        self._forms = [
            np.stack(
                [
                    strength / max(size, 1e-300) * by_recording[number].signal
                    for by_recording, size in zip(forms, sizes, strict=True)
                ]
            )
            for number in range(len(evidence.models))
        ]

    def predict(self, strengths: Array) -> list[Array]:
        """Predict the signals under the input, shape (rows, ticks) for each recording."""
        return [
            model.predict_disturbed(self._plant, self._entry, strengths @ forms)
            for model, forms in zip(self._evidence.models, self._forms, strict=True)
        ]

    def fit(self, space: Space, rounds: int) -> tuple[float, float, Array]:
        """Fit the strengths by Gauss-Newton.

        Returns
        -------
        tuple
            Misfit without the input, misfit with it, and the χ² that each form contributes,
            a_i^2 / (N^-1)_ii with the normal matrix N, shape (forms,).
        """
        strengths = np.zeros(len(self.names))
        predicted = self.predict(strengths)
        residual = self._evidence.residual_of(predicted)
        without = misfit = space.misfit(residual)
        worth = np.zeros_like(strengths)
        for _ in range(rounds):
            jacobian = self._differentiate(strengths, predicted)
            normal, gradient = space.normal_equations(jacobian, residual)
            # Forms may be collinear in a recording that moves little.
            normal += np.diag(1e-6 * np.diag(normal) + 1e-9)
            # The jacobian is that of the prediction, and the residual is measured minus predicted.
            # Unlike in `gauss_newton` the step therefore needs no minus sign.
            step = np.linalg.solve(normal, gradient)
            gained = 0.0
            for share in STEP_SHARES:
                trial = self.predict(strengths + share * step)
                trial_residual = self._evidence.residual_of(trial)
                if (value := space.misfit(trial_residual)) < misfit:
                    gained = misfit - value
                    strengths = strengths + share * step
                    predicted, residual, misfit = trial, trial_residual, value
                    break
            # The χ² that leaving out one form would cost if all others were refitted (Wald's
            # statistic).
            worth = strengths**2 / np.diag(np.linalg.inv(normal))
            if gained < CONVERGED * misfit:
                break
        return without, misfit, worth

    def _differentiate(self, strengths: Array, predicted: list[Array]) -> Array:
        """Whitened response to a unit change of each strength, shape (lines, forms)."""
        columns = []
        for number in range(len(strengths)):
            changed = strengths.copy()
            # The forms are scaled to a disturbance that counts as small, so a unit step is a small
            # one.
            changed[number] += 1.0
            response = [b - a for a, b in zip(predicted, self.predict(changed), strict=True)]
            columns.append(self._evidence.whiten(response))
        return np.stack(columns, axis=1)


def locate_disturbance(
    evidence: Evidence, plant: Plant, effects: Sequence[Effect] = ()
) -> tuple[DisturbanceFit, ...]:
    """Fit an unknown input at every component in turn.

    Parameters
    ----------
    evidence
        Recordings.
    plant
        Plant with the effects that are known already.
    effects
        These effects. Their tolerances are no longer free.

    Returns
    -------
    tuple of DisturbanceFit
        One fit for each component, the one that explains most first.
    """
    plant, space = _use_tolerances(evidence, plant, effects)
    disturbances = [
        _Disturbance(component, evidence, plant) for component in evidence.models[0].components()
    ]
    with Threads() as threads:
        # One linear step ranks the components; only the foremost are worth more steps.
        fits = sorted(
            threads.map(lambda disturbance: _fit_component(disturbance, space, 1), disturbances),
            key=lambda fit: fit.misfit,
        )
        foremost = [fit.component for fit in fits[:FOLLOWED]]
        refined = threads.map(
            lambda disturbance: _fit_component(disturbance, space, ROUNDS),
            [each for each in disturbances if each.component in foremost],
        )
        fits = sorted([*refined, *fits[FOLLOWED:]], key=lambda fit: fit.misfit)
    return tuple(fits)


def _use_tolerances(
    evidence: Evidence, plant: Plant, effects: Sequence[Effect]
) -> tuple[Plant, Space]:
    """Plant at its estimated mechanical tolerances, and the tolerance space about it.

    Mechanical tolerances act nonlinearly. Linearised about their nominal values, the remainder
    would pass for an unknown input, or hide one.
    """
    mechanical = np.array([each.mechanical for each in evidence.machine.tolerances], bool)
    used, space = np.zeros(len(mechanical)), Space(evidence, plant, None, effects)
    shifted = plant
    for _ in range(TOLERANCE_ROUNDS):
        estimated = space.estimate_tolerances(evidence.residual(shifted))
        wanted = np.where(mechanical, estimated, 0.0)
        if np.max(np.abs(wanted - used), initial=0.0) < UNMOVED:
            break
        used, shifted = wanted, evidence.shift(plant, wanted.tolist())
        space = Space(evidence, shifted, used, effects)
    return shifted, space


def _fit_component(disturbance: _Disturbance, space: Space, rounds: int) -> DisturbanceFit:
    without, misfit, worth = disturbance.fit(space, rounds)
    # Forms of one name may enter twice, as sine and cosine, and count once.
    order = np.argsort(-worth)
    forms = tuple(
        dict.fromkeys(disturbance.names[form] for form in order[:3] if worth[form] > PRICE)
    )
    # The price makes components with different numbers of forms comparable.
    priced = misfit + PRICE * len(disturbance.names)
    return DisturbanceFit(disturbance.component, priced, without - priced, forms)
