"""Alarm of a watch, and the effects suspected behind it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Suspect:
    """Effect that may cause a gap.

    Attributes
    ----------
    effect
        Name of the effect.
    values
        Parameter → value that explains the gap best.
    explained
        Explained share of the gap beyond noise and tolerances, 0 to 1.
    probability
        Probability among all effects tried, given that one of them is the cause; below 1.
    """

    effect: str
    values: dict[str, float]
    explained: float
    probability: float

    @property
    def component(self) -> str:
        """Component of the effect."""
        return self.effect.partition("@")[2]


@dataclass(frozen=True)
class Alarm:
    """Gap that noise and tolerances do not explain.

    Attributes
    ----------
    time
        End of the recording when the alarm was raised, in s.
    since
        Estimated beginning of the gap, in s.
    signal
        Signal with the largest gap.
    band
        Frequency band of the gap, in Hz.
    suspects
        Suspected effects, the likeliest first; empty before an investigation.
    """

    time: float
    since: float
    signal: str
    band: tuple[float, float]
    suspects: tuple[Suspect, ...] = ()

    @property
    def component(self) -> str:
        """Component with the largest total probability of suspects; empty without suspects."""
        # Effects of one component are often confounded; their component is more certain than each
        # of them.
        places: dict[str, float] = {}
        for suspect in self.suspects:
            places[suspect.component] = places.get(suspect.component, 0.0) + suspect.probability
        return max(places, key=lambda place: places[place], default="")

    def __str__(self) -> str:
        low, high = self.band
        sentence = (
            f"alarm at {self.time:.2f} s: since about {self.since:.2f} s {self.signal} is off by "
            f"more than noise and tolerances explain, most at {low:g} to {high:g} Hz"
        )
        if not self.suspects:
            return sentence
        named = ", ".join(
            f"{suspect.effect} ({100.0 * suspect.probability:.0f} %)" for suspect in self.suspects
        )
        return f"{sentence}; at {self.component}: {named}"
