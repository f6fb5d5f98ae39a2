"""A physical value's unit, bounds and source, written once beside the field that holds it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Quantity:
    """What a number means: `Annotated[float, Quantity("kg", 1, 1e4, "§6.1")] = 34.0`.

    unit: SI unit as text. low, high: inclusive bounds in that unit. source: where the nominal value
    comes from.
    """

    unit: str
    low: float
    high: float
    source: str


class Choice(IntEnum):
    """Base of the named alternatives of a setting; an integer to compiled code, a label to
    people."""

    @property
    def label(self) -> str:
        """The name as it stands in configurations and recordings, e.g. `semi-active`."""
        return self.name.lower().replace("_", "-")

    @classmethod
    def labels(cls) -> tuple[str, ...]:
        return tuple(member.label for member in cls)

    @classmethod
    def parse(cls, text: str) -> Any:
        """The member of that label. Raises ValueError where there is none."""
        for member in cls:
            if member.label == text:
                return member
        raise ValueError(f"{text!r} is not one of {', '.join(cls.labels())}")


def fields(group: type) -> dict[str, Quantity | type[Choice]]:
    """Name → Quantity or Choice of every leaf field of a NamedTuple class, in order."""
    found: dict[str, Quantity | type[Choice]] = {}
    for name, hint in get_type_hints(group, include_extras=True).items():
        if get_origin(hint) is Annotated:
            found[name] = next(extra for extra in get_args(hint)[1:] if isinstance(extra, Quantity))
        elif isinstance(hint, type) and issubclass(hint, Choice):
            found[name] = hint
    return found
