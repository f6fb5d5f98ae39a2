"""Values of an MJCF that no machine has: too much for MuJoCo to be asked for, or no numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

import mujoco
import numpy as np

from rigtwin.errors import RigtwinError

MOST_COPIES = 10_000
"""Elements that `replicate`, `flexcomp` and `composite` may make."""
MOST_RESERVED = 10_000_000
"""What an attribute of `size` may ask for, in its own unit."""
MOST_MEMORY = 4 * 2**30
"""Bytes of `size memory`."""
MOST_DEGREES = 300
"""Degrees of freedom that a described machine may have."""
DEEPEST = 10
"""Files that include each other."""
UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}
NOT_NEGATIVE = {
    "dof_damping": "damping",
    "dof_frictionloss": "frictionloss",
    "dof_armature": "armature",
    "tendon_damping": "damping",
    "tendon_frictionloss": "frictionloss",
    "tendon_armature": "armature",
}
"""Array of a model → its attribute in MJCF; MuJoCo takes them negative, and then energy comes from
nowhere."""
RANGES = {"actuator_ctrlrange": "ctrlrange", "actuator_forcerange": "forcerange"}
"""Array of a model → its attribute in MJCF; MuJoCo takes one the wrong way round for none."""
OWNERS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "jnt": mujoco.mjtObj.mjOBJ_JOINT,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "pair": mujoco.mjtObj.mjOBJ_PAIR,
}
"""How the names of a model's arrays begin → what they are of."""


def list_files(path: Path, depth: int = DEEPEST) -> tuple[Path, ...]:
    """An MJCF and the files that it includes, those that are there."""
    found, parser = [path], expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if tag == "include" and "file" in attributes and depth > 0:
            found.extend(list_files(path.parent / attributes["file"], depth - 1))

    parser.StartElementHandler = begin
    # Who reads it for what is in it says what is wrong.
    with suppress(OSError, expat.ExpatError):
        parser.Parse(path.read_bytes() if path.is_file() else b"<none/>", True)
    return tuple(each for each in found if each.is_file())


def check_text(path: Path) -> None:
    """Raises RigtwinError for an MJCF that asks for more than any machine needs: compiling it would
    take for ever or all memory."""
    _check_file(path, path, 1, DEEPEST)


def _check_file(path: Path, root: Path, copies: int, depth: int) -> None:
    if path.exists() and not path.is_file():
        raise RigtwinError(f"model {root}: it includes {path}; expected a file")
    try:
        text = path.read_bytes()
    except OSError:
        return  # MuJoCo says what it misses, and finds files elsewhere too.
    _check_encoding(path, text)
    nested, parser = [copies], expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nested.append(nested[-1] * _copies(tag, attributes))
        if nested[-1] > MOST_COPIES:
            raise RigtwinError(
                f"model {path}: <{tag}> makes {nested[-1]:g} elements; "
                f"expected at most {MOST_COPIES}"
            )
        for name, value in attributes.items():
            # MuJoCo takes it for a value that is not given.
            if "nan" in value.lower().split():
                raise RigtwinError(
                    f"model {path}, line {parser.CurrentLineNumber}: {name} of <{tag}> is "
                    f"{value[:40]!r}; expected finite numbers"
                )
        if tag == "size":
            _check_size(path, attributes)
        if tag == "include" and "file" in attributes and depth > 0:
            _check_file(root.parent / attributes["file"], root, nested[-1], depth - 1)

    def end(_: str) -> None:
        nested.pop()

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return  # MuJoCo has a reader of its own, and says what it minds.


def _check_encoding(path: Path, text: bytes) -> None:
    """MuJoCo takes a file's bytes as they are, whatever encoding its first line declares, and its
    names have to be UTF-8."""
    try:
        text.decode()
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise RigtwinError(
            f"model {path}, line {line}: byte {text[error.start]:#04x} is not UTF-8 "
            "(Latin-1 or UTF-16?); expected a file saved as UTF-8"
        ) from None


def _copies(tag: str, attributes: dict[str, str]) -> int:
    if tag not in ("replicate", "flexcomp", "composite"):
        return 1
    numbers = [_number(each) for each in attributes.get("count", "1").split()]
    # The least of each is a point in a line.
    return int(min(math.prod(max(number, 1.0) for number in numbers), 1e18))


def _check_size(path: Path, attributes: dict[str, str]) -> None:
    for name, text in attributes.items():
        unit = text[-1:].upper() if name == "memory" else ""
        number = _number(text[:-1] if unit in UNITS and unit else text) * UNITS.get(unit, 1)
        most = MOST_MEMORY if name == "memory" else MOST_RESERVED
        if number > most:
            raise RigtwinError(
                f"model {path}: <size {name}={text[:40]!r}>: expected at most {most}"
            )


def _number(text: str) -> float:
    """0 for what is none, which MuJoCo names."""
    try:
        number = float(text)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(number) else min(number, 1e18)


def check_values(path: Path, model: mujoco.MjModel) -> None:
    """Raises RigtwinError for a compiled model with values that no machine has, naming the first of
    them."""
    if model.nv > MOST_DEGREES:
        raise RigtwinError(
            f"model {path}: it has {model.nv} degrees of freedom; expected at most {MOST_DEGREES}"
        )
    for name, values in _arrays(model):
        # A range may have no end.
        wrong = np.isnan(values) if name.endswith("range") else ~np.isfinite(values)
        if wrong.any():
            place = tuple(int(at) for at in np.argwhere(wrong)[0])
            raise RigtwinError(
                f"model {path}: {_owner(model, name, place)} is {values[place]}; "
                "expected a finite number"
            )
    for limits, attribute in RANGES.items():
        pairs = getattr(model, limits)
        wrong = np.flatnonzero(pairs.any(axis=1) & ~(pairs[:, 0] < pairs[:, 1]))
        if len(wrong):
            low, high = pairs[wrong[0]]
            raise RigtwinError(
                f"model {path}: {attribute} of {_element(model, limits, int(wrong[0]))} is "
                f"{low:g} {high:g}; expected the lower end first"
            )
    for name, attribute in NOT_NEGATIVE.items():
        values = np.atleast_1d(getattr(model, name))
        if (values < 0.0).any():
            place = tuple(int(at) for at in np.argwhere(values < 0.0)[0])
            raise RigtwinError(
                f"model {path}: {attribute} of {_element(model, name, place[0])} is "
                f"{values[place]:g}; expected a number from 0"
            )


def _arrays(model: mujoco.MjModel) -> Iterator[tuple[str, np.ndarray]]:
    for holder, prefix in ((model.opt, "option "), (model, "")):
        for name in dir(holder):
            value = None if name.startswith("_") else getattr(holder, name, None)
            if isinstance(value, float):
                value = np.array([value])
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                yield prefix + name, value


def _owner(model: mujoco.MjModel, name: str, place: tuple[int, ...]) -> str:
    """What a value of an array is, in words."""
    if name.startswith("option "):
        return name
    prefix, _, attribute = name.partition("_")
    if prefix in OWNERS or prefix == "dof":
        return f"{attribute} of {_element(model, name, place[0])}"
    return name


def _element(model: mujoco.MjModel, name: str, number: int) -> str:
    prefix = name.partition("_")[0]
    if prefix == "dof":
        prefix, number = "jnt", int(model.dof_jntid[number])
    kind = {"jnt": "joint"}.get(prefix, prefix)
    called = mujoco.mj_id2name(model, OWNERS[prefix], number)
    return f"{kind} {called!r}" if called else f"{kind} {number}, which has no name,"
