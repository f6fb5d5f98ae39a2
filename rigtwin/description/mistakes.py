"""Mistakes in a description, collected while reading goes on, one line each."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any


class Mistakes(list[str]):
    """Every line says where, what, and what was expected."""

    def note(self, where: str, what: str) -> None:
        self.append(f"{where}: {what}" if where else what)

    def unknown(self, where: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
        """Notes the keys of a table that mean nothing."""
        known = list(known)
        for key in table:
            if key not in known:
                self.note(where, f"unknown key {key!r}; {near(key, known)}")

    def number(self, where: str, value: object, low: float, high: float) -> float:
        """The value if it is a number between the bounds; else the lower one, and a mistake."""
        number = math.nan
        if isinstance(value, int | float) and not isinstance(value, bool):
            with suppress(OverflowError):
                number = float(value)
        if low <= number <= high:
            return number
        shown = repr(value) if isinstance(value, str) else str(value)
        self.note(where, f"{shown[:40]}: expected a number from {low:g} to {high:g}")
        return low


def near(word: object, known: Iterable[str]) -> str:
    """What was probably meant, and what there is."""
    names = list(known)
    close = difflib.get_close_matches(str(word), names, 1)
    return (
        f"did you mean {close[0]!r}? " if close else ""
    ) + f"there are {', '.join(names) or 'none'}"
