"""Looks for the parameters that have not one value in all recordings: each as the only one that may
differ, beside what the diagnosis of all together names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.by_recording import BLOCKS, ByRecording, Column, Estimate
from rigtwin.diagnosis.change import Parameter
from rigtwin.diagnosis.change_columns import columns_of
from rigtwin.diagnosis.finding import Interval, Name
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.homogeneity import check_homogeneity, correct
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.threads import Threads
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

ROUNDS = 4
"""Times that responses are taken anew at the values of each recording."""
FOLLOWED = 6
"""Parameters that are followed to each recording's own value."""
SMALL = 1e-3
"""Share of what is left that a step must gain to be followed by another."""
PARTS = (1.0, 0.5, 0.2)
"""Shares of a step that are tried."""


@dataclass(frozen=True)
class _Tested:
    number: int
    estimate: Estimate
    statistic: float
    probability: float
    without: float


@dataclass(frozen=True)
class _Followed:
    """A parameter's values in each recording, tested anew there, the χ² that they leave, and the
    plants that have them."""

    tested: _Tested
    values: Array
    left: float
    plants: tuple[Plant, ...]


@dataclass(frozen=True)
class Compared:
    """parameters: those that changed and those that are named; unseen: effects of which nobody can
    tell; tested: how many were; left: χ² that stays."""

    parameters: tuple[Parameter, ...]
    unseen: tuple[Name, ...]
    tested: int
    left: float

    def cost(self, pieces: float, price: float) -> float:
        """What stays, as χ² of so many independent pieces, and a price for each change."""
        count = sum(each.verdict == "changed" for each in self.parameters)
        return pieces * math.log(max(self.left, 1e-300)) + price * count


