"""Writer of the user's MJCF with changed values. Only the changed attributes are rewritten."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from rigtwin.components import SERVOS, ForceActuator, Guide, Mass, Rail, Rotor, Servo, component_of
from rigtwin.components.quantity import UNLIMITED
from rigtwin.components.servo import PUSHERS, pusher_of
from rigtwin.description.component import Component
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mjcf_text import PARENTS, Document, Tag
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write

ATTRIBUTES: dict[type, dict[str, str]] = {
    Guide: {"coulomb": "frictionloss"},
    Rail: {"coulomb": "frictionloss", "viscous": "damping"},
    Rotor: {"inertia": "armature"},
    Servo: {"position_gain": "kp", "damping_gain": "kv"},
}
"""Type of component → parameter → attribute of its joint, tendon or position actuator."""
POLYNOMIALS = {
    "stiffness": ("stiffness", "", "cubic_stiffness"),
    "damping": ("viscous", "drag"),
}
"""Attribute of a joint or tendon → parameters of a guide that are its coefficients; "" is zero."""
STOP = ("stop_stiffness", "stop_damping", "stop_low", "stop_high")
"""Parameters of a guide's end stops, which are written together."""
SOFTEST = 1e-4
"""Impedance of a joint limit that is a spring: the smallest that MuJoCo takes."""
INERTIAL = ("mass", "diaginertia", "fullinertia", "density")
"""Attributes that are proportional to the mass."""


@dataclass(frozen=True)
class Change:
    """New value of a component's parameter.

    Attributes
    ----------
    component
        Name of the component.
    parameter
        Name of the parameter.
    value
        New value, in the parameter's unit.
    """

    component: str
    parameter: str
    value: float


def write_mjcf(path: Path, machine: Machine, changes: Sequence[Change]) -> tuple[str, ...]:
    """Write a machine's MJCF with changed values.

    Parameters
    ----------
    path
        File to write. MuJoCo resolves relative paths in an MJCF against the folder of that file.
    machine
        Machine with the MJCF and its present values.
    changes
        Values to change.

    Returns
    -------
    tuple of str
        Changes for which MJCF has no attribute, one line per change.

    Raises
    ------
    RigtwinError
        If the model is a URDF, an element stands in another file, or the file cannot be written.
    """
    if machine.model.suffix.lower() == ".urdf":
        raise RigtwinError(f"{machine.model.name} is a URDF; expected an MJCF")
    if path.exists() and path.samefile(machine.model):
        raise RigtwinError(f"{path} is the machine's own model; name another output")
    document, unwritten = Document(machine.model), []
    for change in changes:
        if not _apply(document, machine, change, changes):
            unwritten.append(f"{change.component}.{change.parameter} = {change.value:.6g}")
    atomic_write(path, document.text())
    return tuple(unwritten)


def _apply(document: Document, machine: Machine, change: Change, changes: Sequence[Change]) -> bool:
    """Set the attribute of a change. Return whether MJCF has such an attribute."""
    component = machine.components.get(change.component)
    if component is None:
        return False
    if component.component_type is Guide and _set_polynomial(document, machine, change, changes):
        return True
    attribute = ATTRIBUTES.get(component.component_type, {}).get(change.parameter)
    if attribute is not None and component.element in PARENTS:
        tag = document.find(component.element, component.mjcf)
        if component.element == "actuator" and (
            tag.name != "position" or "dampratio" in tag.attributes
        ):
            # Only <position> has kp and kv, and MuJoCo computes kv from dampratio where it is set.
            return False
        document.set(tag, attribute, _number(change.value * _factor_of(component, changes)))
        return True
    if change.parameter == "slack" and component.element == "tendon":
        tag = document.find(component.element, component.mjcf)
        rest, half = Mechanism(machine.model).rest_length(component.mjcf), 0.5 * change.value
        document.set(tag, "springlength", f"{_number(rest - half)} {_number(rest + half)}")
        return True
    if change.parameter in STOP and component.element == "joint":
        _set_stops(document, machine, component, changes)
        return True
    if component.component_type is Mass and change.parameter == "mass":
        nominal = component_of(machine.plant, component.name, Mass).mass
        # A body may consist of geoms without a mass of their own: all of them are scaled alike.
        return nominal > 0.0 and _scale_mass(document, component, change.value / nominal)
    if component.element == "actuator":
        return _apply_to_actuator(document, machine, component, change, changes)
    return False


