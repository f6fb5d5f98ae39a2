"""One source, two ways to run: called from Python a function stays Python; called from a compiled
loop it is compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def compilable(function: Function) -> Function:
    """Marks a plain function of numbers and NamedTuples as usable inside compiled code; returns it
    unchanged.

    Compiled, a division by zero gives what it gives in numpy, not an exception: to check every
    division takes its time, and whatever is commanded is looked at anyway."""
    return register_jitable(error_model="numpy")(function)


def compiled(function: Function) -> Function:
    """Compiles a plain function of numbers and arrays wherever it is called from: a loop over an
    array, which Python is slow at. It must call nothing of ours in another file, or what is kept on
    disk would not be made anew when that changes."""
    try:
        made: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:
        # Nowhere to keep it.
        made = numba.njit(nogil=True, error_model="numpy")(function)
    return made
