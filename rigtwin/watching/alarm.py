"""What a watch has to say."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Suspect:
    """An effect that may be behind a gap.

    effect: its name; values: parameter → value that explains most; explained: share of what is more
    than noise and tolerances explain, 0 to 1; probability: among all effects that were tried, given
    that it is one of them, below 1.
    """

    effect: str
    values: dict[str, float]
    explained: float
    probability: float

    @property
    def component(self) -> str:
        """Where it is."""
        return self.effect.partition("@")[2]


@dataclass(frozen=True)
class Alarm:
    """A gap that noise and tolerances do not explain.

    time: s, up to where the test was recorded when it was raised; since: s, about when the gap
    began; signal: that shows it most; band: Hz, in which it does; suspects: the likeliest first,
    empty before they were looked for.
    """

    time: float
    since: float
    signal: str
    band: tuple[float, float]
    suspects: tuple[Suspect, ...] = ()

    @property
    def component(self) -> str:
        """The likeliest place, by all suspects there together; empty before they were looked
        for."""
        places: dict[str, float] = {}
        for suspect in self.suspects:
            places[suspect.component] = places.get(suspect.component, 0.0) + suspect.probability
        return max(places, key=lambda place: places[place], default="")

    def __str__(self) -> str:
        low, high = self.band
        said = (
            f"alarm at {self.time:.2f} s: since about {self.since:.2f} s {self.signal} is off by "
            f"more than noise and tolerances explain, most at {low:g} to {high:g} Hz"
        )
        if not self.suspects:
            return said
        named = ", ".join(
            f"{suspect.effect} ({100.0 * suspect.probability:.0f} %)" for suspect in self.suspects
        )
        return f"{said}; at {self.component}: {named}"
