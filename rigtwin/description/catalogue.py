"""The machines that descriptions are shipped for, and those of a user."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from rigtwin.description.document import load
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError

SHIPPED = Path(str(files("machines")))


def shipped() -> dict[str, Path]:
    """Name → description."""
    return {path.stem.replace("_", "-"): path for path in sorted(SHIPPED.glob("*.toml"))}


@cache
def _load_once(path: Path) -> Machine:
    return load(path)


def find(name: str) -> Machine:
    """A machine by its name, or by the path of its description. Raises RigtwinError with what there
    is."""
    if name in shipped():
        return _load_once(shipped()[name])
    path = Path(name)
    if path.suffix.lower() in (".xml", ".mjcf", ".urdf"):
        raise RigtwinError(
            f"{name}: it is a model without a description; rigtwin describe {name} --log LOG "
            "--out FOLDER writes one, and rigtwin diagnose LOG takes a model as it is"
        )
    if path.suffix == ".toml" or path.exists():
        return load(path)
    raise RigtwinError(
        f"unknown machine {name!r}; there are {', '.join(shipped())}, "
        "or give the path of a description, F.toml"
    )


def own_description(machine: Machine) -> Path | None:
    """Return the path of a machine's description, or None if it is a shipped one, which every
    installation has under its name."""
    return None if shipped().get(machine.name) == machine.path else machine.path
