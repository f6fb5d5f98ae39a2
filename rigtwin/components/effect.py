"""What an effect is: another value of a component's parameters, and where a search for it starts.

A kind of effect is declared once, beside the law that has its parameters. `library` collects the
kinds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.components.quantity import Quantity, fields
from rigtwin.numerics.arrays import Array

SHARES = (0.9999, 0.999, 0.98, 0.9, 0.75, 0.5, 0.3)
"""Of the time; a limit is looked for at the values that a command exceeds for the rest of it."""
TINY = 1e-12
NAMES = {"computer": "controller"}
"""What a component is called in effects, where that is not its name among the parameters."""
GROUPS = {component: group for group, component in NAMES.items()}
"""The other way round."""


@dataclass(frozen=True)
class Swing:
    """How far and fast a command went: the magnitude, in its unit, and the rate, unit/s, that it
    stays below for these `SHARES` of the time."""

    largest: tuple[float, ...] = (0.0,) * len(SHARES)
    fastest: tuple[float, ...] = (0.0,) * len(SHARES)


@dataclass(frozen=True)
class Motion:
    """What a component goes through, shape (ticks,) each: position m, its rate m/s, force N."""

    position: Array
    speed: Array
    force: Array


@dataclass(frozen=True)
class Scales:
    """Sizes of what a component goes through: half its stroke m, speed m/s, acceleration m/s²,
    force N, rms each but the first; fastest: its highest speed, m/s; period: of a tick, s."""

    stroke: float
    speed: float
    fastest: float
    acceleration: float
    force: float
    period: float

    @property
    def time(self) -> float:
        """s in which the component goes its stroke."""
        return max(self.stroke / self.speed, self.period)

    @classmethod
    def of(cls, motion: Motion, force: float, period: float) -> Scales:
        """Of a motion. force: rms of what is measured of it, N."""
        own = float(np.sqrt(np.mean(motion.force**2)))
        return cls(
            stroke=max(0.5 * float(np.ptp(motion.position)), TINY),
            speed=max(float(np.sqrt(np.mean(motion.speed**2))), TINY),
            fastest=max(float(np.max(np.abs(motion.speed))), TINY),
            acceleration=max(float(np.std(np.gradient(motion.speed, period))), TINY),
            force=max(force, own, TINY),
            period=period,
        )


@dataclass(frozen=True)
class Starts:
    """Where a search starts: values, one tuple each in the order of the effect's parameters.

    steps: fine ones for derivatives. quadrature: whether starts come in pairs a quarter of a wave
    apart, (amplitude, pitch, 0) and (amplitude, pitch, π/2), so that any phase is a blend of both.
    bounds: narrower ones than the parameters' own, by what the recording can show.
    """

    values: tuple[tuple[float, ...], ...]
    steps: tuple[float, ...]
    quadrature: bool = False
    bounds: tuple[tuple[float, float], ...] | None = None

    @classmethod
    def single(cls, values: Sequence[float], step: float) -> Starts:
        """Of an effect with one parameter."""
        return cls(tuple((value,) for value in values), (step,))


@dataclass(frozen=True)
class Context:
    """What is known where a search starts: the effect, the plant without it, how far the commands
    went, and the sizes of what its component goes through, worked out when they are asked for."""

    effect: Effect
    plant: Plant
    swing: Swing
    scales_of: Callable[[], Scales]

    @property
    def scales(self) -> Scales:
        return self.scales_of()

    @property
    def nominal(self) -> float:
        """The magnitude that the plant has already."""
        return self.effect.nominal(self.plant)[self.effect.kind.parameters[0]]


Guess = Callable[[Context], Starts]


@dataclass(frozen=True)
class Kind:
    """A sort of effect.

    title: its name in a sentence; parameters: of the component that it sets, the first its
    magnitude; meaning: what it does; at: type of component that can have it → where the search
    starts, None where it is read off the signals instead; negative: what it does where its
    magnitude is below zero, if that is something else; nuisances: parameters that must be fitted
    with it but say nothing of it, such as the load at which a thing was set to zero.
    """

    name: str
    title: str
    parameters: tuple[str, ...]
    meaning: str
    at: Mapping[type, Guess | None] = field(compare=False, repr=False)
    negative: str = field(default="", compare=False, repr=False)
    nuisances: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __reduce__(self) -> tuple[Callable[[str, list[str]], Kind], tuple[str, list[str]]]:
        """Kinds are code, which stays where it is: another process looks one up by its name and the
        components that can have it."""
        return _kind_of, (self.name, _types_of(self))


def _types_of(kind: Kind) -> list[str]:
    return sorted(each.__name__ for each in kind.at)


def _kind_of(name: str, types: list[str]) -> Kind:
    from rigtwin.components.library import KINDS  # Late: the library is made of kinds.

    return next(kind for kind in KINDS if (kind.name, _types_of(kind)) == (name, types))


@dataclass(frozen=True)
class Effect:
    """A kind at a component of the plant. group: the component's name there; of: its type."""

    kind: Kind
    group: str
    of: type

    @property
    def component(self) -> str:
        return NAMES.get(self.group, self.group)

    @property
    def name(self) -> str:
        return f"{self.kind.name}@{self.component}"

    @property
    def searched(self) -> bool:
        """Whether it is searched for; others are read off the signals."""
        return self.kind.at[self.of] is not None

    def quantities(self) -> dict[str, Quantity]:
        """Its parameters: name → unit, bounds, source."""
        meanings = fields(self.of)
        found = {name: meanings[name] for name in self.kind.parameters}
        return {name: each for name, each in found.items() if isinstance(each, Quantity)}

    def nominal(self, plant: Plant) -> dict[str, float]:
        """Its parameters' values in a plant."""
        component = getattr(plant, self.group)
        return {name: float(getattr(component, name)) for name in self.kind.parameters}

    def starts(self, plant: Plant, swing: Swing, scales_of: Callable[[], Scales]) -> Starts:
        """Where a search for it starts. It has to be one that is searched for."""
        guess = self.kind.at[self.of]
        assert guess is not None
        return guess(Context(self, plant, swing, scales_of))


def fixed_starts(values: Sequence[float], step: float) -> Guess:
    """The same values wherever it is searched for."""
    return lambda _: Starts.single(values, step)


def shares_of_nominal(shares: Sequence[float], step: float) -> Guess:
    """Shares of the nominal value."""

    def guess(at: Context) -> Starts:
        nominal = at.nominal
        return Starts.single([nominal * share for share in shares], abs(nominal) * step)

    return guess


def shares_of_size(size: Callable[[Scales], float], shares: Sequence[float], step: float) -> Guess:
    """Shares of the nominal value, or of a size of the motion where there is none."""

    def guess(at: Context) -> Starts:
        unit = at.nominal if at.nominal > 0.0 else size(at.scales)
        return Starts.single([unit * share for share in shares], step * unit)

    return guess


def around_nominal(size: Callable[[Scales], float], shares: Sequence[float], step: float) -> Guess:
    """Shares of a size of the motion on top of the nominal value."""

    def guess(at: Context) -> Starts:
        meaning = at.effect.quantities()[at.effect.kind.parameters[0]]
        there, unit = at.nominal, size(at.scales)
        values = [min(max(there + share * unit, meaning.low), meaning.high) for share in shares]
        return Starts.single([v for v in dict.fromkeys(values) if v != there], step * unit)

    return guess


def at_limits(values: Sequence[float], least: float) -> Starts:
    """A limit at each of these values."""
    tried = tuple(dict.fromkeys(max(value, 1e-3 * max(values), least) for value in values))
    return Starts.single(tried, 0.004 * max(float(np.median(tried)), least))
