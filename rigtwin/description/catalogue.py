"""Machines by name: the shipped descriptions, and descriptions of a user by their path."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from rigtwin.description.document import load
from rigtwin.description.machine import Machine
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
        Name of a shipped machine, or path of a description.

    Raises
    ------
    RigtwinError
        If no such machine exists, or if its description has a mistake.
    """
    # Shipped descriptions do not change while Python runs; a user's may, and is read anew.
    if name in shipped():
        return _load_once(shipped()[name])
    path = Path(name)
    if path.suffix.lower() in (".xml", ".mjcf", ".urdf"):
        raise RigtwinError(
            f"{name}: a model without a description; rigtwin describe {name} --log LOG "
            "--out FOLDER writes one, and rigtwin diagnose LOG takes a model as it is"
        )
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
