"""What is wrong with the arguments of a call, said in one line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from rigtwin.errors import RigtwinError

Function = TypeVar("Function", bound=Callable[..., Any])
NAMES = {
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    NoneType: "None",
}


def explained(function: Function) -> Function:
    """A function whose failure is laid to its arguments where they are of other types than it says.

    While it does not fail, only truth values are looked at: Python takes them for numbers.

    Parameters
    ----------
    function
        With annotations.

    Returns
    -------
    function
        Raises RigtwinError, with the argument and what was expected, where it would have raised
        TypeError, AttributeError or ValueError.
    """

    @wraps(function)
    def called(*values: Any, **named: Any) -> Any:
        truths = any(isinstance(value, bool) for value in (*values, *named.values()))
        if truths and (said := _mistake(function, values, named)) is not None:
            raise RigtwinError(said)
        try:
            return function(*values, **named)
        except (TypeError, AttributeError, ValueError):
            said = _mistake(function, values, named)
            if said is None:
                raise
        raise RigtwinError(said)

    # It is found there, by those too who send it to another process.
    called.__module__ = "rigtwin"
    return called  # type: ignore[return-value]


def _mistake(
    function: Callable[..., Any], values: Sequence[Any], named: Mapping[str, Any]
) -> str | None:
    signature = inspect.signature(function)
    try:
        given = signature.bind(*values, **named).arguments
    except TypeError:
        return None
    known = function.__globals__ if inspect.isfunction(function) else {}
    for name, value in given.items():
        parameter = signature.parameters[name]
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        expected = _meaning(parameter.annotation, known)
        if not fits(value, expected):
            return f"{name} {value!r:.60}: expected {describe(expected)}"
        if isinstance(value, str | Path) and "\0" in str(value):
            return f"{name} {value!r:.60}: expected text without a null character"
    return None


def _meaning(annotation: Any, known: Mapping[str, Any]) -> Any:
    """What an annotation stands for; anything where that is not known while the program runs."""
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, dict(known))
    except NameError:
        return Any


def fits(value: Any, expected: Any) -> bool:
    """Whether a value is of a type, and what it holds of that type's.

    Parameters
    ----------
    value
        Anything.
    expected
        As an annotation has it; what cannot be looked at fits.

    Returns
    -------
    bool
        No truth value is a number.
    """
    kind, inner = get_origin(expected), get_args(expected)
    if kind in (Union, UnionType):
        return any(fits(value, each) for each in inner)
    if kind is Literal:
        return value in inner
    if kind is not None and isinstance(kind, type):
        if issubclass(kind, Callable):  # type: ignore[arg-type]
            return callable(value)
        if not isinstance(value, kind) or (isinstance(value, str | bytes) and kind is not str):
            return False
        if issubclass(kind, Mapping) and len(inner) == 2:
            return all(fits(key, inner[0]) and fits(each, inner[1]) for key, each in value.items())
        if issubclass(kind, Sequence) and not issubclass(kind, tuple) and inner:
            return all(fits(each, inner[0]) for each in value)
        return True
    if expected in (int, float):
        numbers = int if expected is int else int | float
        whole = getattr(value, "item", None)
        own = whole() if callable(whole) and getattr(value, "ndim", 1) == 0 else value
        return isinstance(own, numbers) and not isinstance(own, bool)
    if expected is None:
        return value is None
    try:
        return isinstance(value, expected)
    except TypeError:
        return True


def describe(expected: Any) -> str:
    """What a type is called.

    Parameters
    ----------
    expected
        As an annotation has it.

    Returns
    -------
    str
        In words where there are any.
    """
    kind, inner = get_origin(expected), get_args(expected)
    if kind in (Union, UnionType):
        *most, last = dict.fromkeys(describe(each) for each in inner)
        return f"{', '.join(most)} or {last}" if most else last
    if kind is Literal:
        return " or ".join(map(repr, inner))
    if isinstance(kind, type):
        if issubclass(kind, Callable):  # type: ignore[arg-type]
            return "a function"
        if issubclass(kind, Mapping):
            return "a table"
        if issubclass(kind, Sequence) and inner:
            return f"a list, each {describe(inner[0])}"
    if expected is None:
        return "None"
    return NAMES.get(expected, getattr(expected, "__name__", str(expected)))
