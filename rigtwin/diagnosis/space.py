"""The tolerances about a plant, as nuisances of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.numerics.arrays import Array

PRIOR = 1.0
"""χ² that a tolerance costs at its half width."""
BEYOND = 1.2
"""Half widths that no tolerance exceeds: what is more is a finding."""


class Space:
    """The tolerances about one plant: what they can take up of a residual at what price, none
    beyond its bound."""

    def __init__(
        self,
        evidence: Evidence,
        plant: Plant,
        used: Array | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        """used: by how many half widths the plant already uses each tolerance. An effect's own
        parameters have none."""
        self._machine = evidence.machine
        self._responses = evidence.tolerance_responses(plant)
        self._used = np.zeros(self._responses.shape[1]) if used is None else used
        self._fix(effects)

    def _replaced(self, effects: Sequence[Effect]) -> list[bool]:
        """Which tolerances effects take the place of."""
        tolerances = self._machine.tolerances
        own = [
            self._machine.tolerance_of(effect.group, parameter)
            for effect in effects
            for parameter in effect.kind.parameters
        ]
        # With a delay to be found, when samples were taken is no question of its own any more.
        timed = any("delay" in effect.kind.parameters for effect in effects)
        return [tolerance in own or (timed and tolerance.ticks) for tolerance in tolerances]

    def _fix(self, effects: Sequence[Effect]) -> None:
        fixed = self._replaced(effects)
        self._columns = np.where(fixed, 0.0, self._responses) if any(fixed) else self._responses
        self._taken = self._columns @ self._used
        self._normal = self._columns.T @ self._columns + PRIOR * np.eye(self._columns.shape[1])

    @property
    def columns(self) -> Array:
        """Response of the prediction to each tolerance, shape (size, tolerances); 0 where an effect
        takes the tolerance's place."""
        return self._columns

    def beside(self, effects: Sequence[Effect]) -> Space:
        """The same tolerances, less those that effects take the place of."""
        if not any(self._replaced(effects)):
            return self
        like = copy(self)
        like._fix(effects)
        return like

    def estimate_tolerances(self, residual: Array) -> Array:
        """The tolerances that take up most of a residual, in half widths."""
        wanted = self._columns.T @ (residual + self._taken)
        found = np.zeros(len(wanted))
        free = np.ones(len(wanted), bool)
        for _ in range(len(wanted)):
            right = wanted[free] - self._normal[np.ix_(free, ~free)] @ found[~free]
            found[free] = np.linalg.solve(self._normal[np.ix_(free, free)], right)
            beyond = free & (np.abs(found) > BEYOND)
            if not beyond.any():
                break
            found[beyond] = np.sign(found[beyond]) * BEYOND
            free &= ~beyond
        return found

    def subtract_tolerances(self, residual: Array) -> Array:
        """The residual less what the tolerances take up."""
        return residual + self._columns @ (self._used - self.estimate_tolerances(residual))

    def project_out(self, responses: Array) -> Array:
        """Responses, shape (size, count), less what tolerances without bounds take up."""
        return responses - self._columns @ np.linalg.solve(
            self._normal, self._columns.T @ responses
        )

    def misfit(self, residual: Array) -> float:
        """min over tolerances of |residual − what they do|² + their prior."""
        found = self.estimate_tolerances(residual)
        left = residual + self._columns @ (self._used - found)
        return float(left @ left + PRIOR * found @ found)

    def strengths(self, responses: Array, residual: Array) -> tuple[Array, Array]:
        """Of each response alone, shape (size, count), the misfit's curvature and slope along it,
        halved: with all tolerances that are not at their bound free beside it."""
        found = self.estimate_tolerances(residual)
        free = np.abs(found) < BEYOND
        shared = self._columns[:, free].T @ responses
        taken = np.linalg.solve(self._normal[np.ix_(free, free)], shared)
        power = np.sum(responses**2, axis=0) - np.sum(shared * taken, axis=0)
        return power, responses.T @ (residual + self._columns @ (self._used - found))

    def normal_equations(self, jacobian: Array, residual: Array) -> tuple[Array, Array]:
        """Normal matrix and gradient of the misfit in parameters whose responses are the jacobian's
        columns, with all tolerances that are not at their bound free beside them."""
        found = self.estimate_tolerances(residual)
        free = np.abs(found) < BEYOND
        columns = self._columns[:, free]
        shared = columns.T @ jacobian
        normal = jacobian.T @ jacobian - shared.T @ np.linalg.solve(
            self._normal[np.ix_(free, free)], shared
        )
        return normal, jacobian.T @ (residual + self._columns @ (self._used - found))
