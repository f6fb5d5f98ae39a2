"""Checks of an MJCF before and after it is compiled: excessive sizes, and values that are not
physical."""

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
"""Largest number of elements that `replicate`, `flexcomp` and `composite` may make."""
MOST_CELLS = 10_000_000
"""Largest number of cells of a height field, or of pixels of a generated texture."""
CELLS = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
"""Element → attributes whose product is the number of its cells."""
MOST_RESERVED = 10_000_000
"""Largest value of an attribute of `size`, except memory."""
MOST_MEMORY = 4 * 2**30
"""Largest value of `size memory`, bytes."""
MOST_DEGREES = 300
"""Largest number of degrees of freedom of a described machine."""
DEEPEST = 10
"""Largest depth of nested includes."""
UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}
"""Suffix of `size memory` → bytes."""
NOT_NEGATIVE = {
    "dof_damping": "damping",
    "dof_frictionloss": "frictionloss",
    "dof_armature": "armature",
    "tendon_damping": "damping",
    "tendon_frictionloss": "frictionloss",
    "tendon_armature": "armature",
}
"""Array of a model → its attribute in MJCF. MuJoCo accepts negative values, which would create
energy."""
RANGES = {"actuator_ctrlrange": "ctrlrange", "actuator_forcerange": "forcerange"}
"""Array of a model → its attribute in MJCF. MuJoCo ignores a range whose ends are exchanged."""
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
"""Prefix of the names of a model's arrays → type of the objects that the rows belong to."""


def list_files(path: Path, depth: int = DEEPEST) -> tuple[Path, ...]:
    """Return an MJCF and the files that it includes, as far as they exist.

    Parameters
    ----------
    path
        Path of the MJCF.
    depth
        Largest depth of nested includes, which ends a file that includes itself.
    """
    files, parser = [path], expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if tag == "include" and "file" in attributes and depth > 0:
            files.extend(list_files(path.parent / attributes["file"], depth - 1))

    parser.StartElementHandler = begin
    # Faults of the file are reported where it is compiled, with better messages.
    with suppress(OSError, expat.ExpatError):
        parser.Parse(path.read_bytes() if path.is_file() else b"<none/>", True)
    return tuple(file for file in files if file.is_file())


def check_text(path: Path) -> None:
    """Raise RigtwinError for an MJCF that asks for more elements or memory than any machine needs.

    Compiling such a file would take all memory or never end, so the check reads the text alone.
    """
    _check_file(path, path, 1, DEEPEST)


