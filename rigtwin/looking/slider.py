"""A parameter of a candidate effect, and the range over which it is moved by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigtwin.components import Effect
from rigtwin.components.plant import Plant

WIDER = 2.0
"""Times the largest value that a search starts from, to which a slider goes."""


@dataclass(frozen=True)
class Slider:
    """effect: its name; parameter: of the effect; unit: of its values; low, high: between which it
    is moved; nominal: the twin's own value; start: where a search for the effect begins."""

    effect: str
    parameter: str
    unit: str
    low: float
    high: float
    nominal: float
    start: float


def sliders_of(
    effect: Effect,
    plant: Plant,
    tried: Sequence[Sequence[float]],
    bounds: Sequence[tuple[float, float]],
    units: Sequence[str],
) -> tuple[Slider, ...]:
    """The sliders of one effect.

    Parameters
    ----------
    effect
        One that is searched for.
    plant
        Without it.
    tried
        Values that a search for it starts from, one tuple each in the order of its parameters.
    bounds
        Between which each parameter is searched.
    units
        Of each parameter.

    Returns
    -------
    tuple of Slider
        One a parameter. Each reaches from the nominal value to beyond all that a search would try,
        within the bounds.
    """
    found = []
    for number, (parameter, nominal) in enumerate(effect.nominal(plant).items()):
        low, high = bounds[number]
        own = [values[number] for values in tried]
        start = sorted(own)[len(own) // 2]
        # A limit that is never reached is no end of a scale.
        here = min(max(nominal, low), WIDER * max(abs(value) for value in own))
        most = max(here, *(max(value, WIDER * value) for value in own))
        least = min(here, *(min(value, WIDER * value) for value in own))
        found.append(
            Slider(
                effect=effect.name,
                parameter=parameter,
                unit=units[number],
                low=max(low, least),
                high=min(high, most),
                nominal=nominal,
                start=start,
            )
        )
    return tuple(found)
