"""Mistakes in a description. They are collected while it is read, one line per mistake."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any


class Mistakes(list[str]):
    """List of mistakes. A line states the place, the mistake and the expected value."""

    def note(self, where: str, mistake: str) -> None:
        """Add a mistake. where: place in the description; empty for the whole description."""
        self.append(f"{where}: {mistake}" if where else mistake)

    def unknown(self, where: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
        """Note every key of a table that is not known."""
        known = list(known)
        for key in table:
            if key not in known:
                self.note(where, f"unknown key {key!r}; {suggest(key, known)}")

    def number(self, where: str, value: object, low: float, high: float) -> float:
        """Return a number between two bounds.

        A value that is no such number is noted, and the lower bound returned, so that reading goes
        on and further mistakes are found.
        """
        # bool is a subclass of int, but `true` is no number in TOML; a huge int overflows a float.
        number = math.nan
        if isinstance(value, int | float) and not isinstance(value, bool):
            with suppress(OverflowError):
                number = float(value)
        if low <= number <= high:
            return number
        shown = repr(value) if isinstance(value, str) else str(value)
        self.note(where, f"{shown[:40]}: expected a number from {low:g} to {high:g}")
        return low


def suggest(word: object, known: Iterable[str]) -> str:
    """Return the known name that is most like a word, and the list of known names, as a text."""
    names = list(known)
    close = difflib.get_close_matches(str(word), names, 1)
    return (
        f"did you mean {close[0]!r}? " if close else ""
    ) + f"there are {', '.join(names) or 'none'}"
