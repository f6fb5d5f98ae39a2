"""Reads a machine's description, one TOML beside an MJCF, and explains every mistake in it in one line."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections import namedtuple
from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from controllers.formula import Formula, formula
from controllers.quantity import Quantity, fields
from rigtwin import parameters, parts
from rigtwin.effects import KINDS
from rigtwin.errors import RigtwinError
from rigtwin.machine.machine import Component, Control, Joint, Machine, ReplayOf, Row
from rigtwin.machine.mechanism import Mechanism
from rigtwin.machine.tolerance import Tolerance

TYPES: dict[str, type] = {
    "mass": parts.Mass,
    "guide": parts.Guide,
    "force actuator": parts.ForceActuator,
    "position actuator": parts.PositionActuator,
    "position sensor": parts.PositionSensor,
    "velocity sensor": parts.VelocitySensor,
    "force sensor": parts.ForceSensor,
    "carriage": parameters.Carriage,
    "rail": parameters.Rail,
    "tyre": parameters.Tyre,
    "motor": parameters.Motor,
    "cylinder": parameters.Cylinder,
    "lvdt": parameters.Lvdt,
    "load cell": parameters.LoadCell,
}
"""Type of component as a description calls it."""
ELEMENTS = ("body", "joint", "tendon", "contact", "actuator", "sensor")
"""Elements of an MJCF that can be components."""
SENSED = {
    "position sensor": "position",
    "velocity sensor": "velocity",
    "force sensor": "force",
    "lvdt": "position",
    "load cell": "force",
}
MOVING = ("force actuator", "position actuator", "motor", "cylinder")
"""Types that take a command."""
UNITS = {"position": ("m", "rad"), "velocity": ("m/s", "rad/s"), "force": ("N", "Nm")}
"""What is measured → its unit where the joint slides, and where it turns."""
COMPONENT_KEYS = (*ELEMENTS, "type", "channel", "command", "unit", "effects")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
NOMINAL = ("known", "rough")
"""How well the nominal values are known."""


class _Mistakes(list[str]):
    """Collected while reading goes on."""

    def note(self, where: str, what: str) -> None:
        self.append(f"{where}: {what}" if where else what)


def load(path: Path) -> Machine:
    """The machine of a description. Raises RigtwinError with the first mistake in it."""
    machine, mistakes = examined(path)
    if mistakes or machine is None:
        more = f" (and {len(mistakes) - 1} more; rigtwin machine check {path})" if len(mistakes) > 1 else ""
        raise RigtwinError(f"{path}: {mistakes[0]}{more}")
    return machine


def examined(path: Path) -> tuple[Machine | None, list[str]]:
    """The machine of a description, and all mistakes in it, one line each; no machine if there are any."""
    mistakes = _Mistakes()
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        return None, [f"cannot read it: {error.strerror}"]
    except (ValueError, RecursionError) as error:
        return None, [f"it is not valid TOML: {error}"]
    reader = _Reader(path, document, mistakes)
    machine = reader.machine()
    return (None if mistakes else machine), list(mistakes)


def _near(word: object, known: Iterable[str]) -> str:
    """What was probably meant, and what there is."""
    names = list(known)
    close = difflib.get_close_matches(str(word), names, 1)
    return (f"did you mean {close[0]!r}? " if close else "") + f"there are {', '.join(names) or 'none'}"


def _share(text: str) -> float | None:
    """A percentage as a share."""
    match = re.fullmatch(r"\s*([0-9.]+(?:e-?\d+)?)\s*%\s*", text)
    return float(match.group(1)) / 100.0 if match else None


class _Reader:
    def __init__(self, path: Path, document: Mapping[str, Any], mistakes: _Mistakes) -> None:
        self._path, self._document, self._mistakes = path, document, mistakes
        self._components: dict[str, Component] = {}
        self._types: dict[str, str] = {}
        self._values: dict[str, Any] = {}
        self._tolerances: list[Tolerance] = []
        self._sources: dict[str, str] = {}

    def machine(self) -> Machine | None:
        note = self._mistakes.note
        for key in self._document:
            if key not in ("machine", "components", "controller", "replays", "mains"):
                note("", f"unknown table [{key}]; {_near(key, ('machine', 'components', 'controller', 'replays', 'mains'))}")
        about = self._table("machine", ("name", "title", "model", "nominal", "form"), required=("name", "model"))
        name = str(about.get("name", ""))
        if "name" in about and not isinstance(about["name"], str):
            note("[machine] name", f"{name}: expected a text, in quotes")
        elif "name" in about and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            note("[machine] name", f"{name!r}: expected letters, digits, - and _")
        nominal = about.get("nominal", "rough")
        if nominal not in NOMINAL:
            note("[machine] nominal", f"{str(nominal)[:40]!r}: expected {' or '.join(NOMINAL)}")
        form = self._number("[machine] form", about["form"], 1e-6, 0.5) if "form" in about else None
        mechanism = self._mechanism(about)
        given = self._document.get("components")
        if not isinstance(given, Mapping) or not given:
            note("", "it has no [components.NAME]; expected at least what moves it and what is observed")
            given = {}
        if mechanism is None:
            return None
        for each, table in given.items():
            self._component(each, table, mechanism)
        control = self._control()
        replays = self._replays(mechanism, control)
        mains = self._number("[mains] frequency", self._mains().get("frequency", 50.0), 1.0, 400.0)
        if self._mistakes:
            return None
        self._default_timing(replays)
        names = [*self._components, "computer", "mains"]
        values = [*self._values.values(), parameters.Computer(), parameters.Mains(mains)]
        made = parameters.Plant if self.quarter_car else namedtuple("Plant", names)  # type: ignore[misc]
        plant: Any = made(*values)
        title = str(about.get("title", name))
        model = self._model_path(about)
        tolerances = tuple(self._tolerances)
        return Machine(
            name,
            title,
            self._path,
            model,
            plant,
            self._components,
            tolerances,
            replays,
            control,
            nominal == "rough",
            form,
            self._sources,
        )

    # Tables and numbers.

    def _table(self, name: str, known: tuple[str, ...], required: tuple[str, ...] = ()) -> Mapping[str, Any]:
        table = self._document.get(name, {})
        if not isinstance(table, Mapping):
            self._mistakes.note(f"[{name}]", "expected a table")
            return {}
        for key in table:
            if key not in known:
                self._mistakes.note(f"[{name}]", f"unknown key {key!r}; {_near(key, known)}")
        for key in required:
            if key not in table:
                self._mistakes.note(f"[{name}]", f"{key} is missing")
        return table

    def _mains(self) -> Mapping[str, Any]:
        return self._table("mains", ("frequency",))

    def _number(self, where: str, value: object, low: float, high: float) -> float:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
        if not low <= number <= high:
            shown = repr(value) if isinstance(value, str) else str(value)
            self._mistakes.note(where, f"{shown[:40]}: expected a number from {low:g} to {high:g}")
            return low
        return number

    def _model_path(self, about: Mapping[str, Any]) -> Path:
        """Beside the description, or where the project keeps its models."""
        beside = self._path.parent / str(about.get("model", ""))
        shipped = Path(str(files("models"))) / "xml" / str(about.get("model", ""))
        return shipped if not beside.is_file() and shipped.is_file() else beside

    def _mechanism(self, about: Mapping[str, Any]) -> Mechanism | None:
        if not isinstance(about.get("model"), str):
            if "model" in about:
                self._mistakes.note("[machine] model", "expected the name of an MJCF file")
            return None
        try:
            return Mechanism(self._model_path(about))
        except RigtwinError as error:
            self._mistakes.note("[machine]", str(error))
            return None

    # Components.

    def _component(self, name: str, table: object, mechanism: Mechanism) -> None:
        where = f"[components.{name}]"
        if not isinstance(table, Mapping):
            self._mistakes.note(where, "expected a table")
            return
        if not NAME.fullmatch(name) or name in ("computer", "mains", "controller"):
            self._mistakes.note(where, f"{name!r} cannot be a component's name; expected letters, digits and _")
            return
        elements = [key for key in ELEMENTS if key in table]
        if len(elements) != 1:
            self._mistakes.note(
                where, f"expected one of {', '.join(ELEMENTS)} to say what of the MJCF it is, found {len(elements)}"
            )
            return
        element, mjcf = elements[0], str(table[elements[0]])
        if mjcf not in mechanism.names(element):
            self._mistakes.note(where, f"the MJCF has no {element} {mjcf!r}; {_near(mjcf, mechanism.names(element))}")
            return
        kind = self._type(where, table, element, mjcf, mechanism)
        if kind is None:
            return
        joint = mechanism.joint_of(element, mjcf)
        self._types[name] = kind
        self._values[name] = self._filled(name, where, kind, table, element, mjcf, joint, mechanism)
        turns = bool(joint) and bool(mechanism.model.joint(joint).type[0] == 3)
        unit = str(table.get("unit", ""))
        for key in ("channel", "command", "unit"):
            if key in table and not isinstance(table[key], str):
                self._mistakes.note(where, f"{key} = {table[key]}: expected a text, in quotes")
        channel: tuple[str, str] | None = None
        if kind in SENSED:
            unit = UNITS[SENSED[kind]][turns]
            channel = ("/sensor", str(table.get("channel", name)))
            if table.get("unit", unit) != unit:
                self._mistakes.note(
                    where, f"unit {table['unit']!r}: recordings are in SI, here {unit!r}; rigtwin import converts"
                )
        elif kind in MOVING:
            channel = ("/command", str(table.get("command", name)))
            if kind in ("position actuator", "cylinder"):
                unit = UNITS["position"][turns]
        for key, fits in (("channel", kind in SENSED), ("command", kind in MOVING)):
            if key in table and not fits:
                self._mistakes.note(where, f"{key} is for {'sensors' if key == 'channel' else 'actuators'}; this is a {kind}")
        self._components[name] = Component(name, element, mjcf, joint, channel, unit, self._kinds(where, kind, table))

    def _type(self, where: str, table: Mapping[str, Any], element: str, mjcf: str, mechanism: Mechanism) -> str | None:
        if "type" in table:
            if table["type"] not in TYPES:
                self._mistakes.note(where, f"unknown type {table['type']!r}; {_near(table['type'], TYPES)}")
                return None
            return str(table["type"])
        if element == "body":
            return "mass"
        if element == "joint":
            return "guide"
        if element == "actuator":
            return "position actuator" if mechanism.positions(mjcf) else "force actuator"
        if element == "sensor" and (measures := mechanism.measures(mjcf)):
            return f"{measures} sensor"
        self._mistakes.note(where, f"{element} {mjcf!r} needs a type; there are {', '.join(TYPES)}")
        return None

    def _kinds(self, where: str, kind: str, table: Mapping[str, Any]) -> frozenset[str] | None:
        if "effects" not in table:
            return None
        possible = sorted({each.name for each in KINDS if TYPES[kind] in each.at})
        wanted = table["effects"]
        if not isinstance(wanted, list) or not all(isinstance(each, str) for each in wanted):
            self._mistakes.note(where, 'effects: expected a list of kinds, such as ["gain", "offset"], or [] for none')
            return None
        for each in wanted:
            if each not in possible:
                self._mistakes.note(where, f"effects: a {kind} has no {each!r}; {_near(each, possible)}")
        return frozenset(wanted)

    def _filled(
        self,
        name: str,
        where: str,
        kind: str,
        table: Mapping[str, Any],
        element: str,
        mjcf: str,
        joint: str,
        mechanism: Mechanism,
    ) -> Any:
        """The component's values: those of its type, then of the MJCF, then of the description."""
        component = TYPES[kind]()
        meanings = {key: meaning for key, meaning in fields(TYPES[kind]).items() if isinstance(meaning, Quantity)}
        if kind == "mass" and joint:
            component = component._replace(mass=mechanism.joint(joint).inertia)
        elif kind == "guide" and joint:
            component = component._replace(**mechanism.friction(joint))
        elif kind == "force actuator":
            constant, limit = mechanism.force_per_command(mjcf)
            if constant <= 0.0:
                self._mistakes.note(where, f"actuator {mjcf!r} has gear times gain {constant:g}; expected more than 0")
                return component
            component = component._replace(constant=constant, force_limit=min(limit, parameters.UNLIMITED))
        for key, given in table.items():
            if key in COMPONENT_KEYS:
                continue
            if key not in meanings:
                known = [each for each in (*meanings, *COMPONENT_KEYS) if each not in ELEMENTS or each == element]
                self._mistakes.note(where, f"unknown key {key!r}; {_near(key, known)}")
                continue
            component = self._value(name, where, component, key, given, meanings[key])
        return component

    def _value(self, name: str, where: str, component: Any, key: str, given: object, meaning: Quantity) -> Any:
        """One parameter: a number, or a table of value, tolerance and source."""
        here = f"{where} {key}"
        table: Mapping[str, Any] = given if isinstance(given, Mapping) else {"value": given}
        for each in table:
            if each not in ("value", "tolerance", "source"):
                self._mistakes.note(here, f"unknown key {each!r}; {_near(each, ('value', 'tolerance', 'source'))}")
        if "value" in table:
            component = component._replace(**{key: self._number(here, table["value"], meaning.low, meaning.high)})
        if "source" in table:
            self._sources[f"{name}.{key}"] = str(table["source"])
        if "tolerance" in table:
            width = table["tolerance"]
            share = _share(width) if isinstance(width, str) else None
            if share is not None and 0.0 < share <= 1.0:
                self._tolerances.append(Tolerance(name, key, share, True))
            elif isinstance(width, int | float) and not isinstance(width, bool) and 0.0 < width < math.inf:
                self._tolerances.append(Tolerance(name, key, float(width)))
            else:
                self._mistakes.note(
                    here, f'tolerance {width!r}: expected a number in {meaning.unit} or a percentage such as "1 %"'
                )
        return component

    # Controller and replays.

    def _control(self) -> Control | None:
        if "controller" not in self._document:
            return None
        table = self._table("controller", ("output", "formula", "inputs", "settings", "exact"), required=("output", "formula"))
        settings, inputs = table.get("settings", {}), table.get("inputs", {})
        if not isinstance(settings, Mapping) or not all(isinstance(v, int | float) for v in settings.values()):
            self._mistakes.note("[controller] settings", "expected a table of numbers")
            return None
        outputs = {c.channel[1]: n for n, c in self._components.items() if self._types[n] in MOVING and c.channel}
        output = str(table.get("output", ""))
        if "output" in table and output not in outputs:
            self._mistakes.note("[controller] output", f"no actuator takes the command {output!r}; {_near(output, outputs)}")
        try:
            compiled: Formula = formula(str(table.get("formula", "0")), {key: float(v) for key, v in settings.items()})
        except ValueError as error:
            self._mistakes.note("[controller] formula", str(error))
            return None
        unused = [key for key in settings if not re.search(rf"\b{re.escape(key)}\b", compiled.text)]
        if unused:
            self._mistakes.note("[controller] settings", f"{', '.join(unused)} not in the formula")
        channels: dict[str, tuple[str, str]] = {}
        for name in compiled.inputs:
            known = self._components.get(name)
            wanted = inputs.get(name) if isinstance(inputs, Mapping) else None
            if wanted is not None:
                topic, _, field = str(wanted).partition(".")
                if topic not in ("/command", "/sensor") or not field:
                    self._mistakes.note("[controller] inputs", f"{name} = {wanted!r}: expected /command.NAME or /sensor.NAME")
                channels[name] = (topic, field)
            elif known is not None and known.channel is not None and known.element == "sensor":
                channels[name] = known.channel
            else:
                channels[name] = ("/command", name)
        exact = None
        if "exact" in table:
            exact = self._number("[controller] exact", table["exact"], 1e-300, 1e9)
        return Control(output, compiled, channels, exact)

    def _replays(self, mechanism: Mechanism, control: Control | None) -> tuple[ReplayOf, ...]:
        given = self._document.get("replays", [])
        if not isinstance(given, list) or not given or not all(isinstance(each, Mapping) for each in given):
            self._mistakes.note("", "it has no [[replays]]; expected one that says what moves the joint and what is observed")
            return ()
        found = []
        for number, table in enumerate(given, start=1):
            replay = self._replay(f"[[replays]] {table.get('name', number)}", table, number, mechanism, control)
            if replay is not None:
                found.append(replay)
        names = [row.name for replay in found for row in replay.rows]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            self._mistakes.note("[[replays]]", f"{name} is observed by two replays; expected one")
        return tuple(found)

    def _replay(
        self, where: str, table: Mapping[str, Any], number: int, mechanism: Mechanism, control: Control | None
    ) -> ReplayOf | None:
        before = len(self._mistakes)
        for key in table:
            if key not in ("name", "moved_by", "observe"):
                self._mistakes.note(where, f"unknown key {key!r}; {_near(key, ('name', 'moved_by', 'observe'))}")
        movers = table.get("moved_by", [])
        movers = [movers] if isinstance(movers, str) else movers
        known = [name for name, kind in self._types.items() if kind in (*MOVING, "position sensor", "velocity sensor")]
        if not isinstance(movers, list) or not movers:
            said = "is missing" if "moved_by" not in table else "is no name"
            there = ", ".join(known) or "there is none"
            self._mistakes.note(
                where,
                f"moved_by {said}; expected an actuator or a sensor of the motion: {there}",
            )
            movers = []
        for mover in movers:
            if mover not in known:
                self._mistakes.note(where, f"moved_by {mover!r} is no actuator or sensor of the motion; {_near(mover, known)}")
        rows = [row for name in self._observed(where, table) if (row := self._row(where, name, movers, control)) is not None]
        if len(self._mistakes) > before:
            return None
        quarter_car = self.quarter_car
        joint_name = "" if quarter_car else self._components[movers[0]].joint
        if len(movers) > 1 and not quarter_car:
            self._mistakes.note(
                where, f"moved by {len(movers)} components; expected one, and another replay for each other joint"
            )
            return None
        if not joint_name and not quarter_car:
            self._mistakes.note(where, f"{movers[0]} acts on no joint of its own; expected one that does")
            return None
        try:
            joint = mechanism.joint(joint_name) if joint_name else Joint("", False, 0.0, (-1.0, 1.0), (0.0, 0.0), 0.0)
        except RigtwinError as error:
            self._mistakes.note(where, str(error))
            return None
        at = {
            kind: [n for n, t in self._types.items() if t == kind and self._components[n].joint == joint_name]
            for kind in ("mass", "guide")
        }
        for kind, names in at.items():
            if len(names) > 1:
                self._mistakes.note(where, f"joint {joint_name} has {len(names)} components of type {kind}; expected one")
        if not quarter_car:
            for row in rows:
                other = self._components.get(row.name)
                if other is not None and other.joint != joint_name:
                    self._mistakes.note(
                        where, f"{row.name} is of joint {other.joint or 'none'}, {movers[0]} moves {joint_name}"
                    )
        closed = control is not None and self._components[movers[0]].channel == ("/command", control.output)
        if self._types[movers[0]] == "force actuator" and not at["mass"]:
            self._mistakes.note(
                where, f"{movers[0]} pushes joint {joint_name}, whose mass is no component; add one of type mass"
            )
        if self._types[movers[0]] == "force actuator" and not at["guide"]:
            self._mistakes.note(where, f"{movers[0]} pushes joint {joint_name}, which is no component; add one of type guide")
        return ReplayOf(
            str(table.get("name", f"replay {number}")),
            joint,
            tuple(movers),
            tuple(rows),
            at["guide"][0] if at["guide"] else None,
            at["mass"][0] if at["mass"] else None,
            closed,
        )

    @property
    def quarter_car(self) -> bool:
        """Whether its components are those of a quarter car between two cylinders."""
        return sorted(self._types.values()) == sorted(QUARTER_CAR) and tuple(self._components) == QUARTER_CAR_NAMES

    def _observed(self, where: str, table: Mapping[str, Any]) -> list[str]:
        observed = table.get("observe", [])
        if not isinstance(observed, list) or not observed or not all(isinstance(each, str) for each in observed):
            said = "is missing" if "observe" not in table else f"= {str(observed)[:40]!r}"
            self._mistakes.note(where, f"observe {said}; expected a list of sensors, or of the controller's command")
            return []
        return observed

    def _row(self, where: str, name: str, movers: list[str], control: Control | None) -> Row | None:
        known = self._components.get(name)
        sensors = [each for each, kind in self._types.items() if kind in SENSED]
        if known is not None and self._types[name] in SENSED and known.channel is not None:
            if name in movers:
                self._mistakes.note(where, f"{name} moves the joint, so it cannot be observed there too")
                return None
            return Row(name, SENSED[self._types[name]], known.channel, known.unit)
        if control is not None and name == control.output:
            unit = next(c.unit for c in self._components.values() if c.channel == ("/command", name))
            return Row(name, "command", ("/command", name), unit or "1")
        there = [*sensors, *([control.output] if control else [])]
        self._mistakes.note(where, f"observe: {name!r} is no sensor or controller's command; {_near(name, there)}")
        return None

    def _default_timing(self, replays: tuple[ReplayOf, ...]) -> None:
        """Nobody knows to less than half a tick when a sample was taken; expressed in ticks, since the period is the
        recording's."""
        declared = {(each.group, each.parameter) for each in self._tolerances}
        for replay in replays:
            names = [*replay.moved_by[:1], *(row.name for row in replay.rows if row.kind != "command")]
            for name in names:
                # What is in one loop with the controller was sampled with it.
                if (name, "delay") not in declared and not replay.closed and not self.quarter_car:
                    self._tolerances.append(Tolerance(name, "delay", TICKS_LATE, ticks=True))


TICKS_LATE = 0.5
"""Ticks by which a sample may be early or late."""
QUARTER_CAR = ("carriage", "rail", "tyre", "motor", "cylinder", "cylinder", "lvdt", "lvdt", "lvdt", "load cell")
QUARTER_CAR_NAMES = parameters.Plant._fields[:-2]
"""Components of a quarter car between two cylinders, which has a faster solver of its own (rigtwin.machine.quarter_car)."""
