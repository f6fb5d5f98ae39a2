"""The columns that a log offers for the quantities of the joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.describing.corrections import Corrections, Slot, Stated
from rigtwin.describing.heading import split_words, stated_unit
from rigtwin.describing.match import Match
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import ask, enumerate_names, option
from rigtwin.importing.columns import Columns
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array

PROPORTIONAL = 1e-5
"""Largest deviation of two columns from a common shape, as a share of the largest value: rounding
in a file with six digits."""
TIE = 0.05
"""Ranks of matches that differ by less do not decide between two columns."""


class Slots:
    """Columns that were matched, or stated, for joints and quantities."""

    def __init__(self, columns: Columns, matches: Sequence[Match], stated: Corrections) -> None:
        """Collect the columns.

        Parameters
        ----------
        columns
            Columns of the log.
        matches
            Columns that were matched by their names.
        stated
            Sources that the owner of the log states; they replace what was matched.
        """
        self._columns, self._stated = columns, stated
        self._matches: dict[Slot, list[Match]] = {}
        # A column that its owner assigned is not offered to another joint.
        used = {each.column for each in stated.slots.values() if each.column}
        for match in matches:
            if match.column not in used:
                self._matches.setdefault((match.joint, match.quantity), []).append(match)

    def offer(self, match: Match) -> None:
        """Add a column that was matched by other evidence than its name.

        Parameters
        ----------
        match
            Column, with the joint and the quantity that it is offered for.
        """
        self._matches.setdefault((match.joint, match.quantity), []).append(match)

    def withdraw(self, column: str) -> None:
        """Offer a matched column for no quantity any more."""
        for slot, matches in list(self._matches.items()):
            remaining = [match for match in matches if match.column != column]
            if remaining:
                self._matches[slot] = remaining
            else:
                del self._matches[slot]

    def has(self, joint: str, quantity: JointQuantity) -> bool:
        """Whether the log offers a quantity of a joint."""
        stated = self._stated.slots.get((joint, quantity))
        if stated is not None:
            return bool(stated.column or stated.formula)
        return (joint, quantity) in self._matches

    def joints(self, quantity: JointQuantity, among: Sequence[str]) -> list[str]:
        """Joints among those named of which the log offers a quantity."""
        return [joint for joint in among if self.has(joint, quantity)]

    def stated(self, joint: str, quantity: JointQuantity) -> Stated | None:
        """Source that the owner of the log states; None without one."""
        return self._stated.slots.get((joint, quantity))

    def match(self, joint: str, quantity: JointQuantity) -> Match:
        """Return the column that was matched for a quantity of a joint.

        Raises
        ------
        Question
            If two columns fit equally well.
        """
        offers = sorted(self._matches[joint, quantity], key=lambda candidate: -candidate.rank)
        offers = [candidate for candidate in offers if candidate.rank > offers[0].rank - TIE]
        if len(offers) > 1:
            # Loggers often write a quantity twice, in SI and in another unit.
            plain = [candidate for candidate in offers if self._is_si(candidate.column, quantity)]
            offers = plain or offers
        values = [self._columns.values[candidate.column] for candidate in offers]
        # Equal columns make no difference. NaN counts as equal: gaps of both are alike.
        if all(np.array_equal(values[0], candidate, equal_nan=True) for candidate in values[1:]):
            return offers[0]
        if all(_are_proportional(values[0], candidate) for candidate in values[1:]):
            stated = [each for each in offers if stated_unit(split_words(each.column))]
            if len(stated) == 1:
                return stated[0]
        names = [candidate.column for candidate in offers]
        key = f"{joint}.{quantity.value}"
        raise ask(
            f"columns {enumerate_names(names)} could all be {key}; which is it?",
            *(option(key, name) for name in names[:3]),
        )

    def columns(self, joint: str, quantity: JointQuantity) -> list[str]:
        """Columns that were matched for a quantity of a joint."""
        return [each.column for each in self._matches.get((joint, quantity), ())]

    def _is_si(self, column: str, quantity: JointQuantity) -> bool:
        unit = self._columns.units.get(column, "")
        return (
            is_unit(unit) and unit_of(unit)[0] in SI.get(quantity, ()) and unit_of(unit)[1] == 1.0
        )


def _are_proportional(first: Array, second: Array) -> bool:
    """Whether two columns hold one signal in two units."""
    known = np.isfinite(first) & np.isfinite(second)
    one, other = first[known], second[known]
    power = float(one @ one)
    if power == 0.0:
        return False
    deviation = other - one * (float(one @ other) / power)
    return bool(np.max(np.abs(deviation)) <= PROPORTIONAL * np.max(np.abs(other)))
