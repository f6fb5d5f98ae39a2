"""Spelling of component names and lists in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def name_part(component: str) -> str:
    """Return a component's name in words: `suspension_lvdt` becomes "suspension LVDT"."""
    return component.replace("_", " ").replace("lvdt", "LVDT")


def enumerate_words(parts: Sequence[str]) -> str:
    """Join words as a sentence does: "a, b and c"."""
    return " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)


def indefinite_article(noun: str) -> str:
    """Return "an" before a vowel and "a" otherwise."""
    return "an" if noun[0].lower() in "aeiou" else "a"
