"""Estimate a parameter in each of several recordings by linear least squares.

The residual of recording r is linearised about one plant per recording,

    e_r(θ) ≈ e_r - J_r θ_r,

and its normal equations are kept for each recording and each stretch of time. Some parameters are
common to all recordings, one may take a value per recording, and nuisance parameters (zeros of
sensors, tolerances) are eliminated recording by recording through the Schur complement. Stretches
of time make a jackknife of the standard errors cheap: it only adds up other normal equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.recording_equations import FreeParameter, assemble, equations_of
from rigtwin.diagnosis.space import PRIOR
from rigtwin.numerics.arrays import Array

RIDGE = 1e-9
"""Share of the normal matrix' diagonal that is added to it.

A parameter without any response would make the matrix singular."""


@dataclass(frozen=True)
class RecordingEstimates:
    """Estimates of one parameter in every recording.

    Attributes
    ----------
    moves
        Deviation from the plant of each recording, in steps, shape (recordings,).
    widths
        Standard errors of `moves`, in steps, shape (recordings,).
    common
        Deviation of the common parameters, in steps, shape (common,).
    misfit
        Remaining χ², in units of the plants' own residual power where `relative` was chosen.
    """

    moves: Array
    widths: Array
    common: Array
    misfit: float


@dataclass(frozen=True)
class ByRecording:
    """Normal equations of every stretch of every recording.

    Attributes
    ----------
    columns
        Free parameters.
    normal
        JᵀJ, shape (recordings, blocks, columns, columns).
    gradient
        Jᵀe, the direction of descent, shape (recordings, blocks, columns).
    power
        eᵀe, shape (recordings, blocks).
    pieces
        Number of independent samples in the residual of each recording, shape (recordings,).
    """

    columns: tuple[FreeParameter, ...]
    normal: Array
    gradient: Array
    power: Array
    pieces: Array

    @classmethod
    def at(
        cls,
        evidence: Evidence,
        plants: Sequence[Plant],
        columns: Sequence[FreeParameter],
        relative: bool = True,
    ) -> ByRecording:
        """Linearise the residuals about one plant per recording.

        Parameters
        ----------
        evidence
            Recordings.
        plants
            One plant for each recording.
        columns
            Parameters that may deviate.
        relative
            Whether χ² is in units of the residual that the plant of each recording leaves, so that
            the error of a rough model is no evidence. Otherwise it is in units of noise and
            declared error. Default True.

        Returns
        -------
        ByRecording
            Normal equations.
        """
        equations = [
            equations_of(evidence, number, plant, columns, relative)
            for number, plant in enumerate(plants)
        ]
        normal, gradient, power, pieces = (np.stack(part) for part in zip(*equations, strict=True))
        return cls(tuple(columns), normal, gradient, power, pieces)

    @property
    def total(self) -> float:
        """χ² of the plants' residuals."""
        return float(self.power.sum())

    def visible_share(self, number: int, nuisances: Sequence[int]) -> Array:
        """Return the share of a parameter's response that nuisance parameters cannot imitate.

        Parameters
        ----------
        number
            Column of the parameter.
        nuisances
            Columns of the nuisance parameters.

        Returns
        -------
        array
            Shares, 0 to 1, shape (recordings,); 0 where the parameter has no response.
        """
        rest = [column for column in nuisances if column != number]
        shares = []
        for whole in self.normal.sum(axis=1):
            response = whole[number, number]
            inner = whole[np.ix_(rest, rest)] + self._prior(rest, whole)
            # b' A^-1 b is the part of the response's power that the nuisances imitate within their
            # priors. The visible share is 1 - R², with the multiple correlation R of the response
            # and theirs.
            imitated = whole[rest, number] @ np.linalg.solve(inner, whole[rest, number])
            shares.append(max(response - imitated, 0.0) / response if response > 0.0 else 0.0)
        return np.array(shares)

    def estimate(
        self, tested: int | None, common: Sequence[int], nuisances: Sequence[int]
    ) -> RecordingEstimates:
        """Estimate one parameter in each recording.

        Parameters
        ----------
        tested
            Column of the parameter that may differ between recordings. None for no such parameter.
        common
            Columns with one value for all recordings.
        nuisances
            Columns with a value per recording that is of no interest: zeros, tolerances.

        Returns
        -------
        RecordingEstimates
            Estimates. Their standard errors come from the jackknife over stretches of time, or from
            the number of independent samples where that gives wider ones.
        """
        whole, right = self.normal.sum(axis=1), self.gradient.sum(axis=1)
        columns = [*common] if tested is None else [*common, tested]
        # The nuisances lower χ² even where no other parameter moves; `_reduce` counts that too.
        parts = [self._reduce(n, g, columns, nuisances) for n, g in zip(whole, right, strict=True)]
        moves, shared, gained = assemble(parts, len(common))
        misfit = self.total - gained
        if tested is None:
            return RecordingEstimates(moves, np.zeros(len(parts)), shared, misfit)
        # Variance of the estimate: residual variance per independent sample over the information.
        formal = []
        for number, (inner, _, _) in enumerate(parts):
            share = float(self.power[number].sum())
            # The tested column is the last one, and the nuisances are eliminated. The common
            # parameters count as known here; their part of the error is in the jackknife.
            information = max(inner[-1, -1], 1e-300)
            formal.append(
                share * misfit / max(self.total, 1e-300) / self.pieces[number] / information
            )
        jackknife = self._jackknife(parts, columns, nuisances, len(common))
        widths = np.maximum(np.sqrt(np.array(formal)), jackknife)
        return RecordingEstimates(moves, widths, shared, misfit)

    def _jackknife(
        self,
        parts: list[tuple[Array, Array, float]],
        columns: Sequence[int],
        nuisances: Sequence[int],
        common: int,
    ) -> Array:
        """Standard errors by the delete-one-block jackknife, shape (recordings,).

        Each recording loses one block of n in turn; the variance is (n - 1)/n Σ (θ_b - mean θ)².
        The blocks of one recording also move the estimates of the others through the common
        parameters, so the variances of all recordings add.
        """
        variance = np.zeros(len(parts))
        blocks = self.normal.shape[1]
        for number in range(len(parts)):
            estimates = []
            for block in range(blocks):
                remaining = np.arange(blocks) != block
                part = self._reduce(
                    self.normal[number, remaining].sum(axis=0),
                    self.gradient[number, remaining].sum(axis=0),
                    columns,
                    nuisances,
                )
                changed = [*parts[:number], part, *parts[number + 1 :]]
                estimates.append(assemble(changed, common)[0])
            moves = np.stack(estimates)
            variance += (blocks - 1) / blocks * np.sum((moves - moves.mean(axis=0)) ** 2, axis=0)
        return np.sqrt(variance)

    def _prior(self, numbers: Sequence[int], whole: Array) -> Array:
        """Prior precision of columns: a Gaussian for a tolerance, a ridge for every other one."""
        costs = [
            PRIOR
            if self.columns[number].kind == "tolerance"
            else RIDGE * whole[number, number] + 1e-12
            for number in numbers
        ]
        return np.diag(np.array(costs)) if costs else np.zeros((0, 0))

    def _reduce(
        self, whole: Array, right: Array, columns: Sequence[int], nuisances: Sequence[int]
    ) -> tuple[Array, Array, float]:
        """Normal matrix and gradient after the nuisances are eliminated, and the χ² they gain.

        The Schur complement N_cc - N_cn N_nn^-1 N_nc is the information on the columns when the
        nuisances are free.
        """
        # The minimum over t of t' N t - 2 g' t is -g' N^-1 g: by so much the nuisances lower χ².
        inner = whole[np.ix_(nuisances, nuisances)] + self._prior(nuisances, whole)
        cross = whole[np.ix_(nuisances, columns)]
        solved = np.linalg.solve(inner, np.column_stack([cross, right[nuisances]]))
        normal = whole[np.ix_(columns, columns)] - cross.T @ solved[:, :-1]
        return (
            normal + self._prior(columns, whole),
            right[columns] - cross.T @ solved[:, -1],
            float(right[nuisances] @ solved[:, -1]),
        )
