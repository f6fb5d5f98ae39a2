"""Settings of a described machine's twin, by name, as `--set`, `--config` and `--without` change them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from controllers.quantity import Quantity, fields
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import assigned, checked, read_toml, values_of
from rigtwin.machine.effects import find
from rigtwin.machine.machine import Machine
from rigtwin.models.replaying import Setup


def nominal(machine: Machine) -> Setup:
    """The machine as its description has it."""
    return Setup(machine.plant, dict(machine.control.formula.settings) if machine.control else {})


def overridden(setup: Setup, changes: Mapping[str, object]) -> Setup:
    """The setup with `changes` (component → parameter → value; controller → setting → value). Raises RigtwinError for any not
    allowed."""
    plant, settings = setup.plant, dict(setup.settings)
    for group, values in changes.items():
        if group != "controller" and group not in plant._fields:
            raise RigtwinError(f"unknown component {group!r}; there are {', '.join([*plant._fields, 'controller'])}")
        if not isinstance(values, Mapping):
            raise RigtwinError(f"{group} = {values!r}: expected a table of values, such as [{group}]")
        for name, value in values.items():
            if group == "controller":
                if name not in settings:
                    raise RigtwinError(f"unknown setting controller.{name}; there are {', '.join(settings) or 'none'}")
                settings[name] = float(checked(f"controller.{name}", value, Quantity("1", -1e300, 1e300, "")))
                continue
            part = getattr(plant, group)
            meanings = fields(type(part))
            if name not in meanings:
                raise RigtwinError(f"unknown parameter {group}.{name}; {group} has {', '.join(meanings)}")
            plant = plant._replace(**{group: part._replace(**{name: checked(f"{group}.{name}", value, meanings[name])})})
    return Setup(plant, settings)


def from_toml(setup: Setup, path: Path) -> Setup:
    """The setup with a TOML file's values. Raises RigtwinError naming file and fault."""
    return read_toml(path, lambda tables: overridden(setup, values_of(tables)))


def from_assignments(setup: Setup, assignments: Sequence[str]) -> Setup:
    """The setup with `component.parameter=value` texts."""
    for changes in assigned(assignments):
        setup = overridden(setup, changes)
    return setup


def without(setup: Setup, name: str) -> Setup:
    """The setup with an effect of the nominal machine taken out, its magnitude set to 0."""
    effect = find(name, setup.plant)
    parameter, quantity = next(iter(effect.quantities().items()))
    if effect.nominal(setup.plant)[parameter] == 0.0 or quantity.low > 0.0:
        raise RigtwinError(f"--without {name}: the twin has none to take out")
    part = getattr(setup.plant, effect.group)
    return setup._replace(plant=setup.plant._replace(**{effect.group: part._replace(**{parameter: 0.0})}))
