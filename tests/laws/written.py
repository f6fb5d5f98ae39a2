"""A mark for the tests that write out a law, and the list of the laws that are marked."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

Test = TypeVar("Test", bound=Callable[..., Any])
Law = tuple[str, str]
"""Name of a kind of effect, and name of the component type that can have it."""
MARK = "written_laws"


def law_of(kind: str, *components: type) -> Callable[[Test], Test]:
    """Mark a test that writes out the law of a kind of effect.

    Parameters
    ----------
    kind
        Name of the kind of effect.
    components
        Component types whose law the test writes out.

    Returns
    -------
    callable
        Decorator that returns the test unchanged but for its mark.
    """

    def mark(test: Test) -> Test:
        laws = {(kind, component.__name__) for component in components}
        setattr(test, MARK, laws | getattr(test, MARK, set()))
        return test

    return mark


def collect_laws() -> set[Law]:
    """Collect the laws that the tests of this folder write out."""
    laws: set[Law] = set()
    for path in sorted(Path(__file__).parent.glob("test_*.py")):
        module = import_module(f"{__package__}.{path.stem}")
        for name, test in vars(module).items():
            if name.startswith("test_"):
                laws |= getattr(test, MARK, set())
    return laws
