"""Every kind of effect there is, and the effects that a plant of given components can have.

`setting@controller` is besides: any setting that is not what the operator wrote down.
"""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

from rigtwin.components import body, computer, conditioning, guide, mass, mount, rotor, servo, tyre
from rigtwin.components.effect import Effect, Kind
from rigtwin.components.plant import Plant
from rigtwin.errors import RigtwinError

KINDS: tuple[Kind, ...] = tuple(
    kind
    for module in (guide, mount, mass, body, rotor, tyre, conditioning, servo, computer)
    for kind in module.KINDS
)


def candidates(plant: Plant) -> Iterator[Effect]:
    """All effects that a plant can have, component by component."""
    for group, component in plant._asdict().items():
        for kind in KINDS:
            if type(component) in kind.at:
                yield Effect(kind, group, type(component))


def title(kind: str) -> str:
    """What a kind of effect is called in a sentence."""
    return next((each.title for each in KINDS if each.name == kind), kind)


def find(name: str, plant: Plant) -> Effect:
    """The effect of that name.

    Parameters
    ----------
    name
        `KIND@COMPONENT`, such as `coulomb@rail`.
    plant
        The plant that is to have it.

    Raises
    ------
    RigtwinError
        If it cannot have it; the message says what there is.
    """
    effects = {effect.name: effect for effect in candidates(plant)}
    if name in effects:
        return effects[name]
    kind, _, component = name.partition("@")
    there = [effect.kind.name for effect in effects.values() if effect.component == component]
    meant = [each for each in effects if not there or each.endswith(f"@{component}")]
    close = get_close_matches(name, meant, 1, 0.75)
    hint = f"did you mean {close[0]!r}? " if close else ""
    if there:
        raise RigtwinError(
            f"unknown effect {kind!r} at {component}; {hint}there are {', '.join(there)}"
        )
    known = ", ".join(dict.fromkeys(effect.component for effect in effects.values()))
    raise RigtwinError(
        f"unknown effect {name!r}; {hint}expected KIND@COMPONENT with a component of {known}"
    )
