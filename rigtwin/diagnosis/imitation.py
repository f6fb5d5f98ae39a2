"""Imitation of a response by an effect, while other effects of a fit adapt themselves.

Let m be the response that a fit lacks without some of its effects, d the response to a candidate,
and J the responses to the parameters of the effects that are kept, all whitened and free of what
the tolerances absorb. With P projecting out J, the candidate imitates m as well as the squared
cosine says between P m and P d. At the share s = (Pd)'m / (Pd)'d of its response, the kept effects
move by

    (J'J)^-1 J' (s d - m).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import DAMPING
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

RESEMBLES = 0.6
"""Squared cosine of two responses from which one effect is tried in the place of the other."""
LARGEST_SHARE = 3.0
"""Largest share of a simulated response that a linear estimate uses."""


@dataclass(frozen=True)
class Imitation:
    """Result of an imitation.

    Attributes
    ----------
    cosine
        Squared cosine between the response to the candidate and the one that is missing; 0 where
        they oppose each other.
    candidate
        Effect whose response imitates the missing one.
    start
        Values of the candidate that imitate the missing response best.
    beside
        Values of the effects that are kept, adapted to the candidate.
    """

    cosine: float
    candidate: Effect
    start: tuple[float, ...]
    beside: Values


class Imitator:
    """Comparison of candidates with the response that a fit lacks without some effects.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit whose effects are kept in part.
    linearised
        Residual of the fit, linearised in the values of its effects.
    replaced
        Numbers of the effects that are replaced; the others are kept.
    missing
        Whitened responses that are missing; the candidate imitates one of them, shape (size,) each.
    """

    def __init__(
        self,
        fitter: Fitter,
        fit: Fit,
        linearised: Linearised,
        replaced: Sequence[int],
        missing: Sequence[Array],
    ) -> None:
        self._fitter, self._fit, self._linearised = fitter, fit, linearised
        self._missing = np.stack(missing, axis=1)
        self._retained = [n for n in range(len(fit.effects)) if n not in replaced]
        self._effects = tuple(fit.effects[number] for number in self._retained)
        self._values = tuple(fit.values[number] for number in self._retained)
        self._prepared = self._prepare(fitter.space)

    def _prepare(self, space: Space) -> tuple[Array, Array, Array]:
        """Return the kept effects' responses, what they absorb of the missing ones, and the rest.

        All of them are free of what the tolerances absorb.
        """
        columns = space.project_out(self._linearised.columns_of(self._retained))
        missing = space.project_out(self._missing)
        absorbed = _regress(columns, missing)
        return columns, absorbed, missing - columns @ absorbed

    def imitate(self, candidate: Effect) -> Imitation:
        """Return how well a candidate imitates the missing response that it resembles most."""
        starts, responses = zip(*self._fitter.responses_beside(candidate, self._fit), strict=True)
        # An effect that replaces a tolerance must not be judged beside that tolerance.
        space = self._fitter.space.without_replaced((candidate,))
        is_reduced = space is not self._fitter.space
        columns, lacking, missing = self._prepare(space) if is_reduced else self._prepared
        shapes = space.project_out(np.stack(responses, axis=1).astype(np.float64))
        absorbed = _regress(columns, shapes)
        shapes -= columns @ absorbed
        along, power = shapes.T @ missing, np.maximum(np.sum(shapes**2, axis=0), 1e-100)
        size = np.sum(missing**2, axis=0)
        # The sign is kept until the square is taken: an opposed response has no start that imitates
        # the other.
        cosines = np.maximum(along, 0.0) ** 2 / (np.outer(power, size) + 1e-300)
        best, target = np.unravel_index(int(np.argmax(cosines)), cosines.shape)
        share = min(float(along[best, target] / power[best]), LARGEST_SHARE)
        # Where the effect opposes what is missing, the share is negative, and a scaled start may be
        # outside the effect's range: an actuator has no delay below 0.
        (scaled,) = self._fitter.scale_start(candidate, starts[best], share)
        start = tuple(np.clip(scaled, *self._fitter.bounds((candidate,))).tolist())
        moves = share * absorbed[:, best] - lacking[:, target]
        moved = self._linearised.move(self._retained, moves)
        return Imitation(float(cosines[best, target]), candidate, start, moved)

    def place_beside(self, imitation: Imitation) -> Values:
        """Return the values of the kept effects from which a fit with the candidate begins.

        They have adapted themselves if that fits better: where friction sticks or a limit is
        reached, they may not be extrapolated.
        """
        effects = (*self._effects, imitation.candidate)

        def misfit(values: Values) -> float:
            plant = with_values(self._fitter.plant, effects, (*values, imitation.start))
            return self._fitter.space.misfit(self._fitter.evidence.residual(plant))

        return min((imitation.beside, self._values), key=misfit)


def _regress(columns: Array, responses: Array) -> Array:
    """Return the coefficients by which columns make up responses best, shape (columns, n)."""
    normal = columns.T @ columns
    # The same damping as in a fit keeps the matrix regular where a parameter has no response.
    normal += np.diag(DAMPING * np.diag(normal) + 1e-12)
    return np.linalg.solve(normal, columns.T @ responses)
