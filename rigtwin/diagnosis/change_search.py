"""Search for the parameters that differ between recordings.

Every parameter is tested as the only one that may differ, beside the effects that the joint
diagnosis names. The most promising ones are fitted with a value per recording; the one with the
smallest remaining χ² enters the model, and the search is repeated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.by_recording import ByRecording, RecordingEstimates
from rigtwin.diagnosis.change import ComparedParameter
from rigtwin.diagnosis.change_columns import list_parameters
from rigtwin.diagnosis.finding import Name
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.gap import Interval
from rigtwin.diagnosis.homogeneity import check_homogeneity, correct
from rigtwin.diagnosis.recording_equations import BLOCKS, FreeParameter
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

ROUNDS = 4
"""Largest number of Gauss-Newton steps of a parameter's values in all recordings."""
FOLLOWED = 6
"""Number of parameters that are fitted with a value per recording in each round."""
CONVERGED = 1e-3
"""Share of the remaining χ² that a step must gain for another to follow."""
STEP_SHARES = (1.0, 0.5, 0.2)
"""Shares of a step that are tried in turn until χ² falls."""
FREEDOM = float(BLOCKS - 1)
"""Degrees of freedom of each standard error: those of a jackknife over `BLOCKS` blocks."""


@dataclass(frozen=True)
class _TestedParameter:
    """A parameter as the only one that may differ, to first order.

    Attributes
    ----------
    number
        Index of the parameter.
    estimate
        Values in all recordings.
    statistic
        Cochran's Q of these values.
    probability
        Its p-value, corrected for the number of tests.
    without
        χ² that remains if the parameter is the same in all recordings.
    """

    number: int
    estimate: RecordingEstimates
    statistic: float
    probability: float
    without: float


@dataclass(frozen=True)
class _FittedParameter:
    """A parameter after its values were fitted in every recording.

    Attributes
    ----------
    tested
        Test at the fitted values.
    values
        Fitted values, SI, shape (recordings,).
    misfit
        Remaining χ².
    plants
        Plants with these values, one per recording.
    """

    tested: _TestedParameter
    values: Array
    misfit: float
    plants: tuple[Plant, ...]


@dataclass(frozen=True)
class ChangeModel:
    """Result of one search.

    Attributes
    ----------
    parameters
        Parameters that changed, then those of the named effects.
    undetermined
        Effects for which the recordings cannot show a change.
    tested
        Number of parameters that were tested.
    misfit
        Remaining χ².
    """

    parameters: tuple[ComparedParameter, ...]
    undetermined: tuple[Name, ...]
    tested: int
    misfit: float

    def cost(self, pieces: float, price: float) -> float:
        """Return n ln χ² plus a price for each change, with n independent samples.

        Parameters
        ----------
        pieces
            Number of independent samples n.
        price
            Price of one change.

        Returns
        -------
        float
            Cost by which searches from different starts are compared, as in an information
            criterion with unknown variance.
        """
        count = sum(parameter.verdict == "changed" for parameter in self.parameters)
        return pieces * math.log(max(self.misfit, 1e-300)) + price * count


