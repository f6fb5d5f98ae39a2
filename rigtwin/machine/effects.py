"""Effects: what a real rig may have that the nominal one has not. An effect is a kind at a component, `coulomb@rail`.

A kind is defined once, as other values of a component's parameters; bounds and units are the parameters' own. So the twin,
every comparison and every calibrated twin mean the same by it. Which effects a machine can have follows from its components.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from controllers.quantity import Quantity, fields
from rigtwin.components.parameters import Carriage, Computer, Cylinder, LoadCell, Lvdt, Motor, Plant, Rail, Tyre
from rigtwin.components.parts import JOINT_ACTUATORS, JOINT_SENSORS, Guide, Mass, PositionActuator
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration, overridden

SLIDES = (Rail, Motor, Guide)
ACTUATORS = (Motor, Cylinder, *JOINT_ACTUATORS)
DECLARED = (Lvdt, LoadCell)
"""Sensors whose noise, hum and bits are declared."""
SENSORS = (*DECLARED, *JOINT_SENSORS)


@dataclass(frozen=True)
class Kind:
    """A sort of effect. title: its name in a sentence; at: types of component that can have it; parameters: theirs that it
    sets, the first its magnitude; meaning: what it does."""

    name: str
    title: str
    at: tuple[type, ...]
    parameters: tuple[str, ...]
    meaning: str


KINDS = (
    Kind("coulomb", "Coulomb friction", SLIDES, ("coulomb",), "dry friction, the same at any speed"),
    Kind("viscous", "viscous friction", SLIDES, ("viscous",), "friction in proportion to the speed"),
    Kind("stribeck", "Stribeck friction", SLIDES, ("stribeck", "stribeck_velocity"), "dry friction greater near standstill"),
    Kind(
        "asymmetry",
        "asymmetry of friction",
        SLIDES,
        ("asymmetry",),
        "dry friction greater in positive direction than in negative",
    ),
    Kind("backlash", "backlash", SLIDES, ("backlash",), "friction felt only once a gap is taken up after each reversal"),
    Kind("mass", "mass", (Carriage, Mass), ("mass",), "mass"),
    Kind("stiffness", "stiffness", (Tyre, Guide), ("stiffness",), "stiffness at small deflection"),
    Kind("damping", "damping", (Tyre,), ("damping",), "damping while in contact"),
    Kind("hardening", "hardening", (Tyre,), ("hardening", "hardening_power"), "stiffness that grows with deflection"),
    Kind("gain", "gain", (*ACTUATORS, *SENSORS), ("gain",), "output by this factor"),
    Kind("lag", "lag", (*ACTUATORS, *SENSORS), ("lag",), "a first-order lag more"),
    Kind("delay", "delay", (*ACTUATORS, *SENSORS, Computer), ("delay",), "a delay more"),
    Kind("saturation", "saturation", ACTUATORS, ("saturation",), "command limited to this magnitude"),
    Kind("deadband", "deadband", ACTUATORS, ("deadband",), "command without effect within this band"),
    Kind("rate_limit", "rate limit", (Motor, *JOINT_ACTUATORS), ("rate_limit",), "command's rate limited"),
    Kind("rate_limit", "rate limit", (Cylinder,), ("speed_limit",), "speed limited"),
    Kind(
        "cogging",
        "cogging",
        (Motor, Guide),
        ("cogging", "cogging_pitch", "cogging_phase"),
        "force that alternates along the stroke",
    ),
    Kind("compliance", "compliance", (Cylinder,), ("compliance",), "yields under load"),
    Kind("compliance", "compliance", (Guide,), ("compliance",), "a spring in series with the dry friction"),
    Kind("offset", "constant force", (Guide,), ("offset",), "a force that is the same whichever way it moves"),
    Kind(
        "viscous_asymmetry",
        "asymmetry of viscous friction",
        (Guide,),
        ("viscous_asymmetry",),
        "viscous friction greater in positive direction than in negative",
    ),
    Kind("drag", "quadratic friction", (Guide,), ("drag",), "friction with the square of the speed"),
    Kind("relaxation", "relaxation", (Guide,), ("relaxation",), "viscous friction through a spring: it lags by this time"),
    Kind("two_lags", "pair of lags", (PositionActuator,), ("lag", "second_lag"), "two first-order lags, one after the other"),
    Kind(
        "resonance",
        "natural frequency",
        (PositionActuator,),
        ("natural_frequency", "damping_ratio"),
        "follows as an underdamped system of second order",
    ),
    Kind("offset", "offset", (*SENSORS, PositionActuator), ("offset",), "output displaced"),
    Kind("hum", "mains hum", DECLARED, ("hum",), "amplitude of the mains line"),
    Kind("noise", "white noise", DECLARED, ("white",), "white noise, rms"),
    Kind("quantisation", "quantisation", DECLARED, ("resolution",), "size of one bit"),
    Kind(
        "missed_ticks",
        "share of missed ticks",
        (Computer,),
        ("missed_ticks",),
        "share of ticks at which the outputs stay as they are",
    ),
)
"""Every kind of effect. `setting@controller` is besides: any setting that is not what the operator wrote down."""

NAMES = {"computer": "controller"}
"""What a component is called in effects, where that is not its name among the parameters."""


@dataclass(frozen=True)
class Effect:
    """A kind at a component of the plant. group: the component's name among the parameters; of: its type."""

    kind: Kind
    group: str
    of: type

    @property
    def component(self) -> str:
        return NAMES.get(self.group, self.group)

    @property
    def name(self) -> str:
        return f"{self.kind.name}@{self.component}"

    def quantities(self) -> dict[str, Quantity]:
        """Its parameters: name → unit, bounds, source."""
        meanings = fields(self.of)
        found = {name: meanings[name] for name in self.kind.parameters}
        return {name: meaning for name, meaning in found.items() if isinstance(meaning, Quantity)}

    def nominal(self, plant: Any) -> dict[str, float]:
        """Its parameters' values in a plant."""
        return {name: float(getattr(getattr(plant, self.group), name)) for name in self.kind.parameters}

    def at(self, configuration: Configuration, values: dict[str, float]) -> Configuration:
        """The configuration with the effect. Raises RigtwinError for a value out of bounds."""
        return overridden(configuration, {self.group: values})


