"""Unit, bounds and source of a physical value, written once in the type of its field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Quantity:
    """Meaning of a number: `Annotated[float, Quantity("kg", 1, 1e4, "§6.1")] = 34.0`.

    Attributes
    ----------
    unit : str
        SI unit.
    low, high : float
        Inclusive bounds in that unit.
    source : str
        Source of the nominal value.
    """

    unit: str
    low: float
    high: float
    source: str


class Choice(IntEnum):
    """Base of a setting's alternatives: an integer in compiled code, a label in files."""

    @property
    def label(self) -> str:
        """Name in configurations and recordings, such as `semi-active`."""
        return self.name.lower().replace("_", "-")

    @classmethod
    def labels(cls) -> tuple[str, ...]:
        """Return the labels of all members."""
        return tuple(member.label for member in cls)

    @classmethod
    def parse(cls, text: str) -> Any:
        """Return the member with a label. Raises ValueError, listing the labels, otherwise."""
        for member in cls:
            if member.label == text:
                return member
        raise ValueError(f"{text!r} is not one of {', '.join(cls.labels())}")


def fields(group: type) -> dict[str, Quantity | type[Choice]]:
    """Return the Quantity or Choice of every leaf field of a NamedTuple class, by name."""
    return dict(_read_fields(group))


@cache
def _read_fields(group: type) -> Mapping[str, Quantity | type[Choice]]:
    """Return the same once per class: its annotations are parsed anew at each call."""
    meanings: dict[str, Quantity | type[Choice]] = {}
    for name, hint in get_type_hints(group, include_extras=True).items():
        if get_origin(hint) is Annotated:
            meanings[name] = next(
                extra for extra in get_args(hint)[1:] if isinstance(extra, Quantity)
            )
        elif isinstance(hint, type) and issubclass(hint, Choice):
            meanings[name] = hint
    return meanings
