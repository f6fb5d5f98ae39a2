"""The user's MJCF with other values: only the attributes that change are written, everything else
stays as it is, to the letter."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import mujoco
import numpy as np

from rigtwin.components import ForceActuator, Guide, Mass, Rail, Rotor, Servo
from rigtwin.components.quantity import UNLIMITED
from rigtwin.components.servo import PUSHERS
from rigtwin.description.machine import Component, Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write

ATTRIBUTES: dict[type, dict[str, str]] = {
    Guide: {"coulomb": "frictionloss", "viscous": "damping", "stiffness": "stiffness"},
    Rail: {"coulomb": "frictionloss", "viscous": "damping"},
    Rotor: {"inertia": "armature"},
    Servo: {"position_gain": "kp", "damping_gain": "kv"},
}
"""Component → parameter → attribute of its joint, tendon or position actuator."""
PARENTS = {"joint": "body", "tendon": "tendon", "actuator": "actuator"}
"""Element of a description → what its tag stands in."""
HEAVY = ("mass", "diaginertia", "fullinertia", "density")
"""Attributes that go with the mass."""


@dataclass(eq=False)
class Tag:
    """A start tag. first: where it begins in the file, bytes; parent: None of the root."""

    name: str
    attributes: dict[str, str]
    first: int
    parent: Tag | None
    children: list[Tag] = field(default_factory=list)

    def walk(self) -> Iterator[Tag]:
        """Itself and all in it."""
        yield self
        for child in self.children:
            yield from child.walk()


class Document:
    """An MJCF as text whose attributes can be set."""

    def __init__(self, path: Path) -> None:
        """Raises RigtwinError if it cannot be read."""
        self.path = path
        try:
            self._text = path.read_bytes()
        except OSError as error:
            raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
        self._edits: dict[int, dict[str, str]] = {}
        stack: list[Tag] = []
        parser = expat.ParserCreate()

        def begin(name: str, attributes: dict[str, str]) -> None:
            parent = stack[-1] if stack else None
            tag = Tag(name, attributes, parser.CurrentByteIndex, parent)
            if parent is not None:
                parent.children.append(tag)
            else:
                self.root = tag
            stack.append(tag)

        def end(_: str) -> None:
            stack.pop()

        parser.StartElementHandler, parser.EndElementHandler = begin, end
        try:
            parser.Parse(self._text, True)
        except expat.ExpatError as error:
            raise RigtwinError(f"model {path}: {error}") from None

    def find(self, element: str, name: str) -> Tag:
        """The tag of a named joint, tendon, actuator or body. Raises RigtwinError."""
        for tag in self.root.walk():
            own = tag.name == "body" if element == "body" else self._is_of(tag, element)
            if own and tag.attributes.get("name") == name:
                return tag
        raise RigtwinError(
            f"{self.path.name} has no {element} {name!r} itself; one that it includes may have it, "
            "and would have to be changed there"
        )

    @staticmethod
    def _is_of(tag: Tag, element: str) -> bool:
        inside = tag.parent is not None and tag.parent.name == PARENTS[element]
        return inside and (element != "joint" or tag.name == "joint")

    def set(self, tag: Tag, attribute: str, value: str) -> None:
        """Gives a tag an attribute."""
        self._edits.setdefault(tag.first, {})[attribute] = value

    def text(self) -> bytes:
        """The file with what was set."""
        out = self._text
        for first in sorted(self._edits, reverse=True):
            last = _end_of_tag(out, first)
            tag = out[first:last].decode()
            for attribute, value in self._edits[first].items():
                tag = _with_attribute(tag, attribute, value)
            out = out[:first] + tag.encode() + out[last:]
        return out


def _end_of_tag(text: bytes, first: int) -> int:
    quote = 0
    for place in range(first, len(text)):
        byte = text[place]
        if quote:
            quote = 0 if byte == quote else quote
        elif byte in b"\"'":
            quote = byte
        elif byte == ord(">"):
            return place + 1
    return len(text)


def _with_attribute(tag: str, attribute: str, value: str) -> str:
    found = re.search(rf"(\s{attribute}\s*=\s*)(\"[^\"]*\"|'[^']*')", tag)
    if found is not None:
        return tag[: found.start()] + f'{found.group(1)}"{value}"' + tag[found.end() :]
    end = re.search(r"\s*/?>$", tag)
    assert end is not None
    return f'{tag[: end.start()]} {attribute}="{value}"{tag[end.start() :]}'


@dataclass(frozen=True)
class Change:
    """A component's parameter, and its new value."""

    component: str
    parameter: str
    value: float


def write_mjcf(path: Path, machine: Machine, changes: Sequence[Change]) -> tuple[str, ...]:
    """Writes a machine's MJCF with other values.

    Parameters
    ----------
    path
        Where to. Files that the MJCF names are looked for beside it.
    machine
        Whose it is, with the values that the MJCF has.
    changes
        What is other.

    Returns
    -------
    tuple of str
        What MJCF has no attribute for, a line each.

    Raises
    ------
    RigtwinError
        If the model is a URDF, an element stands in another file, or the file cannot be written.
    """
    if machine.model.suffix.lower() == ".urdf":
        raise RigtwinError(f"{machine.model.name} is a URDF; expected an MJCF")
    if path.exists() and path.samefile(machine.model):
        raise RigtwinError(f"{path} is the machine's own model; name another output")
    document, left = Document(machine.model), []
    for change in changes:
        if not _apply(document, machine, change, changes):
            left.append(f"{change.component}.{change.parameter} = {change.value:.6g}")
    atomic_write(path, document.text())
    return tuple(left)