class ChangeSearch:
    """Search for parameters that differ between the recordings of a joint diagnosis."""

    def __init__(
        self, together: Diagnosis, thresholds: Thresholds, start: Diagnosis | None = None
    ) -> None:
        """Prepare the search.

        Parameters
        ----------
        together
            Joint diagnosis of all recordings.
        thresholds
            Thresholds of the comparison.
        start
            Diagnosis whose effects and values the search starts from. Defaults to `together`.

        Raises
        ------
        RigtwinError
            If the recordings cannot be diagnosed.
        """
        if together.evidence is None:
            raise RigtwinError(together.sentence)
        start = start or together
        self.together, self.evidence, self.thresholds = together, together.evidence, thresholds
        self.machine = self.evidence.machine
        self.count = len(self.evidence.recordings)
        self.plant: Plant = start.corrected.plant
        # A joint model that leaves only noise is right for every recording unless a test is sure.
        self._settled = start is together and together.verdict in ("no gap", "explained")
        named = {str(effect.name) for effect in start.effects}
        self._fitter = Fitter(self.evidence)
        searched = [effect for effect in self.machine.effects() if effect.searched]
        self._named = [effect for effect in searched if effect.name in named]
        candidates = [effect for effect in searched if effect not in self._named]
        self.columns = list_parameters(self._fitter, self._named, candidates, self.plant)
        # All recordings start from one plant. Their plants part when a change is accepted
        # (`compare`).
        self._linearise([self.plant] * self.count)
        self.pieces = float(self._equations.pieces.sum())
        self._common = [n for n, c in enumerate(self.columns) if c.effect in self._named]
        self._nuisances = [n for n, c in enumerate(self.columns) if c.kind != "effect"]

    def _linearise(self, plants: Sequence[Plant]) -> None:
        """Take all responses about these plants, one per recording."""
        self._plants = tuple(plants)
        self._equations = ByRecording.at(self.evidence, self._plants, self.columns)

    def differing_zeros(self) -> dict[str, Array]:
        """Return the sensors whose zero surely differs between recordings.

        Returns
        -------
        dict
            Sensor → deviation of its zero from the weighted mean, SI, shape (recordings,).
        """
        differing = {}
        zeros = [n for n in self._nuisances if self.columns[n].kind == "zero"]
        for number in zeros:
            nuisances = [n for n in self._nuisances if n != number]
            estimate = self._equations.estimate(number, self._common, nuisances)
            test = check_homogeneity(estimate.moves, estimate.widths, FREEDOM)
            if test.probability < self.thresholds.change_probability:
                # Only differences of a zero are known here. Its mean over all recordings may be an
                # effect, which the joint diagnosis fits.
                moves = (estimate.moves - test.mean) * self.columns[number].step
                differing[self.columns[number].group] = moves
        return differing

    def compare(self) -> ChangeModel:
        """Test every parameter, and fit those that differ with a value per recording.

        Returns
        -------
        ChangeModel
            Parameters that changed, and those that did not.
        """
        free, changes = list(self._nuisances), []
        candidates, invisible = self._sort_by_visibility()
        changed: list[int] = []
        misfit = self._misfit(self._plants)
        while len(changed) < self.thresholds.most_changes:
            tests = self._test([n for n in candidates if n not in changed], free)
            # A joint model that leaves a gap may be far off every recording. The linear tests are
            # then not decisive, and the best candidates are fitted in any case.
            if (changed or self._settled) and not any(self._is_certain(test) for test in tests):
                break
            best, fitted = self._fit_best(tests, free)
            pieces = float(self._equations.pieces.sum())
            if (
                best is None
                or (misfit / best.misfit - 1.0) * pieces <= self.thresholds.rival_change_chi_square
            ):
                break
            alternatives = [
                rival.tested.number for rival in fitted if self._is_as_good(rival, best)
            ]
            changes.append(self._describe(best.tested, best.values, alternatives))
            changed.append(best.tested.number)
            # From here on the change is a nuisance, so that no later test explains the same
            # difference again.
            free.append(best.tested.number)
            misfit = best.misfit
            self._linearise(best.plants)
        unchanged = self._describe_unchanged(candidates, invisible, changed, free)
        names = dict.fromkeys(
            Name(effect.component, effect.kind.name)
            for number in invisible
            if (effect := self.columns[number].effect) is not None and effect not in self._named
        )
        return ChangeModel((*changes, *unchanged), tuple(names), len(candidates), misfit)

    def _sort_by_visibility(self) -> tuple[list[int], list[int]]:
        """Parameters of effects that every recording shows, and those that some do not show."""
        visible, invisible = [], []
        for number, column in enumerate(self.columns):
            if column.kind != "effect":
                continue
            nuisances = [n for n in (*self._common, *self._nuisances) if n != number]
            shares = self._equations.visible_share(number, nuisances)
            # One recording that does not show the parameter spoils a comparison, so the smallest
            # share counts.
            (invisible if np.min(shares) < self.thresholds.observable_share else visible).append(
                number
            )
        return visible, invisible

    def _fit_best(
        self, tests: list[_TestedParameter], free: Sequence[int]
    ) -> tuple[_FittedParameter | None, list[_FittedParameter]]:
        """Fit the most promising parameters; the best one, and all that surely differ."""
        # The linear prediction only preselects: the order after the fit may be another.
        tests = sorted(tests, key=lambda test: test.estimate.misfit)
        count = len(tests)
        with Threads() as threads:
            fitted = threads.spread(lambda test: self._fit(test, free, count), tests[:FOLLOWED])
        fitted = [candidate for candidate in fitted if self._is_certain(candidate.tested)]
        return min(fitted, key=lambda candidate: candidate.misfit, default=None), fitted

    def _describe_unchanged(
        self,
        candidates: Sequence[int],
        invisible: Sequence[int],
        changed: Sequence[int],
        free: Sequence[int],
    ) -> list[ComparedParameter]:
        """Parameters of the named effects that did not change or cannot be determined."""
        testable = [n for n in self._common if n in candidates and n not in changed]
        tests = {test.number: test for test in self._test(testable, free)}
        return [
            self._describe_undetermined(number)
            if number in invisible
            else self._describe(tests[number])
            for number in self._common
            if number not in changed
        ]

    def _test(self, numbers: Sequence[int], free: Sequence[int]) -> list[_TestedParameter]:
        """Test each parameter as the only one that may differ, beside those that are free."""
        estimates = [
            self._equations.estimate(
                number, [n for n in self._common if n not in (number, *free)], free
            )
            for number in numbers
        ]
        tests = [check_homogeneity(each.moves, each.widths, FREEDOM) for each in estimates]
        return [
            _TestedParameter(
                number, estimate, test.statistic, probability, self._misfit_if_same(free, number)
            )
            for number, estimate, test, probability in zip(
                numbers, estimates, tests, correct([t.probability for t in tests]), strict=True
            )
        ]

    def _misfit_if_same(self, free: Sequence[int], number: int) -> float:
        """χ² that remains if a parameter has one value for all recordings."""
        common = [n for n in self._common if n not in free]
        if number not in common:
            common.append(number)
        return self._equations.estimate(None, common, free).misfit

    def _is_material(self, test: _TestedParameter) -> bool:
        """Return whether a change lowers the error noticeably, where more than noise remains.

        A rough model's error is no noise, so a test may be sure of a trifle. The gain is the
        logarithm of the ratio of rms residuals, 0.5 ln(χ²_same / χ²_different).
        """
        if self._settled:
            return True
        gain = 0.5 * float(np.log(test.without / max(test.estimate.misfit, 1e-300)))
        return gain >= self.thresholds.change_log_error

    def _is_certain(self, test: _TestedParameter) -> bool:
        """Return whether a parameter surely differs, by a noticeable amount."""
        return test.probability < self.thresholds.change_probability and self._is_material(test)

    def _is_as_good(self, rival: _FittedParameter, best: _FittedParameter) -> bool:
        """Return whether the change of another parameter explains as much as the best one."""
        if rival is best:
            return False
        ratio = rival.misfit / max(best.misfit, 1e-300)
        # A rough model's error changes with any parameter, so there a rival may also be worse by as
        # much as a change has to gain.
        margin = 0.0 if self._settled else self.thresholds.change_log_error
        pieces = float(self._equations.pieces.sum())
        return (
            0.5 * np.log(ratio) <= margin
            or (ratio - 1.0) * pieces <= self.thresholds.rival_change_chi_square
        )

    def _describe(
        self,
        test: _TestedParameter,
        fitted: Array | None = None,
        alternatives: Sequence[int] = (),
    ) -> ComparedParameter:
        """Describe a parameter.

        fitted: values of a parameter that differs, SI, shape (recordings,); None for one that does
        not; alternatives: parameters whose change explains as much.
        """
        column = self.columns[test.number]
        effect = column.effect
        assert effect is not None
        estimate = test.estimate
        values = fitted
        if values is None:
            values = self._values(column, self._plants) + estimate.moves * column.step
        half_widths = estimate.widths * abs(column.step) * self.thresholds.interval_half_width
        rivals = (self.columns[number].effect for number in alternatives)
        return ComparedParameter(
            name=Name(effect.component, effect.kind.name),
            parameter=column.parameter,
            unit=self.machine.unit(column.group, effect.quantities()[column.parameter]),
            values=tuple(
                Interval(float(value), float(value - half), float(value + half))
                for value, half in zip(values, half_widths, strict=True)
            ),
            statistic=test.statistic,
            probability=test.probability,
            verdict="same" if fitted is None else "changed",
            alternatives=tuple(
                dict.fromkeys(
                    Name(rival.component, rival.kind.name)
                    for rival in rivals
                    if rival is not None and rival != effect
                )
            ),
        )

    @staticmethod
    def _values(column: FreeParameter, plants: Sequence[Plant]) -> Array:
        return np.array([column.value_in(plant) for plant in plants])

    def _fit(self, test: _TestedParameter, free: Sequence[int], count: int) -> _FittedParameter:
        """Fit a parameter with a value per recording by Gauss-Newton.

        count: number of parameters tested at once, for Bonferroni's correction of the p-value.
        """
        number = test.number
        shared = [n for n in self._common if n != number and n not in free]
        # The order is that of the steps in `_shift_plant`: the tested parameter, then the common
        # ones. The nuisances after them stay at the plant's values.
        chosen = [self.columns[n] for n in (number, *shared, *free)]
        common = range(1, 1 + len(shared))
        nuisances = range(1 + len(shared), len(chosen))
        plants = list(self._plants)
        misfit = self._misfit(plants)
        for _ in range(ROUNDS):
            estimate = ByRecording.at(self.evidence, plants, chosen).estimate(0, common, nuisances)
            for share in STEP_SHARES:
                trial = [
                    _shift_plant(plant, chosen, share * np.array([move, *estimate.common]))
                    for plant, move in zip(plants, estimate.moves, strict=True)
                ]
                if (trial_misfit := self._misfit(trial)) < misfit:
                    break
            else:
                # No share of the step lowers χ²: the linear model is exhausted.
                break
            gained, plants, misfit = misfit - trial_misfit, trial, trial_misfit
            if gained < CONVERGED * misfit:
                break
        # The errors and the test are taken anew at the fitted values.
        values = self._values(chosen[0], plants)
        last = ByRecording.at(self.evidence, plants, chosen).estimate(0, common, nuisances)
        homogeneity = check_homogeneity(values, last.widths * abs(chosen[0].step), FREEDOM)
        refined = replace(
            test,
            # The moves of the linear test are kept, but not used: `_describe` gets the fitted
            # values.
            estimate=replace(test.estimate, widths=last.widths),
            statistic=homogeneity.statistic,
            # Bonferroni's correction and not Holm's: Holm needs the probabilities of all
            # candidates, and only a few were fitted.
            probability=min(count * homogeneity.probability, 1.0),
        )
        return _FittedParameter(refined, values, misfit, tuple(plants))

    def _misfit(self, plants: Sequence[Plant]) -> float:
        """χ² that plants leave after zeros and tolerances are fitted."""
        nuisances = [self.columns[n] for n in self._nuisances]
        # Misfits of different plants are compared, so they need a common unit: noise and declared
        # error.
        equations = ByRecording.at(self.evidence, plants, nuisances, relative=False)
        return equations.estimate(None, (), range(len(nuisances))).misfit

    def _describe_undetermined(self, number: int) -> ComparedParameter:
        column = self.columns[number]
        assert column.effect is not None
        quantity = column.effect.quantities()[column.parameter]
        return ComparedParameter(
            name=Name(column.effect.component, column.effect.kind.name),
            parameter=column.parameter,
            unit=self.machine.unit(column.group, quantity),
            values=(),
            statistic=float("nan"),
            probability=float("nan"),
            verdict="cannot tell",
            why="not every recording distinguishes it from zeros, tolerances and other effects",
        )


def _shift_plant(plant: Plant, columns: Sequence[FreeParameter], steps: Array) -> Plant:
    """Plant with the first columns shifted by their steps; the nuisances after them stay."""
    return reduce(
        lambda shifted, step: step[0].shift(shifted, float(step[1])),
        zip(columns, steps, strict=False),
        plant,
    )
