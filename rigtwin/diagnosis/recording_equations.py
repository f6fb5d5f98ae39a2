"""Linear equations of parameters that may differ between recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant, parameter_of, with_parameters
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.spikes import JUMPS, SPIKE, despike
from rigtwin.numerics.arrays import Array

BLOCKS = 10
"""Stretches of each recording that the jackknife leaves out in turn."""


@dataclass(frozen=True)
class FreeParameter:
    """Parameter that may deviate from the plant, one column of the Jacobian.

    Attributes
    ----------
    kind
        "effect" for a parameter of an effect, "zero" for the zero of a sensor, "tolerance" for a
        declared tolerance, in half widths.
    group
        Component that has the parameter.
    parameter
        Name of the parameter.
    step
        Step of the finite difference, in the parameter's SI unit.
    effect
        Effect that the parameter belongs to. None for zeros and tolerances.
    companions
        Names and values of the effect's other parameters, where the plant lacks the effect.
    """

    kind: str
    group: str
    parameter: str
    step: float
    effect: Effect | None = None
    companions: tuple[tuple[str, float], ...] = ()

    def value_in(self, plant: Plant) -> float:
        """Return the parameter's value in a plant, SI."""
        return parameter_of(plant, self.group, self.parameter)

    def shift(self, plant: Plant, steps: float) -> Plant:
        """Return a plant with this parameter raised by a number of steps, within its bounds."""
        value = self.value_in(plant) + steps * self.step
        if self.effect is not None:
            quantity = self.effect.quantities()[self.parameter]
            value = min(max(value, quantity.low), quantity.high)
        return with_parameters(plant, self.group, {self.parameter: value, **dict(self.companions)})


def assemble(
    parts: Sequence[tuple[Array, Array, float]], common: int
) -> tuple[Array, Array, float]:
    """Solve for the tested parameter of each recording and the common ones.

    Parameters
    ----------
    parts
        Normal matrix, gradient and χ² already gained of each recording. The common columns come
        first, then the tested one if there is any.
    common
        Number of common columns.

    Returns
    -------
    tuple
        Tested values, shape (recordings,), common values, shape (common,), and the χ² gained.
    """
    shared, right = np.zeros((common, common)), np.zeros(common)
    is_tested = len(parts[0][1]) > common
    gained = 0.0
    # The tested parameter of each recording is eliminated first, again by the Schur complement.
    for normal, gradient, nuisance_gain in parts:
        cross, pivot = normal[:common, common:], normal[common:, common:]
        shared += normal[:common, :common]
        right += gradient[:common]
        gained += nuisance_gain
        if is_tested:
            shared -= cross @ cross.T / pivot[0, 0]
            right -= cross[:, 0] * gradient[common] / pivot[0, 0]
            gained += float(gradient[common] ** 2 / pivot[0, 0])
    # Two common parameters may be confounded, so the shared matrix may be singular.
    values = np.linalg.lstsq(shared, right, rcond=1e-12)[0] if common else np.zeros(0)
    gained += float(right @ values)
    moves = np.array(
        [
            (gradient[common] - normal[common, :common] @ values) / normal[common, common]
            if is_tested
            else 0.0
            for normal, gradient, _ in parts
        ]
    )
    return moves, values, gained


def differences_of(evidence: Evidence, number: int, plant: Plant) -> Array:
    """Return the residual of one recording without spikes.

    Parameters
    ----------
    evidence
        Recordings.
    number
        Index of the recording.
    plant
        Plant that predicts the signals.

    Returns
    -------
    array
        Measured minus predicted, SI, shape (rows, ticks).
    """
    lines = evidence.lines[number]
    difference = lines.measured - evidence.models[number].predict(plant)
    for row, meaning in enumerate(evidence.machine.rows):
        # Signals that jump, such as dry friction at a reversal, spike where a jump is a tick late.
        if meaning.kind in JUMPS:
            despike(difference[row], SPIKE * float(lines.noise[row]))
    return difference


def equations_of(
    evidence: Evidence, number: int, plant: Plant, columns: Sequence[FreeParameter], relative: bool
) -> tuple[Array, Array, Array, float]:
    """Normal matrix, gradient and power of each block, and the number of independent samples."""
    lines = evidence.lines[number]
    forms = np.array([evidence.machine.form_of(row) for row in evidence.machine.rows])
    # Noise and declared model error are independent, so their variances add. The error is declared
    # as a share of the signal's standard deviation.
    scale = np.sqrt(lines.noise**2 + (forms * np.std(lines.measured, axis=1)) ** 2)
    weight = lines.fade / scale[:, None]
    residual = weight * differences_of(evidence, number, plant)
    jacobian = []
    for column in columns:
        sign = 1.0
        changed = column.shift(plant, sign)
        # A step that a bound cuts short is taken to the other side instead.
        if abs(column.value_in(changed) - column.value_in(plant)) < 0.5 * abs(column.step):
            sign, changed = -1.0, column.shift(plant, -1.0)
        # The residual is measured minus predicted, so e(θ) - e(θ + step) is the response of the
        # prediction. Solving JᵀJ θ = Jᵀe then needs no minus sign.
        jacobian.append(sign * (residual - weight * differences_of(evidence, number, changed)))
    # With a relative unit every recording has a χ² of 1 per sample at its own plant. A recording
    # that the model fits badly then does not outvote the others.
    unit = max(float(np.sqrt(np.mean(residual**2))), 1e-300) if relative else 1.0
    flat = np.stack([*jacobian, residual]) / unit
    # Blocks much longer than the correlation of the residual are nearly independent, which the
    # jackknife requires.
    cuts = np.linspace(0, flat.shape[2], BLOCKS + 1).astype(int)
    # One product per block holds JᵀJ, Jᵀe and eᵀe: the residual is its last row and column.
    products = np.stack(
        [
            (block := flat[:, :, low:high].reshape(len(flat), -1)) @ block.T
            for low, high in pairwise(cuts)
        ]
    )
    return (
        products[:, :-1, :-1],
        products[:, :-1, -1],
        products[:, -1, -1],
        _count_independent(residual),
    )


def _count_independent(residual: Array) -> float:
    """Number of independent samples of a residual, shape (rows, ticks).

    The power of white noise is exponentially distributed over its n spectral lines, for which
    (Σ P)² / Σ P² = n / 2. Each line stands for two real numbers: hence the factor 4.
    """
    power = np.abs(np.fft.rfft(residual, axis=1)) ** 2
    return max(4.0 * float(power.sum()) ** 2 / max(float((power**2).sum()), 1e-300), 4.0)
