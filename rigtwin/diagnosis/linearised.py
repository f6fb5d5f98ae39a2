"""Linearised fits: the misfit of a fit without some of its effects, from a single jacobian.

With the normal matrix N and gradient g at the fit, setting some parameters back by m_1 and
refitting the others moves these by

    m_2 = -N_22^-1 (g_2 + N_21 m_1).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect
from rigtwin.diagnosis.fit import Fit, Values, is_possible, split_values, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gauss_newton import DAMPING, take_derivatives
from rigtwin.numerics.arrays import Array

Reduced = tuple[float, tuple[Effect, ...], Values]
"""Misfit, remaining effects and their values after effects are left out."""


class Linearised:
    """Residual of a fit, linear in the parameters of its effects.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    fit
        Fit about which the residual is linearised.

    Attributes
    ----------
    fit
        Fit about which the residual is linearised.
    """

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        self._fitter, self.fit = fitter, fit
        sizes = [len(effect.kind.parameters) for effect in fit.effects]
        # Number of the effect that each parameter of the flat vector belongs to.
        self._owner = np.repeat(np.arange(len(sizes)), sizes)
        self._steps = np.concatenate([fitter.starts(effect).steps for effect in fit.effects])
        self._values = np.concatenate([np.asarray(values, float) for values in fit.values])
        self._bounds = fitter.bounds(fit.effects)

        def residual(vector: Array) -> Array:
            plant = with_values(fitter.plant, fit.effects, split_values(fit.effects, vector))
            return fitter.evidence.residual(plant)

        self._residual = residual(self._values)
        self._jacobian = take_derivatives(
            residual, self._values, self._residual, self._steps, self._bounds[1]
        )
        normal, self._gradient = fitter.space.normal_equations(self._jacobian, self._residual)
        # The same damping as in the fit keeps the matrix regular where a parameter has no response.
        self._normal = normal + np.diag(DAMPING * np.diag(normal) + 1e-12)

    def columns_of(self, subset: Sequence[int]) -> Array:
        """Return the responses to a step of each parameter of some effects, shape (size, n)."""
        return self._jacobian[:, np.isin(self._owner, subset)]

    def move(self, subset: Sequence[int], steps: Array) -> Values:
        """Return the values of some effects, moved by a number of steps each, within bounds."""
        moves = np.zeros(len(self._values))
        moves[np.isin(self._owner, subset)] = steps
        values = split_values(
            self.fit.effects, np.clip(self._values + moves * self._steps, *self._bounds)
        )
        return tuple(values[number] for number in subset)

    @property
    def misfit(self) -> float:
        """Misfit with all effects, once they are refitted to the fitter's own evidence."""
        return self._keep_only(range(len(self.fit.effects)))[0]

    def leave_out_each(self) -> list[Reduced]:
        """Leave out each effect in turn, and refit the others.

        Returns
        -------
        list of tuples
            Misfit, remaining effects and their values, the least misfit first. Sets in which an
            effect lacks the dry friction that it acts through are omitted.
        """
        reduced = [
            self._as_they_are(each) for each in self._leave_out(range(len(self.fit.effects)))
        ]
        return sorted(reduced, key=lambda result: result[0])

    def _as_they_are(self, reduced: Reduced) -> Reduced:
        """Return the remaining effects at their present values if that fits better.

        The way back to nominal is long for a limit that is hardly reached, and not linear.
        """
        misfit, effects, _ = reduced
        known = dict(zip(self.fit.effects, self.fit.values, strict=True))
        values = tuple(known[effect] for effect in effects)
        plant = with_values(self._fitter.plant, effects, values)
        simulated = self._fitter.space.misfit(self._fitter.evidence.residual(plant))
        return (simulated, effects, values) if simulated < misfit else reduced

    def eliminate(self) -> list[Reduced]:
        """Leave out one effect after another, always the one whose loss raises the misfit least.

        Returns
        -------
        list of tuples
            Misfit, remaining effects and their values, the largest set first.
        """
        remaining: Sequence[int] = range(len(self.fit.effects))
        path: list[Reduced] = []
        while len(remaining) > 1 and (fewer := self._leave_out(remaining)):
            path.append(fewer[0])
            effects = set(fewer[0][1])
            remaining = [n for n in remaining if self.fit.effects[n] in effects]
        return path

    def _leave_out(self, remaining: Sequence[int]) -> list[Reduced]:
        """Leave out each of the remaining effects, given by their numbers, in turn."""
        reduced = []
        for omitted in remaining:
            subset = [number for number in remaining if number != omitted]
            effects = tuple(self.fit.effects[number] for number in subset)
            if is_possible(effects, self._fitter.plant):
                misfit, values = self._keep_only(subset)
                reduced.append((misfit, effects, values))
        return sorted(reduced, key=lambda result: result[0])

    def _keep_only(self, subset: Sequence[int]) -> tuple[float, Values]:
        """Return misfit and values when only a subset of the effects is kept and refitted."""
        move = np.zeros(len(self._values))
        for number, effect in enumerate(self.fit.effects):
            if number not in subset:
                # An effect is absent if its magnitude is nominal; its shape is then irrelevant.
                first = int(np.nonzero(self._owner == number)[0][0])
                nominal = tuple(effect.nominal(self._fitter.plant).values())
                for place in range(effect.kind.magnitudes):
                    change = nominal[place] - self._values[first + place]
                    move[first + place] = change / self._steps[first + place]
        free = np.isin(self._owner, subset)
        right = self._gradient[free] + self._normal[np.ix_(free, ~free)] @ move[~free]
        move[free] = -np.linalg.solve(self._normal[np.ix_(free, free)], right)
        # The linear prediction suffices to rank subsets, and costs no simulation. The best of them
        # are fitted from these values, which therefore have to be within their bounds.
        misfit = self._fitter.space.misfit(self._residual + self._jacobian @ move)
        values = split_values(
            self.fit.effects, np.clip(self._values + move * self._steps, *self._bounds)
        )
        return misfit, tuple(values[number] for number in subset)
