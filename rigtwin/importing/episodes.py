"""Episodes: the tests of a file that holds several, as data sets of robots do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns


@dataclass(frozen=True)
class Episode:
    """One test of a file that holds several.

    Parameters
    ----------
    number
        Number of the episode as the file states it.
    columns
        Rows of the episode alone.
    """

    number: int
    columns: Columns

    @property
    def name(self) -> str:
        """Name of the recording's file, without its ending."""
        return f"episode_{self.number:06d}"


def split_episodes(columns: Columns, column: str, take: Sequence[int]) -> Iterator[Episode]:
    """Split a table into its episodes.

    Parameters
    ----------
    columns
        Table of all episodes.
    column
        Column that numbers the episodes.
    take
        Numbers of the episodes to return. Empty for all.

    Yields
    ------
    Episode
        In the order of their numbers.

    Raises
    ------
    RigtwinError
        If a row has no whole number of an episode, or an episode to take does not exist.
    """
    numbers = columns.values[column]
    # Numbers of episodes come as floats, like all columns.
    if (odd := ~(np.floor(numbers) == numbers)).any():
        row = int(np.argmax(odd))
        raise RigtwinError(
            f"column {column!r} is {numbers[row]:g} in row {row + 1}; "
            "expected the whole number of an episode"
        )
    known = np.unique(numbers).astype(int).tolist()
    if missing := [number for number in take if number not in known]:
        raise RigtwinError(
            f"no episode {missing[0]}; {column!r} has {len(known)}, from {known[0]} to {known[-1]}"
            if known
            else f"no episode {missing[0]}; the data hold none"
        )
    # A stable sort keeps the rows of an episode in their order.
    order = np.argsort(numbers, kind="stable")
    # np.unique sorts, so `known` and the sorted numbers are in the same order.
    bounds = np.searchsorted(numbers[order], np.array(known))
    for number, rows in zip(known, np.split(order, bounds[1:]), strict=True):
        if not take or number in take:
            yield Episode(number, _take_rows(columns, rows))


def _take_rows(columns: Columns, rows: NDArray[np.int64]) -> Columns:
    length = columns.rows
    # A column of another length, such as a table of settings, has no rows of an episode.
    values = {
        name: values[rows] for name, values in columns.values.items() if len(values) == length
    }
    return replace(columns, values=values, episode="")
