"""Machines by name: the shipped descriptions, and descriptions of a user by their path."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from rigtwin.description.bare import MODELS, describe_model
from rigtwin.description.document import load
from rigtwin.description.machine import Machine
from rigtwin.description.menagerie import find_robot, is_robot
from rigtwin.errors import RigtwinError

SHIPPED = Path(str(files("machines")))
"""Folder of the shipped descriptions."""


def shipped() -> dict[str, Path]:
    """Return the shipped descriptions as machine name → path."""
    return {path.stem.replace("_", "-"): path for path in sorted(SHIPPED.glob("*.toml"))}


@cache
def _load_once(path: Path) -> Machine:
    return load(path)


def find(name: str) -> Machine:
    """Return a machine.

    Parameters
    ----------
    name
        Name of a shipped machine, of a robot such as `menagerie:universal_robots_ur5e`, or path of
        a description or of a model without one.

    Raises
    ------
    RigtwinError
        If no such machine exists, or if its description has a mistake.
    """
    # Shipped descriptions do not change while Python runs; a user's may, and is read anew.
    if name in shipped():
        return _load_once(shipped()[name])
    path = find_robot(name) if is_robot(name) else Path(name)
    if path.suffix.lower() in MODELS:
        return describe_model(path)
    if path.suffix == ".toml" or path.exists():
        return load(path)
    raise RigtwinError(
        f"unknown machine {name!r}; there are {', '.join(shipped())}, "
        "or give the path of a description, F.toml"
    )


def own_description(machine: Machine) -> Path | None:
    """Return the path of a user's description, or None for a shipped machine.

    Every installation knows a shipped machine by its name.
    """
    return None if shipped().get(machine.name) == machine.path else machine.path
