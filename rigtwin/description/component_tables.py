"""The component tables of a description: element of the MJCF, values, tolerances and effects."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from keyword import iskeyword
from typing import Any

from rigtwin import components
from rigtwin.components import KINDS, UNLIMITED
from rigtwin.components.quantity import Quantity, describe_disorder, fields
from rigtwin.components.sensors import MEASURES
from rigtwin.description.actuator_law import VELOCITY_SERVO
from rigtwin.description.component import Component
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, suggest
from rigtwin.description.physics import Physics, find_physics
from rigtwin.description.replay import ReplayOf
from rigtwin.description.tolerance import Tolerance
from rigtwin.recording.schema import NAME as FIELD_NAME

TYPES: dict[str, type] = {
    "mass": components.Mass,
    "body": components.Body,
    "base": components.Base,
    "guide": components.Guide,
    "rotor": components.Rotor,
    "schedule": components.Schedule,
    "warming": components.Warming,
    "force actuator": components.ForceActuator,
    "servo": components.Servo,
    VELOCITY_SERVO: components.VelocityServo,
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
"""Type of component, as a description writes it → class."""
ELEMENTS = ("body", "joint", "tendon", "contact", "actuator", "sensor")
"""Elements of an MJCF that can be components."""
SENSED = {name: MEASURES[of] for name, of in TYPES.items() if of in MEASURES}
"""Type of sensor → what it measures."""
WHOLE = ("body", "base")
"""Types that stand for a whole body and therefore have no coordinate."""
PUSHING = ("force actuator", "servo", VELOCITY_SERVO)
"""Types that exert a force on a joint, whose motion follows by forward dynamics."""
MOVING = (*PUSHING, "position actuator", "motor", "cylinder")
"""Types that take a command."""
READ = (*SENSED, "schedule")
"""Types that have a recorded channel which nothing commands."""
UNITS = {"position": ("m", "rad"), "velocity": ("m/s", "rad/s"), "force": ("N", "Nm")}
"""Measured quantity → its unit at a slide and at a hinge."""
AT: dict[str, tuple[str, ...]] = {
    "mass": ("body",),
    "body": ("body",),
    "base": ("body",),
    "carriage": ("body",),
    "guide": ("joint", "tendon"),
    "rail": ("joint",),
    "rotor": ("joint", "tendon"),
    "gas spring": ("joint", "tendon"),
    "schedule": ("joint",),
    "warming": ("joint",),
    "tyre": ("contact",),
    "cylinder": ("joint", "actuator"),
    **dict.fromkeys(("servo", VELOCITY_SERVO, "position actuator", "motor"), ("actuator",)),
    # A force on a joint that the model has no actuator for, such as that of a hand.
    "force actuator": ("actuator", "joint"),
    **dict.fromkeys(SENSED, ("sensor", "joint", "tendon")),
}
"""Type of component → elements of an MJCF that it can stand for."""
RESERVED = ("computer", "mains", "controller", "safety", "timing")
"""Names of the other groups of settings, which no component may have."""
COMPONENT_KEYS = (*ELEMENTS, "type", "channel", "command", "unit", "effects")
"""Keys of a component's table that are no parameters."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Pattern of a component's name, which becomes a field of a NamedTuple."""


class Components:
    """Components read so far.

    Attributes
    ----------
    by_name
        Component name → component.
    types
        Component name → type as the description writes it.
    values
        Component name → NamedTuple of its parameters.
    tolerances
        Declared tolerances of parameters.
    sources
        `component.parameter` → source of its value, a text.
    parameter_settings
        `component.parameter` → controller setting whose recorded value is the parameter's value.
    """

    def __init__(self, mechanism: Mechanism, mistakes: Mistakes) -> None:
        """Start without components. mistakes: list to which mistakes are added."""
        self._mechanism, self.mistakes = mechanism, mistakes
        self.by_name: dict[str, Component] = {}
        self.types: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        self.tolerances: list[Tolerance] = []
        self.sources: dict[str, str] = {}
        self.parameter_settings: dict[str, str] = {}

    def physics(self, replays: Sequence[ReplayOf] = ()) -> Physics:
        """Return the physics of the machine that the components make up."""
        return find_physics({name: type(value) for name, value in self.values.items()}, replays)

    def add(self, name: str, table: object) -> None:
        """Read the table of one component; note its mistakes and add it if it has an element and a
        type."""
        where = f"[components.{name}]"
        if not isinstance(table, Mapping):
            self.mistakes.note(where, "expected a table")
            return
        if not NAME.fullmatch(name) or name in RESERVED or iskeyword(name):
            taken = f", and none of {', '.join(RESERVED)}, and no keyword of Python"
            self.mistakes.note(
                where,
                f"{name[:40]!r} cannot be a component's name; expected letters, digits and _"
                + (taken if NAME.fullmatch(name) else ""),
            )
            return
        # What the component stands for decides everything else, so reading ends without it.
        reference = self._find_element(where, table)
        if reference is None:
            return
        element, mjcf = reference
        kind = self._type(where, table, element, mjcf)
        if kind is None:
            return
        mechanism = self._mechanism
        joint = mechanism.joint_of(element, mjcf)
        self.types[name] = kind
        self.values[name] = self._fill(
            name=name, where=where, kind=kind, table=table, element=element, mjcf=mjcf, joint=joint
        )
        # A whole body moves with all joints before it, so it has no single coordinate.
        acts_on = () if kind in WHOLE else mechanism.acts_on(element, mjcf)
        turns = mechanism.is_angle(acts_on)
        channel, unit = self._find_channel(name, where, kind, table, turns)
        self.by_name[name] = Component(
            name=name,
            component_type=TYPES[kind],
            element=element,
            mjcf=mjcf,
            joint=joint,
            channel=channel,
            unit=unit,
            kinds=self._kinds(where, kind, table),
            acts_on=acts_on,
            turns=turns,
        )

    def _find_element(self, where: str, table: Mapping[str, Any]) -> tuple[str, str] | None:
        """Return kind and name of the MJCF element that a table refers to; note its absence."""
        elements = [key for key in ELEMENTS if key in table]
        if len(elements) != 1:
            self.mistakes.note(
                where,
                f"expected one of {', '.join(ELEMENTS)} to say what "
                f"of the MJCF it is, found {len(elements)}",
            )
            return None
        element, mjcf = elements[0], str(table[elements[0]])
        names = self._mechanism.names(element)
        if mjcf not in names:
            self.mistakes.note(where, f"the MJCF has no {element} {mjcf!r}; {suggest(mjcf, names)}")
            return None
        return element, mjcf

    def _find_channel(
        self, name: str, where: str, kind: str, table: Mapping[str, Any], turns: bool
    ) -> tuple[tuple[str, str] | None, str]:
        """Return the recorded channel of a component, None without one, and the channel's unit."""
        unit = str(table.get("unit", ""))
        for key in ("channel", "command", "unit"):
            if key in table and not isinstance(table[key], str):
                self.mistakes.note(where, f"{key} = {table[key]}: expected a text, in quotes")
            elif key != "unit" and not FIELD_NAME.fullmatch(str(table.get(key, name))):
                self.mistakes.note(
                    where, f"{key} = {table[key]!r}: expected letters without accents, digits and _"
                )
        channel: tuple[str, str] | None = None
        if kind in SENSED:
            # The MJCF decides m or rad, N or Nm: the unit is no free choice of the description.
            unit = UNITS[SENSED[kind]][turns]
            channel = ("/sensor", str(table.get("channel", name)))
            if table.get("unit", unit) != unit:
                # A description that converted units would hide a wrong unit of the recording.
                self.mistakes.note(
                    where,
                    f"unit {table['unit']!r}: recordings are in SI, "
                    f"here {unit!r}; rigtwin import converts",
                )
        elif kind == "schedule":
            channel = ("/sensor", str(table.get("channel", name)))
        elif kind in MOVING:
            channel = ("/command", str(table.get("command", name)))
            # Commands of positions are in SI; those of forces are in the actuator's own unit.
            if kind in ("position actuator", "servo", "cylinder"):
                unit = UNITS["position"][turns]
        for key, fits in (("channel", kind in READ), ("command", kind in MOVING)):
            if key in table and not fits:
                self.mistakes.note(
                    where,
                    f"{key} is for {'sensors' if key == 'channel' else 'actuators'}; "
                    f"this is a {kind}",
                )
        for earlier, known in self.by_name.items():
            # Two actuators may take one command; two sensors cannot fill one channel.
            if channel is not None and known.channel == channel and kind in SENSED:
                self.mistakes.note(
                    where,
                    f"its channel {channel[1]!r} is that of {earlier}; "
                    "expected one for each sensor",
                )
        return channel, unit

    def _type(self, where: str, table: Mapping[str, Any], element: str, mjcf: str) -> str | None:
        """Return the type of a component: the declared one, or the one that its element implies."""
        if "type" in table:
            if table["type"] not in TYPES:
                self.mistakes.note(
                    where, f"unknown type {table['type']!r}; {suggest(table['type'], TYPES)}"
                )
                return None
            return self._fitting(where, str(table["type"]), element, mjcf)
        if element == "body":
            return "mass"
        if element == "joint" or (element == "tendon" and self._mechanism.acts_on(element, mjcf)):
            return "guide"
        if element == "actuator":
            if self._mechanism.positions(mjcf):
                return "position actuator"
            falls = self._mechanism.falls_with_speed(mjcf)
            return VELOCITY_SERVO if falls else "force actuator"
        if element == "sensor" and (measures := self._mechanism.measures(mjcf)):
            return f"{measures} sensor"
        self.mistakes.note(where, f"{element} {mjcf!r} needs a type; there are {', '.join(TYPES)}")
        return None

    def _fitting(self, where: str, kind: str, element: str, mjcf: str) -> str | None:
        """Return the declared type, or None if its MJCF element cannot have that type."""
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
        """Return the kinds of effects that a component may have; None for all of its type."""
        if "effects" not in table:
            return None
        # An empty list is allowed: no effect of the component is then searched for.
        possible = sorted({known.name for known in KINDS if TYPES[kind] in known.at})
        wanted = table["effects"]
        if not isinstance(wanted, list) or not all(isinstance(each, str) for each in wanted):
            self.mistakes.note(
                where,
                'effects: expected a list of kinds, such as ["gain", "offset"], or [] for none',
            )
            return None
        for name in wanted:
            if name not in possible:
                self.mistakes.note(
                    where, f"effects: a {kind} has no {name!r}; {suggest(name, possible)}"
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
        """Return the values of a component.

        Values of the description replace those of the MJCF, which replace the type's defaults.
        """
        component = self._read_mjcf(where, kind, element, mjcf, joint)
        if component is None:
            return TYPES[kind]()
        meanings = {
            key: meaning
            for key, meaning in fields(TYPES[kind]).items()
            if isinstance(meaning, Quantity)
        }
        for key, entry in table.items():
            if key in COMPONENT_KEYS:
                continue
            if key not in meanings:
                # Only the component's element is offered: the other elements would not fit.
                known = [
                    candidate
                    for candidate in (*meanings, *COMPONENT_KEYS)
                    if candidate not in ELEMENTS or candidate == element
                ]
                self.mistakes.note(where, f"unknown key {key!r}; {suggest(key, known)}")
                continue
            component = self._value(name, where, component, key, entry, meanings[key])
        values = component._asdict()
        for key, meaning in meanings.items():
            value = values[key]
            # Stated values were checked as they were read; those of the MJCF were not.
            if key not in table and not meaning.low <= value <= meaning.high:
                self.mistakes.note(
                    where,
                    f"{key} of {element} {mjcf!r} in the MJCF is {value:g}: expected a number "
                    f"from {meaning.low:g} to {meaning.high:g}",
                )
        if kind == "force actuator" and component.constant == 0.0:
            self.mistakes.note(where, "constant 0: expected another number")
        if (disorder := describe_disorder(values)) is not None:
            self.mistakes.note(where, disorder)
        return component

    def _read_mjcf(self, where: str, kind: str, element: str, mjcf: str, joint: str) -> Any:
        """Return a component with the values that the MJCF states, and defaults for the rest.

        The result is None where the component cannot express its actuator, which is noted.
        """
        component = TYPES[kind]()
        if kind == "mass" and joint:
            # M(q) holds the armature too, which turns with the motor and has no weight.
            moving = self._mechanism.joint(joint)
            component = component._replace(mass=moving.inertia - moving.armature)
        elif kind == "body" and element == "body":
            component = component._replace(**self._mechanism.body(mjcf))
        elif kind == "guide" and (element == "tendon" or joint):
            component = component._replace(**self._mechanism.friction(element, mjcf))
        elif kind == "rotor" and (element == "tendon" or joint):
            component = component._replace(inertia=self._mechanism.armature(element, mjcf))
        if element == "actuator" and kind in (*PUSHING, "position actuator"):
            obstacle = self._mechanism.actuator_obstacle(mjcf, kind)
            if obstacle is not None:
                self.mistakes.note(where, f"actuator {mjcf!r}: {obstacle}")
                return None
            component = component._replace(**self._mechanism.actuator_timing(mjcf))
        if element != "actuator":
            return component
        if kind == "position actuator":
            component = component._replace(**self._mechanism.rest_position(mjcf))
        elif kind in ("force actuator", VELOCITY_SERVO):
            constant, limit = self._mechanism.force_per_command(mjcf)
            # Below zero, a positive command pushes towards negative positions.
            if constant == 0.0:
                self.mistakes.note(
                    where,
                    f"actuator {mjcf!r} has gear times gain 0; expected another number",
                )
                return None
            component = component._replace(force_limit=min(limit, UNLIMITED))
            if kind == VELOCITY_SERVO:
                gain, damping = self._mechanism.velocity_law(mjcf)
                component = component._replace(velocity_gain=gain, damping_gain=damping)
            else:
                component = component._replace(constant=constant)
        elif kind == "servo":
            component = component._replace(**self._servo(where, mjcf))
        if kind in (*PUSHING, "position actuator"):
            # Bounds of a Quantity are finite, so that no limit is the number UNLIMITED.
            low, high = self._mechanism.command_limits(mjcf)
            component = component._replace(
                command_low=max(low, -UNLIMITED), command_high=min(high, UNLIMITED)
            )
        return component

    def _servo(self, where: str, mjcf: str) -> dict[str, float]:
        """Return the parameters of a servo that the MJCF states; note any other actuator."""
        parameters = self._mechanism.servo(mjcf)
        if parameters is None:
            self.mistakes.note(
                where,
                f"actuator {mjcf!r} is no servo; expected a position actuator of MuJoCo's, with "
                "gear 1",
            )
            return {}
        return parameters

    def _value(
        self, name: str, where: str, component: Any, key: str, entry: object, meaning: Quantity
    ) -> Any:
        """Return the component with one parameter as the description states it.

        The entry is a number, or a table with value, tolerance, source and setting.
        """
        place = f"{where} {key}"
        table: Mapping[str, Any] = entry if isinstance(entry, Mapping) else {"value": entry}
        self.mistakes.unknown(place, table, ("value", "tolerance", "source", "setting"))
        if "value" in table:
            component = component._replace(
                **{key: self.mistakes.number(place, table["value"], meaning.low, meaning.high)}
            )
        if "setting" in table:
            self.parameter_settings[f"{name}.{key}"] = str(table["setting"])
        if "source" in table:
            self.sources[f"{name}.{key}"] = str(table["source"])
        if "tolerance" in table:
            width = table["tolerance"]
            # A text is a percentage of the nominal value, a number is in the parameter's unit.
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
                    place,
                    f"tolerance {width!r}: expected a number in "
                    f'{meaning.unit} or a percentage such as "1 %"',
                )
        return component


def share_of(text: str) -> float | None:
    """Return a percentage such as "1.5 %" as a share; None for any other text."""
    match = re.fullmatch(r"\s*([0-9.]+(?:e-?\d+)?)\s*%\s*", text)
    return float(match.group(1)) / 100.0 if match else None
