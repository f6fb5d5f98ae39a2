"""Declared tolerances of a plant as nuisance parameters of a fit.

Let r be the whitened residual at a plant, C the responses to one half width of each tolerance, u
the half widths that the plant already uses, and t those to be estimated. The misfit of a plant is
profiled over its tolerances, which have Gaussian priors and a bound b:

    misfit(r) = min over |t| <= b of |r + C (u - t)|^2 + PRIOR |t|^2.

Responses are taken once, so that the minimum costs one linear solution. A change of parameters is
judged by the normal equations with the free tolerances eliminated (their Schur complement).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.numerics.arrays import Array

PRIOR = 1.0
"""Chi-square that a tolerance costs at its half width."""
BOUND = 1.2
"""Bound on every tolerance, in half widths. A larger deviation is an effect and not a tolerance."""


class Space:
    """Tolerances about one plant: the part of a residual that they absorb, and its price.

    Parameters
    ----------
    evidence
        Evidence whose residuals are judged.
    plant
        Plant at which the responses to the tolerances are taken.
    used
        Half widths by which the plant already uses each tolerance, shape (tolerances,). Defaults
        to 0.
    effects
        Effects fitted beside the tolerances. Their own parameters have no tolerance.
    """

    def __init__(
        self,
        evidence: Evidence,
        plant: Plant,
        used: Array | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        self._machine = evidence.machine
        self._responses = evidence.tolerance_responses(plant)
        self._used = np.zeros(self._responses.shape[1]) if used is None else used
        self._replace_by(effects)

    def _is_replaced(self, effects: Sequence[Effect]) -> list[bool]:
        """Return for each tolerance whether an effect sets the same parameter."""
        tolerances = self._machine.tolerances
        replaced = [
            self._machine.tolerance_of(effect.group, parameter)
            for effect in effects
            for parameter in effect.kind.parameters
        ]
        # A fitted delay and the sampling times shift the signals alike, so that only one is free.
        timed = any("delay" in effect.kind.parameters for effect in effects)
        return [tolerance in replaced or (timed and tolerance.ticks) for tolerance in tolerances]

    def _replace_by(self, effects: Sequence[Effect]) -> None:
        """Remove the tolerances that effects replace, and form the normal matrix of the others."""
        fixed = self._is_replaced(effects)
        # A column of zeros keeps the positions of the tolerances; its estimate is 0.
        self._columns = np.where(fixed, 0.0, self._responses) if any(fixed) else self._responses
        # r + C u is the residual with the tolerances back at nominal, from which the prior counts.
        self._absorbed = self._columns @ self._used
        self._normal = self._columns.T @ self._columns + PRIOR * np.eye(self._columns.shape[1])

    @property
    def columns(self) -> Array:
        """Response of the prediction to each tolerance, shape (size, tolerances); 0 where an effect
        replaces the tolerance."""
        return self._columns

    def without_replaced(self, effects: Sequence[Effect]) -> Space:
        """Return the same tolerances without those that effects replace."""
        if not any(self._is_replaced(effects)):
            return self
        reduced = copy(self)
        reduced._replace_by(effects)
        return reduced

    def estimate_tolerances(self, residual: Array) -> Array:
        """Estimate the tolerances that minimise the misfit of a residual.

        Parameters
        ----------
        residual
            Whitened residual, shape (size,).

        Returns
        -------
        array
            Tolerances in half widths, at most `BOUND`, shape (tolerances,).
        """
        gradient = self._columns.T @ (residual + self._absorbed)
        estimate = np.zeros(len(gradient))
        free = np.ones(len(gradient), bool)
        # Active set: solve for the free tolerances, fix those beyond the bound at it, and repeat.
        # At least one is fixed in each pass, so the loop ends after as many passes as tolerances.
        for _ in range(len(gradient)):
            right = gradient[free] - self._normal[np.ix_(free, ~free)] @ estimate[~free]
            estimate[free] = np.linalg.solve(self._normal[np.ix_(free, free)], right)
            beyond = free & (np.abs(estimate) > BOUND)
            if not beyond.any():
                break
            # A fixed tolerance is never freed again, unlike in an exact active-set method: the
            # result may miss the minimum where tolerances are strongly correlated.
            estimate[beyond] = np.sign(estimate[beyond]) * BOUND
            free &= ~beyond
        return estimate

    def subtract_tolerances(self, residual: Array) -> Array:
        """Return a residual without the part that the tolerances absorb, shape (size,)."""
        return residual + self._columns @ (self._used - self.estimate_tolerances(residual))

    def project_out(self, responses: Array) -> Array:
        """Return responses without the part that unbounded tolerances absorb, shape (size, n)."""
        return responses - self._columns @ np.linalg.solve(
            self._normal, self._columns.T @ responses
        )

    def misfit(self, residual: Array) -> float:
        """Return the chi-square of a residual, profiled over the tolerances with their prior."""
        estimate = self.estimate_tolerances(residual)
        remainder = residual + self._columns @ (self._used - estimate)
        return float(remainder @ remainder + PRIOR * estimate @ estimate)

    def strengths(self, responses: Array, residual: Array) -> tuple[Array, Array]:
        """Return half the curvature and half the slope of the misfit along single responses.

        The tolerances below their bound are free beside each response. With curvature c and slope
        s, the strength s / c of a response explains the chi-square s^2 / c.

        Parameters
        ----------
        responses
            Whitened responses, shape (size, count). Each is judged alone.
        residual
            Whitened residual, shape (size,).

        Returns
        -------
        tuple of arrays
            Half curvature and half slope, shape (count,).
        """
        estimate = self.estimate_tolerances(residual)
        free = np.abs(estimate) < BOUND
        # Each response is judged alone, so only the diagonal of the Schur complement is needed: d'd
        # - d'C N^-1 C'd.
        shared = self._columns[:, free].T @ responses
        absorbed = np.linalg.solve(self._normal[np.ix_(free, free)], shared)
        power = np.sum(responses**2, axis=0) - np.sum(shared * absorbed, axis=0)
        return power, responses.T @ (residual + self._columns @ (self._used - estimate))

    def normal_equations(self, jacobian: Array, residual: Array) -> tuple[Array, Array]:
        """Return the normal matrix and gradient of the misfit in the fitted parameters.

        The tolerances below their bound are eliminated: with J the jacobian, C their responses and
        N = C'C + PRIOR, the normal matrix is J'J - J'C N^-1 C'J. By the envelope theorem the
        gradient is J' times the residual at the estimated tolerances.

        Parameters
        ----------
        jacobian
            Response of the residual to each parameter, shape (size, parameters).
        residual
            Whitened residual, shape (size,).

        Returns
        -------
        tuple of arrays
            Normal matrix, shape (parameters, parameters), and gradient, shape (parameters,).
        """
        estimate = self.estimate_tolerances(residual)
        free = np.abs(estimate) < BOUND
        columns = self._columns[:, free]
        shared = columns.T @ jacobian
        normal = jacobian.T @ jacobian - shared.T @ np.linalg.solve(
            self._normal[np.ix_(free, free)], shared
        )
        return normal, jacobian.T @ (residual + self._columns @ (self._used - estimate))
