"""Whitened residual of some evidence as a function of the values of fitted effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Values, with_values
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class EffectResidual:
    """Whitened residual as a function of one vector with the values of all effects.

    Attributes
    ----------
    evidence
        Recordings that are predicted.
    base
        Plant without the effects.
    effects
        Effects whose values the vector holds, one after another.
    """

    evidence: Evidence
    base: Plant
    effects: tuple[Effect, ...]

    @cached_property
    def sizes(self) -> list[int]:
        """Number of values of each effect."""
        return [len(effect.kind.parameters) for effect in self.effects]

    @staticmethod
    def join(values: Sequence[Sequence[float]]) -> Array:
        """Return the values of all effects as one vector, shape (parameters,)."""
        return np.array([value for numbers in values for value in numbers], np.float64)

    def split(self, vector: Array) -> Values:
        """Cut a vector into the values of each effect."""
        ends = np.cumsum([0, *self.sizes])
        return tuple(tuple(vector[first:last].tolist()) for first, last in pairwise(ends))

    def plant(self, vector: Array) -> Plant:
        """Return the plant with the effects."""
        return with_values(self.base, self.effects, self.split(vector))

    def __call__(self, vector: Array) -> Array:
        """Return the whitened residual, shape (size,)."""
        return self.evidence.residual(self.plant(vector))

    def near(self, vector: Array, at: Array) -> Array:
        """Return the whitened residual to first order in the distance from the values `at`."""
        return self.evidence.residual_near(self.plant(vector), self.plant(at))
