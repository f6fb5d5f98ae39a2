"""Checks of a call's arguments against the function's annotations, each failure in one line."""

from __future__ import annotations

import errno
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
"""Names of types in messages."""


def check_arguments(function: Function) -> Function:
    """Decorate a function so that arguments of a wrong type raise one clear line.

    Numbers, texts, paths and functions are compared with the annotations before the call: a wrong
    one might be used only after minutes of work, and Python accepts truth values as numbers. Other
    types accept whatever behaves alike, so they are compared only after the function has failed.

    Parameters
    ----------
    function
        Function with annotations.

    Returns
    -------
    function
        The same function. Where it would raise TypeError, AttributeError or ValueError because of
        an argument, it raises RigtwinError with the argument's name and the expected type.
    """

    @wraps(function)
    def checked(*values: Any, **keywords: Any) -> Any:
        if (mistake := _mistake(function, values, keywords, _is_plain)) is not None:
            raise RigtwinError(mistake)
        try:
            return function(*values, **keywords)
        except (TypeError, AttributeError, ValueError):
            mistake = _mistake(function, values, keywords)
            if mistake is None:
                raise
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
            mistake = f"{str(error.filename)[:60]}…: {error.strerror}"
        raise RigtwinError(mistake)

    # Pickle looks a function up by module and name, and the decorated one is an attribute of the
    # package, not of the module that defines the plain one.
    checked.__module__ = "rigtwin"
    return checked  # type: ignore[return-value]


def _is_plain(value: Any, expected: Any) -> bool:
    """Return whether an argument is checked before the call: a truth value, or an argument that
    must be a number, a text, a path or a function."""
    options = get_args(expected) if get_origin(expected) in (Union, UnionType) else (expected,)
    return isinstance(value, bool) or all(
        option in NAMES or option is None or get_origin(option) is Callable for option in options
    )


def _mistake(
    function: Callable[..., Any],
    values: Sequence[Any],
    keywords: Mapping[str, Any],
    is_checked: Callable[[Any, Any], bool] = lambda *_: True,
) -> str | None:
    """Return a line about the first argument of a wrong type, or None.

    `is_checked` says of a value and its expected type whether they are compared.
    """
    signature = inspect.signature(function)
    try:
        arguments = signature.bind(*values, **keywords).arguments
    except TypeError:
        # An unknown or missing parameter: Python's own message names it.
        return None
    namespace = function.__globals__ if inspect.isfunction(function) else {}
    for name, value in arguments.items():
        parameter = signature.parameters[name]
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        expected = _evaluate(parameter.annotation, namespace)
        if is_checked(value, expected) and not fits(value, expected):
            return f"{name} {value!r:.60}: expected {describe(expected)}"
        # A null character would end the path in the system's calls, and names another file.
        if isinstance(value, str | Path) and "\0" in str(value):
            return f"{name} {value!r:.60}: expected text without a null character"
    return None


def _evaluate(annotation: Any, namespace: Mapping[str, Any]) -> Any:
    """Return the type of an annotation; Any if it is imported for type checkers only."""
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, dict(namespace))
    except NameError:
        return Any


def fits(value: Any, expected: Any) -> bool:
    """Return whether a value and its items are of a type.

    Parameters
    ----------
    value
        Value to check.
    expected
        Type, as an annotation states it. Types that cannot be checked at run time accept any value.

    Returns
    -------
    bool
        Whether the value fits. Truth values do not count as numbers.
    """
    kind, inner = get_origin(expected), get_args(expected)
    if kind in (Union, UnionType):
        return any(fits(value, option) for option in inner)
    if kind is Literal:
        return value in inner
    if kind is not None and isinstance(kind, type):
        return _fits_generic(value, kind, inner)
    if expected in (int, float):
        numbers = int if expected is int else int | float
        # NumPy's scalars are not Python numbers; `item` converts them, but also takes the only
        # element of an array, which is no number here.
        convert = getattr(value, "item", None)
        number = convert() if callable(convert) and getattr(value, "ndim", 1) == 0 else value
        return isinstance(number, numbers) and not isinstance(number, bool)
    if expected is None:
        return value is None
    try:
        return isinstance(value, expected)
    # Some annotations, such as protocols, cannot be tested by isinstance; they let everything
    # pass.
    except TypeError:
        return True


def _fits_generic(value: Any, kind: type, inner: tuple[Any, ...]) -> bool:
    """Return whether a value is of a generic type such as `Sequence[str]`."""
    if issubclass(kind, Callable):  # type: ignore[arg-type]
        return callable(value)
    # A text is a sequence of texts to Python, and never meant as one here.
    if not isinstance(value, kind) or (isinstance(value, str | bytes) and kind is not str):
        return False
    if issubclass(kind, Mapping) and len(inner) == 2:
        return all(fits(key, inner[0]) and fits(item, inner[1]) for key, item in value.items())
    if issubclass(kind, Sequence) and not issubclass(kind, tuple) and inner:
        return all(fits(item, inner[0]) for item in value)
    return True


def describe(expected: Any) -> str:
    """Return the name of a type as messages state it.

    Parameters
    ----------
    expected
        Type, as an annotation states it.

    Returns
    -------
    str
        Plain words where `NAMES` has them, else the type's own name.
    """
    kind, inner = get_origin(expected), get_args(expected)
    if kind in (Union, UnionType):
        # A dictionary drops repeated names, such as those of two kinds of function.
        *options, last = dict.fromkeys(describe(option) for option in inner)
        return f"{', '.join(options)} or {last}" if options else last
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
