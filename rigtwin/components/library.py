"""Library of all kinds of effect, and the effects that a plant can have.

One effect is not listed here: `setting@controller`, a controller setting that differs from the
operator's record.
"""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

from rigtwin.components import (
    body,
    computer,
    end_stops,
    guide_effects,
    mass,
    mount,
    rotor,
    schedule,
    servo,
    signal_effects,
    tyre,
    warming,
)
from rigtwin.components.effect import Effect, Kind
from rigtwin.components.plant import Plant
from rigtwin.errors import RigtwinError

MODULES = (
    guide_effects,
    end_stops,
    mount,
    mass,
    body,
    rotor,
    tyre,
    signal_effects,
    servo,
    schedule,
    warming,
    computer,
)
"""Modules that define kinds of effect, in the order in which effects are listed."""
KINDS: tuple[Kind, ...] = tuple(kind for module in MODULES for kind in module.KINDS)


def candidates(plant: Plant) -> Iterator[Effect]:
    """Yield all effects that a plant can have, component by component."""
    for group, component in plant._asdict().items():
        for kind in KINDS:
            if type(component) in kind.at:
                yield Effect(kind, group, type(component))


def title(kind: str) -> str:
    """Return the title of a kind of effect, or its name if it is unknown."""
    return next((each.title for each in KINDS if each.name == kind), kind)


def find(name: str, plant: Plant) -> Effect:
    """Return an effect by its name.

    Parameters
    ----------
    name
        Name `KIND@COMPONENT`, such as `coulomb@rail`.
    plant
        Plant that gets the effect.

    Returns
    -------
    Effect
        Effect at that component.

    Raises
    ------
    RigtwinError
        If the plant cannot have the effect; the message lists what is available.
    """
    effects = {effect.name: effect for effect in candidates(plant)}
    if name in effects:
        return effects[name]
    kind, _, component = name.partition("@")
    available = [effect.kind.name for effect in effects.values() if effect.component == component]
    spellings = [text for text in effects if not available or text.endswith(f"@{component}")]
    close = get_close_matches(name, spellings, 1, 0.75)
    hint = f"did you mean {close[0]!r}? " if close else ""
    if available:
        raise RigtwinError(
            f"unknown effect {kind!r} at {component}; {hint}there are {', '.join(available)}"
        )
    known = ", ".join(dict.fromkeys(effect.component for effect in effects.values()))
    raise RigtwinError(
        f"unknown effect {name!r}; {hint}expected KIND@COMPONENT with a component of {known}"
    )
