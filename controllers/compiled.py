"""One source that runs as Python or compiled, depending on its caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def compilable(function: Function) -> Function:
    """Mark a function of numbers and NamedTuples as usable in compiled code; return it unchanged.

    A compiled division by zero gives infinity or NaN, as in NumPy, instead of an exception.
    Checking every division would take time, and the limits judge every command anyway.
    """
    return register_jitable(error_model="numpy")(function)


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays for all callers: a loop that Python is slow at.

    The function must call no function of another file of this project. Numba checks only the date
    of this file before it reuses code from the disk, so a change elsewhere would go unnoticed.
    """
    try:
        dispatcher: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:
        # No folder is writable: compile without the cache.
        dispatcher = numba.njit(nogil=True, error_model="numpy")(function)
    return dispatcher
