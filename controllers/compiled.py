"""One source, two ways to run: called from Python a function stays Python; called from a compiled
loop it is compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def compilable(function: Function) -> Function:
    """Marks a plain function of numbers and NamedTuples as usable inside compiled code; returns it
    unchanged."""
    return register_jitable(function)