def _set_polynomial(
    document: Document, machine: Machine, change: Change, changes: Sequence[Change]
) -> bool:
    """Set the spring or damper of a guide. Return whether the change is one of its coefficients."""
    component = machine.components[change.component]
    if component.element not in ("joint", "tendon"):
        return False
    for attribute, coefficients in POLYNOMIALS.items():
        if change.parameter in coefficients:
            if Mechanism(machine.model).beyond_guide(component.element, component.mjcf):
                # The coefficients that a guide does not have would be lost.
                return False
            values = _values(machine, component, changes)
            numbers = [values.get(name, 0.0) for name in coefficients]
            while len(numbers) > 1 and numbers[-1] == 0.0:
                numbers.pop()
            tag = document.find(component.element, component.mjcf)
            document.set(tag, attribute, " ".join(map(_number, numbers)))
            return True
    return False


def _set_stops(
    document: Document, machine: Machine, component: Component, changes: Sequence[Change]
) -> None:
    """Write end stops as the limits of a joint.

    A limit of impedance d asks for a force f with f·(d·A + (1 − d)·D) = −k·s − c·v − d·a₀, with
    `solreflimit` = (−k, −c), the way s beyond the limit, the exact inverse inertia A and its
    approximation D [MuJoCo documentation, Computation, Constraint model]. For d → 0 it is a spring
    of the stiffness k/D with a damper of c/D.
    """
    values = _values(machine, component, changes)
    mechanism = Mechanism(machine.model)
    model, number = mechanism.model, mechanism.number("joint", component.mjcf)
    light = float(model.dof_invweight0[model.jnt_dofadr[number]])
    # The file states angles in degrees unless its compiler says otherwise.
    compilers = [tag for tag in document.root.walk() if tag.name == "compiler"]
    in_radians = any(tag.attributes.get("angle") == "radian" for tag in compilers)
    unit = 1.0 if in_radians or not component.turns else math.degrees(1.0)
    tag = document.find("joint", component.mjcf)
    ends = (unit * values["stop_low"], unit * values["stop_high"])
    reference = (-light * values["stop_stiffness"], -light * values["stop_damping"])
    document.set(tag, "limited", "true")
    document.set(tag, "range", " ".join(map(_number, ends)))
    document.set(tag, "solreflimit", " ".join(map(_number, reference)))
    document.set(tag, "solimplimit", f"{SOFTEST:g} {SOFTEST:g} 0.001")


def _values(machine: Machine, component: Component, changes: Sequence[Change]) -> dict[str, float]:
    """Return the parameters of a guide with the changes that concern it."""
    values = {
        k: float(v) for k, v in component_of(machine.plant, component.name, Guide)._asdict().items()
    }
    return values | {c.parameter: c.value for c in changes if c.component == component.name}


def _factor_of(component: Component, changes: Sequence[Change]) -> float:
    """Return the factor on both gains of a servo that one of the changes sets, or else 1."""
    factors = (
        change.value
        for change in changes
        if (change.component, change.parameter) == (component.name, "gains")
    )
    return next(factors, 1.0) if component.component_type is Servo else 1.0


