"""Compiled loops that call MuJoCo, kept on disk so that only the first run after a change compiles.

numba's own cache looks at one file's date only; a loop here also depends on the controllers and on
MuJoCo's version, so the folder is named by a digest of them all.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding
import mujoco
import numba
from numba import types

import controllers
from rigtwin.numerics.kept_code import KeptCode
from rigtwin.system import cache_folder

COMPILED = ("numerics", "components", "simulation", "models")
"""Folders whose compiled code calls each other's."""
Function = TypeVar("Function", bound=Callable[..., Any])


def _mujoco_library() -> Path:
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return path
    raise ImportError(f"no MuJoCo library in {folder}")


def _digest() -> str:
    digest = hashlib.sha256(f"{version('mujoco')} {version('numba')}".encode())
    here = Path(__file__).parents[1]
    for package in (*(here / name for name in COMPILED), Path(controllers.__file__).parent):
        for source in sorted(package.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    folder = cache_folder() / "rigtwin" / _digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


llvmlite.binding.load_library_permanently(str(_mujoco_library()))
_CACHE = _cache_folder()

_STRUCTURES = (types.intp, types.intp)
forward = types.ExternalFunction(
    "mj_forwardSkip", types.void(*_STRUCTURES, types.int32, types.int32)
)
"""mj_forwardSkip(model, data, stage to skip up to, whether to skip sensors)."""
inverse = types.ExternalFunction("mj_inverse", types.void(*_STRUCTURES))
"""mj_inverse(model, data): the forces that a motion takes."""
fwd_position = types.ExternalFunction("mj_fwdPosition", types.void(*_STRUCTURES))
"""mj_fwdPosition(model, data): all that depends on positions."""
fwd_velocity = types.ExternalFunction("mj_fwdVelocity", types.void(*_STRUCTURES))
"""mj_fwdVelocity(model, data): all that depends on velocities, after the former."""
step = types.ExternalFunction("mj_step", types.void(*_STRUCTURES))
"""mj_step(model, data): a whole step."""
integrate = types.ExternalFunction("mj_implicit", types.void(*_STRUCTURES))
"""mj_implicit(model, data): the second half of a step with the implicit integrators."""


def kernel(function: Function) -> Function:
    """Compiles a function for speed.

    No Python objects inside, the interpreter lock released, cached on disk. A division by zero
    gives what it gives in numpy, not an exception.
    """
    compiled: Any = numba.njit(nogil=True, error_model="numpy")(function)
    if _CACHE is None:
        return cast(Function, compiled)
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(_CACHE)  # type: ignore[attr-defined]
    try:
        # As njit(cache=True) does, but with files that are checked.
        compiled._cache = KeptCode(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
    return cast(Function, compiled)
