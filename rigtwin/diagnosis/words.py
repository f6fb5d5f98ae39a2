"""How names and lists are written in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def name_part(component: str) -> str:
    """A component in words."""
    return component.replace("_", " ").replace("lvdt", "LVDT")


def enumerate_words(parts: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)
