"""Compiled loops that call MuJoCo, cached on disk so that only changed sources are compiled.

numba's own cache checks only the date of one file. A loop here also depends on the controllers and
on MuJoCo's version. The cache folder is therefore named by a digest of all of them.
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
from rigtwin.numerics.verified_cache import VerifiedCache
from rigtwin.system import cache_folder

COMPILED = ("numerics", "components", "simulation", "models")
"""Packages whose compiled functions call each other."""
Function = TypeVar("Function", bound=Callable[..., Any])


def _mujoco_library() -> Path:
    """Return the path of MuJoCo's shared library."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return path
    raise ImportError(f"no MuJoCo library in {folder}")


def _digest() -> str:
    """Return a digest of everything that compiled code depends on."""
    digest = hashlib.sha256(f"{version('mujoco')} {version('numba')}".encode())
    root = Path(__file__).parents[1]
    for package in (*(root / name for name in COMPILED), Path(controllers.__file__).parent):
        for source in sorted(package.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """Return the cache folder, or None if it cannot be written."""
    folder = cache_folder() / "rigtwin" / _digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


# Loaded before any kernel is compiled: the linker resolves mj_step and others by name.
llvmlite.binding.load_library_permanently(str(_mujoco_library()))
_CACHE = _cache_folder()

_STRUCTURES = (types.intp, types.intp)
forward = types.ExternalFunction(
    "mj_forwardSkip", types.void(*_STRUCTURES, types.int32, types.int32)
)
"""mj_forwardSkip(model, data, last stage to skip, whether to skip sensors)."""
inverse = types.ExternalFunction("mj_inverse", types.void(*_STRUCTURES))
"""mj_inverse(model, data): forces that a motion requires."""
fwd_position = types.ExternalFunction("mj_fwdPosition", types.void(*_STRUCTURES))
"""mj_fwdPosition(model, data): everything that depends on positions."""
fwd_velocity = types.ExternalFunction("mj_fwdVelocity", types.void(*_STRUCTURES))
"""mj_fwdVelocity(model, data): everything that depends on velocities, after mj_fwdPosition."""
kinematics = types.ExternalFunction("mj_kinematics", types.void(*_STRUCTURES))
"""mj_kinematics(model, data): poses of the bodies."""
com_position = types.ExternalFunction("mj_comPos", types.void(*_STRUCTURES))
"""mj_comPos(model, data): inertias and joint axes about the centres of mass."""
make_inertia = types.ExternalFunction("mj_makeM", types.void(*_STRUCTURES))
"""mj_makeM(model, data): inertia matrix."""
com_velocity = types.ExternalFunction("mj_comVel", types.void(*_STRUCTURES))
"""mj_comVel(model, data): velocities of the bodies."""
passive = types.ExternalFunction("mj_passive", types.void(*_STRUCTURES))
"""mj_passive(model, data): forces of springs, dampers, gravity compensation and fluid."""
newton_euler = types.ExternalFunction("mj_rne", types.void(*_STRUCTURES, types.int32, types.intp))
"""mj_rne(model, data, whether accelerations count, address of the forces): bias forces."""
step = types.ExternalFunction("mj_step", types.void(*_STRUCTURES))
"""mj_step(model, data): a complete step."""
integrate = types.ExternalFunction("mj_implicit", types.void(*_STRUCTURES))
"""mj_implicit(model, data): second half of a step with the implicit integrators."""


def kernel(function: Function) -> Function:
    """Compile a function.

    Compiled code uses no Python objects, releases the interpreter lock, and is cached on disk. A
    division by zero gives numpy's result instead of an exception.
    """
    return _compile(function, counted=True)


def loop_kernel(function: Function) -> Function:
    """Compile a function as `kernel` does, for a loop that allocates nothing.

    Its arrays belong to its caller, so their references need no counting. Counting them takes
    longer than the arithmetic of a step wherever a tuple of arrays is passed on.
    """
    return _compile(function, counted=False)


def part_kernel(function: Function) -> Function:
    """Compile a part of a `loop_kernel`, and copy its machine code into each caller.

    A call in every step would pass all of its arguments in memory. Copied, the part costs as much
    as if it were written in its caller, and its types are inferred once.
    """
    return _compile(function, counted=False, copied=True)


def _compile(function: Function, counted: bool, copied: bool = False) -> Function:
    """Compile a function, with or without counting the references of arrays."""
    # Nothing calls a kernel through a C function pointer, and Python calls no part of a loop. Such
    # wrappers take as long to compile as the function.
    options = {"nogil": True, "error_model": "numpy", "_nrt": counted, "no_cfunc_wrapper": True}
    if copied:
        options |= {"forceinline": True, "no_cpython_wrapper": True}
    compiled: Any = numba.njit(**options)(function)
    if _CACHE is None:
        return cast(Function, compiled)
    # numba reads the folder when the cache object is made, so it is set only for that moment.
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(_CACHE)  # type: ignore[attr-defined]
    try:
        # As njit(cache=True) does, but with files that carry a checksum.
        compiled._cache = VerifiedCache(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
    return cast(Function, compiled)
