"""A fit's residual, linear in the parameters of its effects: what the fit would leave without some
of them, at the price of one Jacobian."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, is_possible, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import DAMPING, take_derivatives
from rigtwin.numerics.arrays import Array

Reduced = tuple[float, tuple[Effect, ...], Values]
"""Misfit, effects and values of a fit with fewer effects."""


class Linearised:
    """A fit's residual, linear in the parameters of its effects."""

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        self._fitter, self._fit = fitter, fit
        self._sizes = [len(effect.kind.parameters) for effect in fit.effects]
        self._owner = np.repeat(np.arange(len(self._sizes)), self._sizes)
        self._steps = np.concatenate([fitter.starts(effect).steps for effect in fit.effects])
        self._here = np.concatenate([np.asarray(values, float) for values in fit.values])
        self._bounds = fitter.bounds(fit.effects)

        def residual(vector: Array) -> Array:
            plant = with_values(fitter.plant, fit.effects, self._split(vector))
            return fitter.evidence.residual(plant)

        self._left = residual(self._here)
        self._jacobian = take_derivatives(
            residual, self._here, self._left, self._steps, self._bounds[1]
        )
        normal, self._gradient = fitter.space.normal_equations(self._jacobian, self._left)
        self._normal = normal + np.diag(DAMPING * np.diag(normal) + 1e-12)

    def _split(self, vector: Array) -> Values:
        cuts = np.cumsum(self._sizes)[:-1]
        return tuple(tuple(part.tolist()) for part in np.split(vector, cuts))

    def leave_out_each(self) -> list[Reduced]:
        """Leave out each effect in turn, and take the others anew.

        Returns
        -------
        list of tuples
            Misfit, the other effects and their values, the least misfit first; without those in
            which an effect lacks what it acts through.
        """
        return self._leave_out(range(len(self._fit.effects)))

    def eliminate(self) -> list[Reduced]:
        """Leave out one effect after another, each time the one that is missed least.

        Returns
        -------
        list of tuples
            Misfit, the remaining effects and their values, the largest set first.
        """
        remaining: Sequence[int] = range(len(self._fit.effects))
        found: list[Reduced] = []
        while len(remaining) > 1 and (fewer := self._leave_out(remaining)):
            found.append(fewer[0])
            left = set(fewer[0][1])
            remaining = [n for n in remaining if self._fit.effects[n] in left]
        return found

    def _leave_out(self, remaining: Sequence[int]) -> list[Reduced]:
        found = []
        for out in remaining:
            rest = [number for number in remaining if number != out]
            effects = tuple(self._fit.effects[number] for number in rest)
            if is_possible(effects, self._fitter.plant):
                misfit, values = self._keep_only(rest)
                found.append((misfit, effects, values))
        return sorted(found, key=lambda each: each[0])

    def _keep_only(self, rest: Sequence[int]) -> tuple[float, Values]:
        move = np.zeros(len(self._here))
        for number, effect in enumerate(self._fit.effects):
            if number not in rest:
                # Of an effect that is not there only the magnitude says so.
                place = int(np.nonzero(self._owner == number)[0][0])
                nominal = effect.nominal(self._fitter.plant)[effect.kind.parameters[0]]
                move[place] = (nominal - self._here[place]) / self._steps[place]
        free = np.isin(self._owner, rest)
        right = self._gradient[free] + self._normal[np.ix_(free, ~free)] @ move[~free]
        move[free] = -np.linalg.solve(self._normal[np.ix_(free, free)], right)
        misfit = self._fitter.space.misfit(self._left + self._jacobian @ move)
        values = self._split(np.clip(self._here + move * self._steps, *self._bounds))
        return misfit, tuple(values[number] for number in rest)
