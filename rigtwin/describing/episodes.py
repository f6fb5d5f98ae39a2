"""The tests that a log holds one after another, as data sets of robots do."""

from __future__ import annotations

import numpy as np

from rigtwin.describing.heading import split_words
from rigtwin.describing.quantity import COUNTING, TESTS
from rigtwin.importing.columns import Columns
from rigtwin.importing.episodes import split_episodes
from rigtwin.numerics.arrays import Array

SHORTEST = 5
"""Rows of a test; a column that changes more often counts something else."""


def episode_column(columns: Columns) -> str:
    """Return the column that numbers the tests of a log; empty for a log of one test.

    Parameters
    ----------
    columns
        Columns of the log.
    """
    if columns.episode:
        return columns.episode
    # A column of another length, such as a table of settings, says nothing of the rows.
    named = [
        name
        for name, values in columns.values.items()
        if _is_named(name) and len(values) == columns.rows and _counts(values)
    ]
    return named[0] if len(named) == 1 else ""


def split_tests(columns: Columns) -> list[Columns]:
    """Return the columns of each test of a log.

    Parameters
    ----------
    columns
        Columns of the log.
    """
    column = episode_column(columns)
    if not column:
        return [columns]
    return [episode.columns for episode in split_episodes(columns, column, ())]


def longest_test(columns: Columns) -> Columns:
    """Return the columns of the test with the most rows.

    Parameters
    ----------
    columns
        Columns of the log.
    """
    return max(split_tests(columns), key=lambda test: test.rows)


def _is_named(column: str) -> bool:
    words = set(split_words(column))
    return bool(words & TESTS) and words <= TESTS | COUNTING


def _counts(values: Array) -> bool:
    """Whether a column numbers stretches of rows, each number one stretch."""
    if not np.all(np.floor(values) == values):  # NaN is no number of a test either
        return False
    starts = np.flatnonzero(np.diff(values)) + 1
    lengths = np.diff(np.concatenate([[0], starts, [len(values)]]))
    distinct = len(np.unique(values)) == len(lengths)
    return len(starts) > 0 and distinct and int(lengths.min()) >= SHORTEST
