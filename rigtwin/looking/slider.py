"""Parameter of a candidate effect, and its range for moving it by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigtwin.components import Effect
from rigtwin.components.plant import Plant

WIDER = 2.0
"""Ratio of a slider's end to the largest value that a search starts from."""


@dataclass(frozen=True)
class Slider:
    """Range of one parameter.

    Attributes
    ----------
    effect, parameter
        Names of the effect and of its parameter.
    unit
        Unit of the values.
    low, high
        Ends of the range.
    nominal
        Value of the twin without the effect.
    start
        Value from which a search for the effect starts.
    """

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
    """Return the sliders of one effect.

    Parameters
    ----------
    effect
        Effect that a diagnosis searches for.
    plant
        Parameters of the twin without the effect.
    tried
        Values that a search starts from, one tuple per start in the order of the parameters.
    bounds
        Bounds of each parameter's search.
    units
        Unit of each parameter.

    Returns
    -------
    tuple of Slider
        One slider per parameter. It reaches from the nominal value beyond all starts of a search,
        within the bounds.
    """
    sliders = []
    for number, (parameter, nominal) in enumerate(effect.nominal(plant).items()):
        low, high = bounds[number]
        starts = [values[number] for values in tried]
        start = sorted(starts)[len(starts) // 2]
        # A nominal limit may be practically infinite; it must not stretch the scale.
        origin = min(max(nominal, low), WIDER * max(abs(value) for value in starts))
        most = max(origin, *(max(value, WIDER * value) for value in starts))
        least = min(origin, *(min(value, WIDER * value) for value in starts))
        if not least < most:
            # A search starts from one value, such as the middle of a range, which is nominal too.
            least, most = least - 1.0, most + 1.0
        sliders.append(
            Slider(
                effect=effect.name,
                parameter=parameter,
                unit=units[number],
                # The bounds of the search are the last word: beyond them a value has no meaning.
                low=max(low, least),
                high=min(high, most),
                nominal=nominal,
                start=start,
            )
        )
    return tuple(sliders)
