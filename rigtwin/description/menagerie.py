"""Models of MuJoCo Menagerie by name: `menagerie:universal_robots_ur5e`.

The package `mujoco-menagerie` (extra `menagerie`) downloads a robot when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from rigtwin.errors import RigtwinError

PREFIX = "menagerie:"
"""Start of a name that stands for a robot of the Menagerie."""


def is_robot(name: object) -> bool:
    """Return whether a name stands for a robot of the Menagerie."""
    return isinstance(name, str) and name.startswith(PREFIX)


def find_robot(name: str) -> Path:
    """Return the path of a robot's model, downloaded when it is first used.

    Parameters
    ----------
    name
        Name such as `menagerie:universal_robots_ur5e`.

    Raises
    ------
    RigtwinError
        If the package is not installed, no robot has the name, or it cannot be downloaded.
    """
    try:
        menagerie = import_module("mujoco_menagerie")
    except ImportError:
        raise RigtwinError(
            f"{name}: robots of the Menagerie need the package mujoco-menagerie; "
            "pip install 'rigtwin[menagerie]'"
        ) from None
    try:
        robot = menagerie.get(name.removeprefix(PREFIX))
        return Path(robot.xml(robot.default_model))
    except menagerie.MenagerieError as error:
        raise RigtwinError(f"{name}: {error}") from None
