"""The components of a description: what of the MJCF each is, its values, tolerances and effects."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from rigtwin import components
from rigtwin.components import KINDS, UNLIMITED
from rigtwin.components.quantity import Quantity, fields
from rigtwin.components.sensors import MEASURES
from rigtwin.description.machine import Component, ReplayOf
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, near
from rigtwin.description.physics import Physics, find_physics
from rigtwin.description.tolerance import Tolerance
from rigtwin.recording.schema import NAME as FIELD_NAME

TYPES: dict[str, type] = {
    "mass": components.Mass,
    "body": components.Body,
    "base": components.Base,
    "guide": components.Guide,
    "rotor": components.Rotor,
    "force actuator": components.ForceActuator,
    "servo": components.Servo,
    "position actuator": components.PositionActuator,
    "position sensor": components.PositionSensor,
    "velocity sensor": components.VelocitySensor,
    "force sensor": components.ForceSensor,
    "carriage": components.Carriage,
    "rail": components.Rail,
    "tyre": components.Tyre,
    "motor": components.Motor,
    "cylinder": components.Cylinder,
    "lvdt": components.Lvdt,
    "load cell": components.LoadCell,
    "gas spring": components.GasSpring,
}
"""Type of component as a description calls it."""
ELEMENTS = ("body", "joint", "tendon", "contact", "actuator", "sensor")
"""Elements of an MJCF that can be components."""
SENSED = {name: MEASURES[of] for name, of in TYPES.items() if of in MEASURES}
"""Type of sensor → what it measures."""
WHOLE = ("body", "base")
"""Types that have no coordinate of their own."""
PUSHING = ("force actuator", "servo")
"""Types that push a joint; where it goes follows from that."""
MOVING = (*PUSHING, "position actuator", "motor", "cylinder")
"""Types that take a command."""
UNITS = {"position": ("m", "rad"), "velocity": ("m/s", "rad/s"), "force": ("N", "Nm")}
"""What is measured → its unit where the joint slides, and where it turns."""
AT: dict[str, tuple[str, ...]] = {
    "mass": ("body",),
    "body": ("body",),
    "base": ("body",),
    "carriage": ("body",),
    "guide": ("joint", "tendon"),
    "rail": ("joint",),
    "rotor": ("joint", "tendon"),
    "gas spring": ("joint", "tendon"),
    "tyre": ("contact",),
    "cylinder": ("joint", "actuator"),
    **dict.fromkeys((*PUSHING, "position actuator", "motor"), ("actuator",)),
    **dict.fromkeys(SENSED, ("sensor", "joint", "tendon")),
}
"""Type of component → elements of an MJCF that it can be."""
TAKEN = ("computer", "mains", "controller", "safety", "timing")
"""Names of other groups of settings."""
COMPONENT_KEYS = (*ELEMENTS, "type", "channel", "command", "unit", "effects")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


class Components:
    """Components as they are read. found, types, values: name → component, type, NamedTuple of its
    values; sources, told: of `component.parameter`, a text, and the controller's setting that says
    it in recordings."""

    def __init__(self, mechanism: Mechanism, mistakes: Mistakes) -> None:
        self._mechanism, self.mistakes = mechanism, mistakes
        self.found: dict[str, Component] = {}
        self.types: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        self.tolerances: list[Tolerance] = []
        self.sources: dict[str, str] = {}
        self.told: dict[str, str] = {}

    def physics(self, replays: Sequence[ReplayOf] = ()) -> Physics:
        """Return the physics of the machine that the components make up."""
        return find_physics({name: type(value) for name, value in self.values.items()}, replays)

    def add(self, name: str, table: object) -> None:
        """Reads one component's table."""
        mechanism = self._mechanism
        where = f"[components.{name}]"
        if not isinstance(table, Mapping):
            self.mistakes.note(where, "expected a table")
            return
        if not NAME.fullmatch(name) or name in TAKEN:
            self.mistakes.note(
                where, f"{name!r} cannot be a component's name; expected letters, digits and _"
            )
            return
        elements = [key for key in ELEMENTS if key in table]
        if len(elements) != 1:
            self.mistakes.note(
                where,
                f"expected one of {', '.join(ELEMENTS)} to say what "
                f"of the MJCF it is, found {len(elements)}",
            )
            return
        element, mjcf = elements[0], str(table[elements[0]])
        if mjcf not in mechanism.names(element):
            self.mistakes.note(
                where, f"the MJCF has no {element} {mjcf!r}; {near(mjcf, mechanism.names(element))}"
            )
            return
        kind = self._type(where, table, element, mjcf)
        if kind is None:
            return
        joint = mechanism.joint_of(element, mjcf)
        self.types[name] = kind
        self.values[name] = self._fill(
            name=name, where=where, kind=kind, table=table, element=element, mjcf=mjcf, joint=joint
        )
        acts_on = () if kind in WHOLE else mechanism.acts_on(element, mjcf)
        turns = bool(acts_on) and all(mechanism.turns(each) for each, _ in acts_on)
        unit = str(table.get("unit", ""))
        for key in ("channel", "command", "unit"):
            if key in table and not isinstance(table[key], str):
                self.mistakes.note(where, f"{key} = {table[key]}: expected a text, in quotes")
            elif key != "unit" and not FIELD_NAME.fullmatch(str(table.get(key, name))):
                self.mistakes.note(
                    where,
                    f"{key} = {table[key]!r}: expected letters without accents, digits and _",
                )
        channel: tuple[str, str] | None = None
        if kind in SENSED:
            unit = UNITS[SENSED[kind]][turns]
            channel = ("/sensor", str(table.get("channel", name)))
            if table.get("unit", unit) != unit:
                self.mistakes.note(
                    where,
                    f"unit {table['unit']!r}: recordings are in SI, "
                    f"here {unit!r}; rigtwin import converts",
                )
        elif kind in MOVING:
            channel = ("/command", str(table.get("command", name)))
            if kind in ("position actuator", "servo", "cylinder"):
                unit = UNITS["position"][turns]
        for key, fits in (("channel", kind in SENSED), ("command", kind in MOVING)):
            if key in table and not fits:
                self.mistakes.note(
                    where,
                    f"{key} is for {'sensors' if key == 'channel' else 'actuators'}; "
                    f"this is a {kind}",
                )
        for other, known in self.found.items():
            if channel is not None and known.channel == channel and kind in SENSED:
                self.mistakes.note(
                    where,
                    f"its channel {channel[1]!r} is that of {other}; expected one for each sensor",
                )
        self.found[name] = Component(
            name=name,
            element=element,
            mjcf=mjcf,
            joint=joint,
            channel=channel,
            unit=unit,
            kinds=self._kinds(where, kind, table),
            acts_on=acts_on,
            turns=turns,
        )

    def _type(self, where: str, table: Mapping[str, Any], element: str, mjcf: str) -> str | None:
        if "type" in table:
            if table["type"] not in TYPES:
                self.mistakes.note(
                    where, f"unknown type {table['type']!r}; {near(table['type'], TYPES)}"
                )
                return None
            return self._fitting(where, str(table["type"]), element, mjcf)
        if element == "body":
            return "mass"
        if element == "joint" or (element == "tendon" and self._mechanism.acts_on(element, mjcf)):
            return "guide"
        if element == "actuator":
            return "position actuator" if self._mechanism.positions(mjcf) else "force actuator"
        if element == "sensor" and (measures := self._mechanism.measures(mjcf)):
            return f"{measures} sensor"
        self.mistakes.note(where, f"{element} {mjcf!r} needs a type; there are {', '.join(TYPES)}")
        return None

    def _fitting(self, where: str, kind: str, element: str, mjcf: str) -> str | None:
        """The type, if its element of the MJCF can be one."""
        if element not in AT[kind]:
            fits = [each for each, at in AT.items() if element in at]
            self.mistakes.note(
                where,
                f"type {kind!r} goes with {' or '.join(AT[kind])}, not with {element} {mjcf!r}; "
                f"expected {', '.join(fits)}",
            )
            return None
        measures = self._mechanism.measures(mjcf) if element == "sensor" else ""
        if measures and SENSED[kind] != measures:
            self.mistakes.note(
                where,
                f"type {kind!r}: sensor {mjcf!r} of the MJCF measures a {measures}; "
                f"expected '{measures} sensor', or joint = ... in place of sensor",
            )
            return None
        return kind

    def _kinds(self, where: str, kind: str, table: Mapping[str, Any]) -> frozenset[str] | None:
        if "effects" not in table:
            return None
        possible = sorted({each.name for each in KINDS if TYPES[kind] in each.at})
        wanted = table["effects"]
        if not isinstance(wanted, list) or not all(isinstance(each, str) for each in wanted):
            self.mistakes.note(
                where,
                'effects: expected a list of kinds, such as ["gain", "offset"], or [] for none',
            )
            return None
        for each in wanted:
            if each not in possible:
                self.mistakes.note(
                    where, f"effects: a {kind} has no {each!r}; {near(each, possible)}"
                )
        return frozenset(wanted)

    def _fill(
        self,
        name: str,
        where: str,
        kind: str,
        table: Mapping[str, Any],
        element: str,
        mjcf: str,
        joint: str,
    ) -> Any:
        """The component's values: those of its type, then of the MJCF, then of the description."""
        component = TYPES[kind]()
        meanings = {
            key: meaning
            for key, meaning in fields(TYPES[kind]).items()
            if isinstance(meaning, Quantity)
        }
        if kind == "mass" and joint:
            moving = self._mechanism.joint(joint)
            component = component._replace(mass=moving.inertia - moving.armature)
        elif kind == "body" and element == "body":
            component = component._replace(**self._mechanism.body(mjcf))
        elif kind == "guide" and (element == "tendon" or joint):
            component = component._replace(**self._mechanism.friction(element, mjcf))
        elif kind == "rotor" and (element == "tendon" or joint):
            component = component._replace(inertia=self._mechanism.armature(element, mjcf))
        if kind in (*PUSHING, "position actuator"):
            obstacle = self._mechanism.actuator_obstacle(mjcf, kind)
            if obstacle is not None:
                self.mistakes.note(where, f"actuator {mjcf!r}: {obstacle}")
                return component
            component = component._replace(**self._mechanism.actuator_timing(mjcf))
        if kind == "position actuator":
            component = component._replace(**self._mechanism.rest_position(mjcf))
        elif kind == "force actuator":
            constant, limit = self._mechanism.force_per_command(mjcf)
            if not constant > 0.0:
                self.mistakes.note(
                    where,
                    f"actuator {mjcf!r} has gear times gain {constant:g}; expected more than 0",
                )
                return component
            component = component._replace(constant=constant, force_limit=min(limit, UNLIMITED))
        elif kind == "servo":
            component = component._replace(**self._servo(where, mjcf))
        if kind in (*PUSHING, "position actuator"):
            low, high = self._mechanism.command_limits(mjcf)
            component = component._replace(
                command_low=max(low, -UNLIMITED), command_high=min(high, UNLIMITED)
            )
        for key, given in table.items():
            if key in COMPONENT_KEYS:
                continue
            if key not in meanings:
                known = [
                    each
                    for each in (*meanings, *COMPONENT_KEYS)
                    if each not in ELEMENTS or each == element
                ]
                self.mistakes.note(where, f"unknown key {key!r}; {near(key, known)}")
                continue
            component = self._value(name, where, component, key, given, meanings[key])
        for key, meaning in meanings.items():
            value = getattr(component, key)
            if key not in table and not meaning.low <= value <= meaning.high:
                self.mistakes.note(
                    where,
                    f"{key} of {element} {mjcf!r} in the MJCF is {value:g}: expected a number "
                    f"from {meaning.low:g} to {meaning.high:g}",
                )
        if kind in (*PUSHING, "position actuator"):
            low, high = component.command_low, component.command_high
            if not low < high:
                self.mistakes.note(
                    where, f"command_low {low:g}: expected less than command_high {high:g}"
                )
        return component

    def _servo(self, where: str, mjcf: str) -> dict[str, float]:
        """Values of the MJCF's servo."""
        found = self._mechanism.servo(mjcf)
        if found is None:
            self.mistakes.note(
                where,
                f"actuator {mjcf!r} is no servo; expected a position actuator of MuJoCo's, with "
                "gear 1",
            )
            return {}
        return found

    def _value(
        self, name: str, where: str, component: Any, key: str, given: object, meaning: Quantity
    ) -> Any:
        """One parameter: a number, or a table of value, tolerance and source."""
        here = f"{where} {key}"
        table: Mapping[str, Any] = given if isinstance(given, Mapping) else {"value": given}
        self.mistakes.unknown(here, table, ("value", "tolerance", "source", "setting"))
        if "value" in table:
            component = component._replace(
                **{key: self.mistakes.number(here, table["value"], meaning.low, meaning.high)}
            )
        if "setting" in table:
            self.told[f"{name}.{key}"] = str(table["setting"])
        if "source" in table:
            self.sources[f"{name}.{key}"] = str(table["source"])
        if "tolerance" in table:
            width = table["tolerance"]
            share = share_of(width) if isinstance(width, str) else None
            if share is not None and 0.0 < share <= 1.0:
                self.tolerances.append(Tolerance(name, key, share, True))
            elif (
                isinstance(width, int | float)
                and not isinstance(width, bool)
                and 0.0 < width < math.inf
            ):
                self.tolerances.append(Tolerance(name, key, float(width)))
            else:
                self.mistakes.note(
                    here,
                    f"tolerance {width!r}: expected a number in "
                    f'{meaning.unit} or a percentage such as "1 %"',
                )
        return component


def share_of(text: str) -> float | None:
    """A percentage as a share."""
    match = re.fullmatch(r"\s*([0-9.]+(?:e-?\d+)?)\s*%\s*", text)
    return float(match.group(1)) / 100.0 if match else None