def _apply(document: Document, machine: Machine, change: Change, changes: Sequence[Change]) -> bool:
    """Whether the change has a place in the document, which then has it."""
    component = machine.components.get(change.component)
    if component is None:
        return False
    nominal = getattr(machine.plant, change.component)
    attribute = ATTRIBUTES.get(type(nominal), {}).get(change.parameter)
    if attribute is not None and component.element in PARENTS:
        tag = document.find(component.element, component.mjcf)
        if component.element == "actuator" and (
            tag.name != "position" or "dampratio" in tag.attributes
        ):
            # Another tag has other attributes, and a ratio would be what kv is worked out from.
            return False
        document.set(tag, attribute, _number(change.value))
        return True
    if isinstance(nominal, Mass) and change.parameter == "mass" and nominal.mass > 0.0:
        return _scale_mass(document, component, change.value / nominal.mass)
    if component.element == "actuator":
        return _apply_to_actuator(document, machine, component, change, changes)
    return False


def _apply_to_actuator(
    document: Document,
    machine: Machine,
    component: Component,
    change: Change,
    changes: Sequence[Change],
) -> bool:
    """Whether an actuator's parameter has a place in the document, which then has it."""
    nominal = getattr(machine.plant, change.component)
    compiled = Mechanism(machine.model)
    model, number = compiled.model, compiled.number("actuator", component.mjcf)
    tag = document.find("actuator", component.mjcf)
    pushes = isinstance(nominal, ForceActuator)
    if change.parameter == "delay":
        _set_delay(document, tag, model, number, change.value)
    elif change.parameter == "lag" and isinstance(nominal, Servo) and tag.name == "position":
        document.set(tag, "timeconst", _number(change.value))
    elif change.parameter == "lag" and isinstance(nominal, PUSHERS) and tag.name == "general":
        document.set(tag, "dyntype", "filterexact" if change.value > 0.0 else "none")
        document.set(tag, "dynprm", _number(change.value))
    elif change.parameter in ("gain", "force_limit") and pushes:
        said = {each.parameter: each.value for each in changes if each.component == component.name}
        gear = np.array(model.actuator_gear[number])
        gear[0] *= said.get("gain", nominal.gain) / nominal.gain
        last = int(np.max(np.nonzero(gear)[0], initial=0)) + 1
        if "gain" in said:
            document.set(tag, "gear", " ".join(_number(each) for each in gear[:last]))
        # MuJoCo limits the force before the gear; the limit stays where it was behind it.
        limit = said.get("force_limit", nominal.force_limit)
        _set_force_limit(document, tag, limit / abs(float(gear[0])), limit)
    elif change.parameter == "force_limit" and isinstance(nominal, Servo):
        _set_force_limit(document, tag, change.value, change.value)
    else:
        return False
    return True


def _set_delay(
    document: Document, tag: Tag, model: mujoco.MjModel, number: int, delay: float
) -> None:
    """A delay, and a history that is long enough for it."""
    samples = delay / float(model.opt.timestep)
    kept = max(math.ceil(samples - 1e-9) + 1, int(model.actuator_history[number, 0]))
    document.set(tag, "delay", _number(delay))
    document.set(tag, "nsample", str(kept))
    if abs(samples - round(samples)) > 1e-6 and model.actuator_history[number, 1] == 0:
        document.set(tag, "interp", "linear")


def _set_force_limit(document: Document, tag: Tag, limit: float, force: float) -> None:
    if force < UNLIMITED:
        document.set(tag, "forcelimited", "true")
        document.set(tag, "forcerange", f"{_number(-limit)} {_number(limit)}")


def _scale_mass(document: Document, component: Component, share: float) -> bool:
    """All bodies that move with the component's joint, by the same share; False if it is not told
    in the file what they weigh."""
    joint = document.find("joint", component.joint)
    assert joint.parent is not None
    heavy = []
    for body in joint.parent.walk():
        if body.name != "body":
            continue
        inertial = [tag for tag in body.children if tag.name == "inertial"]
        told = inertial or [tag for tag in body.children if tag.name == "geom"]
        if any(not set(HEAVY) & set(tag.attributes) for tag in told):
            return False
        heavy += told
    for tag in heavy:
        # A geom with a mass has its density from that.
        own = [name for name in HEAVY if name in tag.attributes]
        for name in own[:1] if tag.name == "geom" else own:
            scaled = (share * float(each) for each in tag.attributes[name].split())
            document.set(tag, name, " ".join(_number(each) for each in scaled))
    return bool(heavy)


def _number(value: float) -> str:
    return f"{value:.9g}"