def candidates(plant: Any) -> Iterator[Effect]:
    """All effects that a plant of these components, a NamedTuple of them, can have."""
    for group, component in plant._asdict().items():
        for kind in KINDS:
            if isinstance(component, kind.at):
                yield Effect(kind, group, type(component))


def title(kind: str) -> str:
    """What a kind of effect is called in a sentence."""
    return next((each.title for each in KINDS if each.name == kind), kind)


def find(name: str, plant: Any = Plant()) -> Effect:  # noqa: B008
    """The effect of that name, `kind@component`, of a plant. Raises RigtwinError with what there is."""
    effects = {effect.name: effect for effect in candidates(plant)}
    if name in effects:
        return effects[name]
    kind, _, component = name.partition("@")
    there = [effect.kind.name for effect in effects.values() if effect.component == component]
    if there:
        raise RigtwinError(f"unknown effect {kind!r} at {component}; there are {', '.join(there)}")
    components = dict.fromkeys(effect.component for effect in effects.values())
    raise RigtwinError(f"unknown effect {name!r}; expected KIND@COMPONENT with a component of {', '.join(components)}")


def without(configuration: Configuration, name: str) -> Configuration:
    """The configuration with an effect of the nominal rig taken out, such as `coulomb@rail`: its magnitude set to 0.

    Raises RigtwinError if the rig has none of it to take out.
    """
    effect = find(name)
    parameter, quantity = next(iter(effect.quantities().items()))
    value = effect.nominal(configuration.plant)[parameter]
    if value == 0.0 or quantity.low > 0.0:
        there = [e.name for e in candidates(configuration.plant) if _removable(e, configuration.plant)]
        raise RigtwinError(f"--without {name}: the twin has none to take out; it has {', '.join(there)}")
    return effect.at(configuration, {parameter: 0.0})


def _removable(effect: Effect, plant: Plant) -> bool:
    parameter, quantity = next(iter(effect.quantities().items()))
    there = effect.nominal(plant)[parameter]
    return there not in (0.0, quantity.high) and quantity.low <= 0.0 and effect.of not in DECLARED


def applied(configuration: Configuration, texts: list[str]) -> Configuration:
    """The configuration with effects as `--effect` takes them: `coulomb@rail=80`, `stribeck@rail=20,stribeck_velocity=0.02`, or
    `setting@controller=kp:0.5` for a setting that is not what the recording will say.

    Raises RigtwinError naming the effect and what is allowed.
    """
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals:
            raise RigtwinError(f"--effect {text}: expected KIND@COMPONENT=VALUE, such as coulomb@rail=80")
        if name == "setting@controller":
            key, _, value = values.partition(":")
            configuration = overridden(configuration, {"controller": {key: value}})
            continue
        effect = find(name)
        first, *more = values.split(",")
        changes: dict[str, object] = {effect.kind.parameters[0]: first}
        for item in more:
            key, _, value = item.partition("=")
            if key not in effect.kind.parameters:
                raise RigtwinError(f"--effect {text}: {effect.name} has {', '.join(effect.kind.parameters)}, not {key!r}")
            changes[key] = value
        configuration = overridden(configuration, {effect.group: changes})
    return configuration