def _check_file(path: Path, root: Path, copies: int, depth: int) -> None:
    """Check one file and its includes.

    copies: how often its elements are replicated; root: model whose folder includes refer to.
    """
    if path.exists() and not path.is_file():
        raise RigtwinError(f"model {root}: it includes {path}; expected a file")
    try:
        text = path.read_bytes()
    except OSError:
        # MuJoCo also searches other folders for an included file, and names a missing one.
        return
    _check_encoding(path, text)
    nested, parser = [copies], expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        # Nested elements that replicate multiply.
        nested.append(nested[-1] * _copies(tag, attributes))
        if nested[-1] > MOST_COPIES:
            raise RigtwinError(
                f"model {path}: <{tag}> makes {nested[-1]:g} elements; "
                f"expected at most {MOST_COPIES}"
            )
        for name, value in attributes.items():
            # MuJoCo marks attributes that are not set by NaN, and would ignore one in the file.
            if "nan" in value.lower().split():
                raise RigtwinError(
                    f"model {path}, line {parser.CurrentLineNumber}: {name} of <{tag}> is "
                    f"{value[:40]!r}; expected finite numbers"
                )
        cells = math.prod(_number(attributes.get(side, "1")) for side in CELLS.get(tag, ()))
        if cells > MOST_CELLS:
            raise RigtwinError(
                f"model {path}: <{tag}> has {cells:g} cells; expected at most {MOST_CELLS}"
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
        # MuJoCo's own parser decides which XML it accepts, and its message names the line.
        return


def _check_encoding(path: Path, text: bytes) -> None:
    """Raise RigtwinError unless a file is UTF-8.

    MuJoCo ignores the encoding that the XML declares, and its Python names must be UTF-8.
    """
    try:
        text.decode()
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise RigtwinError(
            f"model {path}, line {line}: byte {text[error.start]:#04x} is not UTF-8 "
            "(Latin-1 or UTF-16?); expected a file saved as UTF-8"
        ) from None


def _copies(tag: str, attributes: dict[str, str]) -> int:
    """Return the number of elements that a tag makes of one: the product of its counts."""
    if tag not in ("replicate", "flexcomp", "composite"):
        return 1
    numbers = [_number(count) for count in attributes.get("count", "1").split()]
    # A count of 0 or less still makes one element; the bound keeps the product in an int.
    return int(min(math.prod(max(number, 1.0) for number in numbers), 1e18))


def _check_size(path: Path, attributes: dict[str, str]) -> None:
    """Raise RigtwinError for a tag `size` that reserves too much."""
    for name, text in attributes.items():
        unit = text[-1:].upper() if name == "memory" else ""
        number = _number(text[:-1] if unit in UNITS and unit else text) * UNITS.get(unit, 1)
        most = MOST_MEMORY if name == "memory" else MOST_RESERVED
        if number > most:
            raise RigtwinError(
                f"model {path}: <size {name}={text[:40]!r}>: expected at most {most}"
            )


def _number(text: str) -> float:
    """Return a number of the MJCF; 0 for a text that is none, which MuJoCo reports."""
    try:
        number = float(text)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(number) else min(number, 1e18)


def check_values(path: Path, model: mujoco.MjModel) -> None:
    """Raise RigtwinError for the first value of a compiled model that no machine can have.

    Parameters
    ----------
    path
        Path of the MJCF, for the message.
    model
        Compiled MJCF.
    """
    # Inertia matrices are dense here: n² numbers, and n³ operations a step.
    if model.nv > MOST_DEGREES:
        raise RigtwinError(
            f"model {path}: it has {model.nv} degrees of freedom; expected at most {MOST_DEGREES}"
        )
    arrays = dict(_arrays(model))
    for name, values in arrays.items():
        # An infinite end of a range means that there is no limit.
        wrong = np.isnan(values) if name.endswith("range") else ~np.isfinite(values)
        if wrong.any():
            place = tuple(int(at) for at in np.argwhere(wrong)[0])
            raise RigtwinError(
                f"model {path}: {_owner(model, name, place)} is {values[place]}; "
                "expected a finite number"
            )
    for limits, attribute in RANGES.items():
        pairs = arrays[limits]
        # A range of 0 0 is MuJoCo's default, which stands for no range.
        wrong = np.flatnonzero(pairs.any(axis=1) & ~(pairs[:, 0] < pairs[:, 1]))
        if len(wrong):
            low, high = pairs[wrong[0]]
            raise RigtwinError(
                f"model {path}: {attribute} of {_element(model, limits, int(wrong[0]))} is "
                f"{low:g} {high:g}; expected the lower end first"
            )
    for name, attribute in NOT_NEGATIVE.items():
        values = arrays[name]
        if (values < 0.0).any():
            place = tuple(int(at) for at in np.argwhere(values < 0.0)[0])
            raise RigtwinError(
                f"model {path}: {attribute} of {_element(model, name, place[0])} is "
                f"{values[place]:g}; expected a number from 0"
            )


def _arrays(model: mujoco.MjModel) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of every floating-point option and array of a model."""
    # The bindings list their arrays as attributes only; a list of names would miss those of new
    # versions.
    for holder, prefix in ((model.opt, "option "), (model, "")):
        for name in dir(holder):
            value = None if name.startswith("_") else getattr(holder, name, None)
            if isinstance(value, float):
                value = np.array([value])
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                yield prefix + name, value


def _owner(model: mujoco.MjModel, name: str, place: tuple[int, ...]) -> str:
    """Return the attribute and the element that a value of an array belongs to, as a text."""
    if name.startswith("option "):
        return name
    prefix, _, attribute = name.partition("_")
    if prefix in OWNERS or prefix == "dof":
        return f"{attribute} of {_element(model, name, place[0])}"
    return name


def _element(model: mujoco.MjModel, name: str, number: int) -> str:
    """Return kind and name of the element that a row of an array belongs to, as a text."""
    prefix = name.partition("_")[0]
    # A joint has one to six degrees of freedom; messages name the joint.
    if prefix == "dof":
        prefix, number = "jnt", int(model.dof_jntid[number])
    kind = {"jnt": "joint"}.get(prefix, prefix)
    label = mujoco.mj_id2name(model, OWNERS[prefix], number)
    return f"{kind} {label!r}" if label else f"{kind} {number}, which has no name,"
