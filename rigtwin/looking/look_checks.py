"""Checks of what a look is opened with."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.components import Effect
from rigtwin.errors import RigtwinError


def check_look(effect: Effect, numbers: Sequence[float]) -> None:
    """Raise RigtwinError unless an effect has as many values as parameters, all within bounds."""
    quantities = effect.quantities()
    if len(numbers) != len(quantities):
        raise RigtwinError(
            f"{effect.name}: expected {len(quantities)} values ({', '.join(quantities)}), "
            f"got {len(numbers)}"
        )
    for (name, quantity), value in zip(quantities.items(), numbers, strict=True):
        if not quantity.low <= value <= quantity.high:
            raise RigtwinError(
                f"{effect.name}: {name} = {value:g}; expected {quantity.low:g} to "
                f"{quantity.high:g} {quantity.unit}"
            )