class ChangeSearch:
    """Looks for parameters that are not the same in all recordings."""

    def __init__(
        self, together: Diagnosis, thresholds: Thresholds, start: Diagnosis | None = None
    ) -> None:
        """start: whose effects and values the search starts from, by default those of all
        together."""
        if together.evidence is None:
            raise RigtwinError(together.sentence)
        start = start or together
        self.together, self.evidence, self.thresholds = together, together.evidence, thresholds
        self.machine = self.evidence.machine
        self.count = len(self.evidence.recordings)
        self.plant: Plant = start.corrected.plant
        self._settled = start is together and together.verdict in ("no gap", "explained")
        named = {str(effect.name) for effect in start.effects}
        self._fitter = Fitter(self.evidence)
        searched = [effect for effect in self.machine.effects() if effect.searched]
        self._named = [effect for effect in searched if effect.name in named]
        self._others = [effect for effect in searched if effect not in self._named]
        self.columns = columns_of(self._fitter, self._named, self._others, self.plant)
        self._stand([self.plant] * self.count)
        self.pieces = float(self._equations.pieces.sum())
        self._common = [n for n, c in enumerate(self.columns) if c.effect in self._named]
        self._own = [n for n, c in enumerate(self.columns) if c.kind != "effect"]

    def _stand(self, plants: Sequence[Plant]) -> None:
        """Takes all responses at these plants, one a recording."""
        self._plants = tuple(plants)
        self._equations = ByRecording.at(self.evidence, self._plants, self.columns)

    def _freedom(self) -> float:
        return float(BLOCKS - 1)

    def differing_zeros(self) -> dict[str, Array]:
        """Sensors whose zeros differ surely from recording to recording, with how far they are
        off the mean, in the sensor's unit."""
        found = {}
        zeros = [n for n in self._own if self.columns[n].kind == "zero"]
        for number in zeros:
            own = [other for other in self._own if other != number]
            estimate = self._equations.estimate(number, self._common, own)
            tested = check_homogeneity(estimate.moves, estimate.widths, self._freedom())
            if tested.probability < self.thresholds.change_probability:
                moves = (estimate.moves - tested.mean) * self.columns[number].step
                found[self.columns[number].group] = moves
        return found

    def compare(self) -> Compared:
        """Tests every parameter, and follows those that are not the same."""
        own, found, unseen = list(self._own), [], []
        candidates = []
        for number, column in enumerate(self.columns):
            if column.kind != "effect":
                continue
            others = [n for n in (*self._common, *own) if n != number]
            if np.min(self._equations.seen(number, others)) < self.thresholds.observable_share:
                unseen.append(number)
            else:
                candidates.append(number)
        changed: list[int] = []
        left = self._left(self._plants)
        while len(changed) < self.thresholds.most_changes:
            tests = self._test([n for n in candidates if n not in changed], own)
            # One model for all that leaves a gap may be so far off each that no test there is sure.
            if (changed or self._settled) and not any(self._is_sure(each) for each in tests):
                break
            # What promises most at the plants of before need not be what leaves least.
            tests.sort(key=lambda each: each.estimate.left)
            count = len(tests)
            with Threads() as threads:
                followed = threads.spread(
                    lambda each: self._follow(each, own, count),  # noqa: B023
                    tests[:FOLLOWED],
                )
            followed = [each for each in followed if self._is_sure(each.tested)]
            best = min(followed, key=lambda each: each.left, default=None)
            pieces = float(self._equations.pieces.sum())
            if (
                best is None
                or (left / best.left - 1.0) * pieces <= self.thresholds.rival_change_chi_square
            ):
                break
            instead = [each.tested.number for each in followed if self._is_as_good(each, best)]
            found.append(self._describe(best.tested, best.values, instead))
            changed.append(best.tested.number)
            own.append(best.tested.number)
            left = best.left
            self._stand(best.plants)
        rest = [n for n in self._common if n in candidates and n not in changed]
        first = {each.number: each for each in self._test(rest, own)}
        for number in self._common:
            if number in changed:
                continue
            if number in unseen:
                found.append(self._untold(number))
            else:
                found.append(self._describe(first[number]))
        names = dict.fromkeys(
            Name(e.component, e.kind.name)
            for number in unseen
            if (e := self.columns[number].effect) is not None and e not in self._named
        )
        return Compared(tuple(found), tuple(names), len(candidates), left)

    def _test(self, numbers: Sequence[int], own: Sequence[int]) -> list[_Tested]:
        """Each parameter as the only one that may differ."""
        estimates = [
            self._equations.estimate(
                number, [n for n in self._common if n not in (number, *own)], own
            )
            for number in numbers
        ]
        tests = [check_homogeneity(each.moves, each.widths, self._freedom()) for each in estimates]
        return [
            _Tested(number, estimate, test.statistic, probability, self._nothing(own, number))
            for number, estimate, test, probability in zip(
                numbers, estimates, tests, correct([t.probability for t in tests]), strict=True
            )
        ]

    def _nothing(self, own: Sequence[int], also: int | None = None) -> float:
        """χ² that stays if nothing more changed; also: a further parameter in common."""
        common = [n for n in self._common if n not in own]
        if also is not None and also not in common:
            common.append(also)
        return self._equations.estimate(None, common, own).left

    def _matters(self, each: _Tested) -> bool:
        """Whether a change lessens the error enough, where more than noise is left."""
        if self._settled:
            return True
        gain = 0.5 * float(np.log(each.without / max(each.estimate.left, 1e-300)))
        return gain >= self.thresholds.change_log_error

    def _is_sure(self, each: _Tested) -> bool:
        """Whether a parameter is not the same, and that is no trifle beside a model's error."""
        return each.probability < self.thresholds.change_probability and self._matters(each)

    def _is_as_good(self, each: _Followed, best: _Followed) -> bool:
        """Whether another parameter's change leaves as little as the best one's."""
        if each is best:
            return False
        share = each.left / max(best.left, 1e-300)
        alike = 0.0 if self._settled else self.thresholds.change_log_error
        pieces = float(self._equations.pieces.sum())
        return (
            0.5 * np.log(share) <= alike
            or (share - 1.0) * pieces <= self.thresholds.rival_change_chi_square
        )

    def _describe(
        self, each: _Tested, followed: Array | None = None, instead: Sequence[int] = ()
    ) -> Parameter:
        """followed: values of a parameter that is not the same; instead: columns whose change
        explains as much."""
        column = self.columns[each.number]
        effect = column.effect
        assert effect is not None
        estimate = each.estimate
        values = followed
        if values is None:
            values = self._values(column, self._plants) + estimate.moves * column.step
        widths = estimate.widths * abs(column.step) * self.thresholds.interval_half_width
        quantity = effect.quantities()[column.parameter]
        return Parameter(
            name=Name(effect.component, effect.kind.name),
            parameter=column.parameter,
            unit=self.machine.unit(column.group, quantity),
            values=tuple(
                Interval(float(v), float(v - w), float(v + w))
                for v, w in zip(values, widths, strict=True)
            ),
            statistic=each.statistic,
            probability=each.probability,
            verdict="same" if followed is None else "changed",
            instead=tuple(
                dict.fromkeys(
                    Name(e.component, e.kind.name)
                    for n in instead
                    if (e := self.columns[n].effect) is not None and e != effect
                )
            ),
        )

    @staticmethod
    def _values(column: Column, plants: Sequence[Plant]) -> Array:
        return np.array([getattr(getattr(p, column.group), column.parameter) for p in plants])

    def _follow(self, tested: _Tested, own: Sequence[int], count: int) -> _Followed:
        """A parameter of each recording, responses taken anew at its values as long as that lessens
        what is left. count: parameters that are tested beside each other."""
        number = tested.number
        shared = [n for n in self._common if n != number and n not in own]
        chosen = [self.columns[n] for n in (number, *shared, *own)]
        common = range(1, 1 + len(shared))
        nuisances = range(1 + len(shared), len(chosen))
        plants = list(self._plants)
        here = self._left(plants)
        for _ in range(ROUNDS):
            found = ByRecording.at(self.evidence, plants, chosen).estimate(0, common, nuisances)
            for part in PARTS:
                there = [
                    reduce(
                        lambda plant, step: step[0].moved(plant, part * float(step[1])),
                        zip(chosen, (move, *found.common), strict=False),
                        plant,
                    )
                    for plant, move in zip(plants, found.moves, strict=True)
                ]
                if (left := self._left(there)) < here:
                    break
            else:
                break
            gained, plants, here = here - left, there, left
            if gained < SMALL * here:
                break
        values = self._values(chosen[0], plants)
        last = ByRecording.at(self.evidence, plants, chosen).estimate(0, common, nuisances)
        widths = last.widths * abs(chosen[0].step)
        test = check_homogeneity(values, widths, self._freedom())
        anew = replace(
            tested,
            estimate=replace(tested.estimate, widths=last.widths),
            statistic=test.statistic,
            probability=min(count * test.probability, 1.0),
        )
        return _Followed(anew, values, here, tuple(plants))

    def _left(self, plants: Sequence[Plant]) -> float:
        """χ² that plants leave, zeros and tolerances taken up."""
        nuisances = [self.columns[n] for n in self._own]
        found = ByRecording.at(self.evidence, plants, nuisances, relative=False)
        return found.estimate(None, (), range(len(nuisances))).left

    def _untold(self, number: int) -> Parameter:
        column = self.columns[number]
        assert column.effect is not None
        quantity = column.effect.quantities()[column.parameter]
        return Parameter(
            name=Name(column.effect.component, column.effect.kind.name),
            parameter=column.parameter,
            unit=self.machine.unit(column.group, quantity),
            values=(),
            statistic=float("nan"),
            probability=float("nan"),
            verdict="cannot tell",
            why="not every recording shows it apart from zeros, tolerances and what else is named",
        )
