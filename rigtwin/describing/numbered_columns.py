"""Columns whose names differ by a number only: one for each joint."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from rigtwin.describing.heading import split_words
from rigtwin.describing.match import Match


def families_of(numbered: Mapping[str, tuple[str, ...]]) -> dict[str, list[str]]:
    """Return the families of columns whose names differ by a number only.

    Parameters
    ----------
    numbered
        Column → words of its name, of which one is a number.

    Returns
    -------
    dict
        Name with a sign in the place of the number → columns.
    """
    families: dict[str, list[str]] = {}
    for column in numbered:
        # Only a whole family shows how its numbers count: from 0, from 1, or as the joints' names
        # do.
        families.setdefault(re.sub(r"\d+", "#", column), []).append(column)
    return families


def number_of(words: Sequence[str]) -> int:
    """Return the number among the words of a name."""
    return next(int(word) for word in words if word.isdigit())


def order_joints(numbers: Sequence[int], joints: Sequence[str]) -> dict[int, str] | None:
    """Return which joint each number of a family means.

    Numbers in the joints' own names mean more than the order of the joints.

    Parameters
    ----------
    numbers
        Numbers of the family's columns, in rising order.
    joints
        Joints in the order of the model.

    Returns
    -------
    dict or None
        Number → joint. None if there are not as many joints.
    """
    digits = [[int(w) for w in split_words(joint) if w.isdigit()] for joint in joints]
    if all(len(numerals) == 1 for numerals in digits):
        by_name = {numerals[0]: joint for numerals, joint in zip(digits, joints, strict=True)}
        if len(by_name) == len(joints) and set(numbers) <= set(by_name):
            return by_name
    if len(numbers) != len(joints) or list(numbers) not in (
        list(range(len(joints))),
        list(range(1, len(joints) + 1)),
    ):
        return None
    return dict(zip(numbers, joints, strict=True))


def counted_from_zero(
    written: Mapping[str, tuple[str, ...]], by_alias: Mapping[str, Sequence[Match]], joints: int
) -> set[str]:
    """Return the columns that count all joints from 0, although the model's names count from 1.

    The number in such a column is a place: "effort1" is then the second joint's, even where the
    model calls the first one's actuator so.

    Parameters
    ----------
    written
        Column → words of its name.
    by_alias
        Column → matches with names of the model.
    joints
        Number of joints.
    """
    numbered = {
        column: words
        for column, words in written.items()
        if sum(word.isdigit() for word in words) == 1
    }
    counted: set[str] = set()
    for family in families_of(numbered).values():
        ordered = sorted(family, key=lambda column: number_of(numbered[column]))
        numbers = [number_of(numbered[column]) for column in ordered]
        named = [bool(by_alias[column]) for column in ordered]
        if numbers == list(range(joints)) and any(named) and not named[0]:
            counted |= set(family)
    return counted
