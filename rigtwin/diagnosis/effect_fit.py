"""Result of a fit of named effects: values, intervals, and how well they explain the data."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigtwin.components import Effect
from rigtwin.description.machine import Machine
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Values
from rigtwin.diagnosis.overlay import Overlay, overlay
from rigtwin.files import forbid_overwriting
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class FittedParameter:
    """One fitted value.

    Attributes
    ----------
    name : str
        Effect, and the parameter where the effect has several: `coulomb@elbow`.
    value : float
        Best value, in `unit`.
    low, high : float
        Ends of the 95 % interval, in `unit`. It assumes that the model is right but for these
        effects.
    nominal : float
        Value of the description, in `unit`.
    unit : str
        Unit of the values.
    """

    name: str
    value: float
    low: float
    high: float
    nominal: float
    unit: str


@dataclass(frozen=True)
class EffectFit:
    """Effects fitted to recordings.

    Attributes
    ----------
    effects : tuple of Effect
        Fitted effects.
    values : tuple of tuple of float
        Values of each effect, in the order of its parameters.
    parameters : tuple of FittedParameter
        The same values with names, intervals and units.
    covariance : Array
        Covariance of the values, shape (parameters, parameters).
    error_before, error_after : tuple of float
        Residual of each recording that was fitted, as a share of its signals' swing.
    held_out_before, held_out_after : tuple of float
        The same of each held-out recording.
    warnings : tuple of str
        Reasons to doubt a value: bounds, flat directions, several optima.
    machine : Machine
        The corrected machine.
    """

    effects: tuple[Effect, ...]
    values: Values
    parameters: tuple[FittedParameter, ...]
    covariance: Array = field(repr=False)
    error_before: tuple[float, ...]
    error_after: tuple[float, ...]
    held_out_before: tuple[float, ...]
    held_out_after: tuple[float, ...]
    warnings: tuple[str, ...]
    machine: Machine = field(repr=False)
    described: Machine = field(repr=False)
    evidence: Evidence = field(repr=False)
    held_out: Evidence | None = field(repr=False)

    def __getitem__(self, name: str) -> FittedParameter:
        """Return the parameter of a name."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(f"{name!r}; there are {', '.join(p.name for p in self.parameters)}")

    @property
    def correlation(self) -> Array:
        """Correlation of the values, shape (parameters, parameters)."""
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        # A fixed value has no deviation; the smallest number keeps its correlations finite.
        return self.covariance / np.outer(deviations, deviations)

    def overlays(self) -> tuple[Overlay, ...]:
        """Return every observed signal as measured, as nominal and as corrected."""
        return overlay(self.evidence, self.machine.plant, self.held_out)

    def save_mjcf(self, path: str | Path) -> tuple[str, ...]:
        """Write the machine's MJCF with the fitted values.

        Parameters
        ----------
        path
            New file; meshes and included files are looked for beside it.

        Returns
        -------
        tuple of str
            A line for each value that MJCF has no attribute for.
        """
        changes = [
            # A name is `kind@component`, followed by the parameter where the kind has several.
            Change(p.name.partition("@")[2].partition(" ")[0], _parameter(p.name), p.value)
            for p in self.parameters
        ]
        return write_mjcf(forbid_overwriting(path, *self.described.files), self.described, changes)


def _parameter(name: str) -> str:
    effect, _, parameter = name.partition(" ")
    return parameter or effect.partition("@")[0]
