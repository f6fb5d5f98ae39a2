"""Effects and kinds of effect: changed parameters of a component, and the starts of a search.

An effect changes a component's parameters from their nominal values. Its kind is declared once,
beside the law that has the parameters. `library` collects the kinds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from rigtwin.components.plant import C, Plant, component_of, parameter_of
from rigtwin.components.quantity import Quantity, fields
from rigtwin.components.scales import Scales, Swing

Points = tuple[tuple[float, float], ...]
"""Positions and forces of a curve, m and N."""
NAMES = {"computer": "controller"}
"""Component of the plant → its name in effects, where they differ."""
GROUPS = {component: group for group, component in NAMES.items()}
"""Name in effects → component of the plant."""


@dataclass(frozen=True)
class Starts:
    """Starting values of a search for an effect.

    Attributes
    ----------
    values : tuple of tuple of float
        Starting values, each in the order of the effect's parameters.
    steps : tuple of float
        Step of each parameter for numerical derivatives.
    quadrature : bool
        Whether starts come in pairs a quarter of a wave apart, (amplitude, pitch, 0) and
        (amplitude, pitch, π/2). A linear combination of both gives any phase.
    shapes : int
        Number of pitches among which those of a wave were chosen; 0 for no wave.
    is_linear : bool
        Whether the response to the sum of all starts is the sum of their responses.
    bounds : tuple of pairs or None
        Bounds of the parameters by what the recording can show; None for the parameters' own.
    """

    values: tuple[tuple[float, ...], ...]
    steps: tuple[float, ...]
    quadrature: bool = False
    is_linear: bool = False
    shapes: int = 0
    bounds: tuple[tuple[float, float], ...] | None = None

    @classmethod
    def single(cls, values: Sequence[float], step: float) -> Starts:
        """Return the starts of an effect with one parameter."""
        return cls(tuple((value,) for value in values), (step,))


@dataclass(frozen=True)
class Context:
    """Information from which the starts of a search follow.

    Attributes
    ----------
    effect : Effect
        Effect that is searched for.
    plant : Plant
        Plant without the effect.
    swing : Swing
        Quantiles of the component's command.
    scales_of : callable
        Function that returns the sizes of the component's motion; called only on demand, as it
        simulates the machine.
    """

    effect: Effect
    plant: Plant
    swing: Swing
    scales_of: Callable[[], Scales]

    @property
    def scales(self) -> Scales:
        """Sizes of the component's motion."""
        return self.scales_of()

    def component(self, *types: type[C]) -> C:
        """Return the component that the effect changes, of one of these types."""
        return component_of(self.plant, self.effect.group, *types)

    @property
    def nominal(self) -> float:
        """Magnitude of the effect in the plant: the value of its first parameter."""
        return self.effect.nominal(self.plant)[self.effect.kind.parameters[0]]


Guess = Callable[[Context], Starts]


@dataclass(frozen=True)
class Kind:
    """Kind of effect.

    Attributes
    ----------
    name : str
        Name in effects, as in `coulomb@rail`.
    title : str
        Name in a sentence.
    parameters : tuple of str
        Parameters of the component that the effect changes. The first is its magnitude.
    meaning : str
        Description of the effect.
    at : mapping
        Type of component that can have the effect → function of the search's starts. None where
        the value is read off the signals instead.
    negative : str
        Description of an effect of negative magnitude, if it differs.
    nuisances : tuple of str
        Parameters that are fitted with the effect but do not describe it, such as the load at which
        a zero was set.
    magnitudes : int
        Number of leading parameters that are magnitudes: 1, or the number of coefficients of a
        force that is linear in all of them.
    constants : tuple of str
        Parameters that a start sets and no fit changes, such as the range of a curve.
    multiplied : tuple of str
        Parameters that the magnitude multiplies. Effects that change one of them exclude this one,
        as both together would be known by their product alone.
    points : callable or None
        Function that returns positions and forces of a curve, m and N, from its parameters.
    needs : str
        Parameter without which the effect does nothing; empty if there is none. A machine whose
        nominal value of it is 0 is not searched for the effect.
    """

    name: str
    title: str
    parameters: tuple[str, ...]
    meaning: str
    at: Mapping[type, Guess | None] = field(compare=False, repr=False)
    negative: str = field(default="", compare=False, repr=False)
    nuisances: tuple[str, ...] = field(default=(), compare=False, repr=False)
    magnitudes: int = field(default=1, compare=False, repr=False)
    constants: tuple[str, ...] = field(default=(), compare=False, repr=False)
    multiplied: tuple[str, ...] = field(default=(), compare=False, repr=False)
    points: Callable[[Mapping[str, float]], Points] | None = field(
        default=None, compare=False, repr=False
    )
    needs: str = field(default="", compare=False, repr=False)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Parameters that a fit changes and that describe the effect."""
        return tuple(
            name for name in self.parameters if name not in (*self.nuisances, *self.constants)
        )

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
    """Kind of effect at one component of the plant.

    Attributes
    ----------
    kind : Kind
        Kind of effect.
    group : str
        Name of the component in the plant.
    of : type
        Type of the component.
    """

    kind: Kind
    group: str
    of: type

    @property
    def component(self) -> str:
        """Name of the component in effects."""
        return NAMES.get(self.group, self.group)

    @property
    def name(self) -> str:
        """Name of the effect, `KIND@COMPONENT`."""
        return f"{self.kind.name}@{self.component}"

    @property
    def searched(self) -> bool:
        """Whether the effect is searched for rather than read off the signals."""
        return self.kind.at[self.of] is not None

    def quantities(self) -> dict[str, Quantity]:
        """Return the unit, bounds and source of each parameter, by name."""
        meanings = fields(self.of)
        changed = {name: meanings[name] for name in self.kind.parameters}
        return {name: each for name, each in changed.items() if isinstance(each, Quantity)}

    def nominal(self, plant: Plant) -> dict[str, float]:
        """Return the values of the effect's parameters in a plant, by name."""
        return {name: parameter_of(plant, self.group, name) for name in self.kind.parameters}

    def distances(self, values: Sequence[float], plant: Plant) -> tuple[float, ...]:
        """Return the distances of an effect's magnitudes from their nominal values.

        Parameters
        ----------
        values
            Values of the effect's parameters.
        plant
            Plant without the effect.

        Returns
        -------
        tuple of float
            One distance for each magnitude, in its unit.
        """
        nominal = self.nominal(plant)
        names = self.kind.parameters[: self.kind.magnitudes]
        return tuple(abs(value - nominal[name]) for name, value in zip(names, values, strict=False))

    def steadiness(self, values: Sequence[float], widths: Sequence[float], plant: Plant) -> float:
        """Return the distance of an effect from its nominal value in standard errors.

        Of several magnitudes the one counts that is furthest from its nominal value.

        Parameters
        ----------
        values, widths
            Values of the effect's parameters, and their standard errors.
        plant
            Plant without the effect.

        Returns
        -------
        float
            Largest ratio of distance to standard error.
        """
        distances = self.distances(values, plant)
        return max(
            distance / max(width, 1e-300)
            for distance, width in zip(distances, widths, strict=False)
        )

    def starts(self, plant: Plant, swing: Swing, scales_of: Callable[[], Scales]) -> Starts:
        """Return the starts of a search for the effect.

        Parameters
        ----------
        plant
            Plant without the effect.
        swing
            Quantiles of the component's command.
        scales_of
            Function that returns the sizes of the component's motion.
        """
        guess = self.kind.at[self.of]
        assert guess is not None
        return guess(Context(self, plant, swing, scales_of))