def _apply_to_actuator(
    document: Document,
    machine: Machine,
    component: Component,
    change: Change,
    changes: Sequence[Change],
) -> bool:
    """Set the attribute of an actuator's parameter. Return whether MJCF has such an attribute."""
    compiled = Mechanism(machine.model)
    model, number = compiled.model, compiled.number("actuator", component.mjcf)
    tag = document.find("actuator", component.mjcf)
    of = component.component_type
    if change.parameter == "delay":
        _set_delay(document, tag, model, number, change.value)
    elif change.parameter == "gains" and tag.name == "velocity":
        # The tag's kv is both gains.
        document.set(tag, "kv", _number(change.value * float(model.actuator_gainprm[number, 0])))
    elif change.parameter == "gains" and tag.name == "position":
        if "dampratio" in tag.attributes:
            return False
        servo = component_of(machine.plant, component.name, Servo)
        changed = {other.parameter for other in changes if other.component == component.name}
        for parameter, attribute in ATTRIBUTES[Servo].items():
            # A gain that is changed by itself is scaled where it is written.
            if parameter not in changed:
                value = change.value / servo.gains * float(getattr(servo, parameter))
                document.set(tag, attribute, _number(value))
    elif change.parameter == "lag" and of is Servo and tag.name == "position":
        document.set(tag, "timeconst", _number(change.value))
    elif change.parameter == "lag" and of in PUSHERS and tag.name == "general":
        document.set(tag, "dyntype", "filterexact" if change.value > 0.0 else "none")
        document.set(tag, "dynprm", _number(change.value))
    elif change.parameter in ("gain", "force_limit") and of is ForceActuator:
        nominal = pusher_of(machine.plant, component.name)
        values = {
            other.parameter: other.value for other in changes if other.component == component.name
        }
        gear = np.array(model.actuator_gear[number])
        gear[0] *= values.get("gain", nominal.gain) / nominal.gain
        last = int(np.max(np.nonzero(gear)[0], initial=0)) + 1
        if "gain" in values:
            document.set(tag, "gear", " ".join(_number(ratio) for ratio in gear[:last]))
        # MuJoCo limits the force before the gear. A changed gear must not move the limit at the
        # joint, so forcerange is divided by the new gear.
        limit = values.get("force_limit", nominal.force_limit)
        _set_force_limit(document, tag, limit / abs(float(gear[0])), limit)
    elif change.parameter == "force_limit" and of in SERVOS:
        gear = abs(float(model.actuator_gear[number, 0]))
        _set_force_limit(document, tag, change.value / gear, change.value)
    else:
        return False
    return True


def _set_delay(
    document: Document, tag: Tag, model: mujoco.MjModel, number: int, delay: float
) -> None:
    """Set a delay, and a history that is long enough for it."""
    samples = delay / float(model.opt.timestep)
    history = max(math.ceil(samples - 1e-9) + 1, int(model.actuator_history[number, 0]))
    document.set(tag, "delay", _number(delay))
    document.set(tag, "nsample", str(history))
    # A delay between two samples is exact only if MuJoCo interpolates.
    if abs(samples - round(samples)) > 1e-6 and model.actuator_history[number, 1] == 0:
        document.set(tag, "interp", "linear")


def _set_force_limit(document: Document, tag: Tag, limit: float, force: float) -> None:
    """Set a symmetric range of the force unless it is unlimited.

    limit: before the gear; force: at the joint.
    """
    if force < UNLIMITED:
        document.set(tag, "forcelimited", "true")
        document.set(tag, "forcerange", f"{_number(-limit)} {_number(limit)}")


def _scale_mass(document: Document, component: Component, share: float) -> bool:
    """Scale the mass of all bodies that move with the component's joint.

    Return whether the file states all of these masses; otherwise nothing is changed.
    """
    joint = document.find("joint", component.joint)
    assert joint.parent is not None
    weighed: list[Tag] = []
    for body in joint.parent.walk():
        if body.name != "body":
            continue
        # MuJoCo ignores the geoms of a body with <inertial> when it computes the mass.
        inertial = [tag for tag in body.children if tag.name == "inertial"]
        sources = inertial or [tag for tag in body.children if tag.name == "geom"]
        if any(not set(INERTIAL) & set(tag.attributes) for tag in sources):
            return False
        weighed += sources
    for tag in weighed:
        # The mass of a geom overrides its density, so only the first attribute counts.
        names = [name for name in INERTIAL if name in tag.attributes]
        for name in names[:1] if tag.name == "geom" else names:
            scaled = (share * float(number) for number in tag.attributes[name].split())
            document.set(tag, name, " ".join(_number(number) for number in scaled))
    return bool(weighed)


def _number(value: float) -> str:
    """Return a number as MJCF text, with 9 significant digits."""
    return f"{value:.9g}"
