"""How many changed constants and operators the tests notice:
`python -m benchmarks.mutation components`, or `... diagnosis`, or with names of modules after it.

Every mutant (`benchmarks.mutants`) is put into the imported module in a forked process of its own,
which runs the tests until the first one fails. The components run as Python, not compiled, so that
a changed function is the one that the models call. CONTRIBUTING.md has the figures.
"""

from __future__ import annotations

import argparse
import ast
import functools
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

ROOT = Path(__file__).parents[1]
LONGEST = 10.0
"""Times the tests' usual duration that a mutant may take; one that takes longer is noticed."""
NOMINAL = "test_nominal_values.py"
"""Tests of all components' nominal values."""
SHORTEST = 60.0
"""Seconds that a mutant may take at least."""
TARGETS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "components": (
        "rigtwin.components",
        (),
        ("tests/laws", "tests/test_yielding.py", "tests/test_gas_spring.py"),
    ),
    "diagnosis": (
        "rigtwin.diagnosis",
        (
            "scoring",
            "support",
            "blocks",
            "confidence",
            "thresholds",
            "calibrated",
            "sampling",
            "gauss_newton",
            "space",
        ),
        ("tests/engine",),
    ),
}
"""Target → package, its modules (all if none are named), tests."""


@dataclass(frozen=True)
class Outcome:
    """What became of one mutant: `noticed` by a failing test, an error or a time limit."""

    place: str
    sort: str
    text: str
    noticed: bool


def transplant(old: ModuleType, source: ast.Module) -> None:
    """Put the code, defaults and constants of a changed source into an imported module.

    Parameters
    ----------
    old
        Imported module; functions and classes stay the objects that other modules hold.
    source
        Syntax tree of the changed module.
    """
    new: dict[str, Any] = {**vars(old)}
    exec(compile(source, str(old.__file__), "exec"), new)  # the project's own source
    classes = {
        id(value): vars(old)[name]
        for name, value in new.items()
        if isinstance(value, type) and isinstance(vars(old).get(name), type)
    }
    for name, changed in new.items():
        before = vars(old).get(name)
        value = changed if isinstance(changed, type) else _with_classes(changed, classes)
        if name.startswith("__") or value is before:
            continue
        if _is_own(before, old):
            _graft(before, value)
        elif _is_value(before) and value != before:
            for module in list(sys.modules.values()):
                if getattr(module, "__dict__", {}).get(name) is before:
                    setattr(module, name, value)


def _with_classes(value: Any, classes: dict[int, Any]) -> Any:
    """Return a table or tuple with a module's original classes in place of their copies."""
    if type(value) is tuple:
        return tuple(_with_classes(part, classes) for part in value)
    if type(value) is dict:
        return {
            _with_classes(key, classes): _with_classes(part, classes) for key, part in value.items()
        }
    return classes.get(id(value), value)


def _is_own(thing: object, module: ModuleType) -> bool:
    """Return whether a function, a class or an instance of a class was defined in a module."""
    kind = thing if hasattr(thing, "__module__") else type(thing)
    return getattr(kind, "__module__", "") == module.__name__ and not _is_value(thing)


def _is_value(thing: object) -> bool:
    return isinstance(thing, (bool, int, float, str, tuple, dict, frozenset))


def _is_code(thing: object) -> bool:
    """Return whether a class's attribute has code that can be exchanged."""
    kinds = (FunctionType, property, classmethod, staticmethod, functools.cached_property)
    return isinstance(thing, kinds)


def _graft(old: Any, new: Any) -> None:
    """Give a function, a class or an instance the code and the values of another."""
    if isinstance(old, functools.cached_property):
        _graft(old.func, new.func)
    elif isinstance(old, property):
        _graft(old.fget, new.fget)
    elif isinstance(old, (classmethod, staticmethod)):
        _graft(old.__func__, new.__func__)
    elif hasattr(old, "cache_clear"):
        _graft(old.__wrapped__, new.__wrapped__)
        old.cache_clear()
    elif isinstance(old, FunctionType):
        if len(old.__code__.co_freevars) == len(new.__code__.co_freevars):
            old.__code__ = new.__code__
            for cell, other in zip(old.__closure__ or (), new.__closure__ or (), strict=True):
                # Defaults of a dataclass stand in cells; a cell with a class is that of `super()`.
                if not isinstance(other.cell_contents, type):
                    cell.cell_contents = other.cell_contents
        old.__defaults__, old.__kwdefaults__ = new.__defaults__, new.__kwdefaults__
    elif isinstance(old, type):
        if hasattr(old, "_field_defaults"):
            old._field_defaults.update(new._field_defaults)  # type: ignore[attr-defined]
            old.__new__.__defaults__ = new.__new__.__defaults__  # type: ignore[attr-defined]
        for name, value in list(vars(new).items()):
            before = vars(old).get(name)
            if _is_value(value) and not name.startswith("__"):
                setattr(old, name, value)
            elif _is_code(before) and name not in ("__new__", "__class_getitem__"):
                _graft(before, value)
    elif hasattr(old, "__dict__"):
        vars(old).update(vars(new))


class Session:
    """A pytest plugin that runs the collected tests once for every mutant."""

    def __init__(self, modules: Sequence[str], quiet: bool, own: bool) -> None:
        self.modules, self._quiet, self._own = modules, quiet, own
        self._limit = SHORTEST
        self.outcomes: list[Outcome] = []

    def pytest_runtestloop(self, session: Any) -> bool:
        if session.testsfailed or not session.items:
            print("the tests could not be collected", file=sys.stderr)
            raise session.Interrupted("the tests could not be collected")
        started = time.perf_counter()
        failing = _run(session.items)
        if failing:
            print(f"a test fails without any change: {failing}", file=sys.stderr)
            raise session.Interrupted("a test fails without any change")
        seconds = time.perf_counter() - started
        self._limit = max(LONGEST * seconds, SHORTEST)
        print(f"{len(session.items)} tests, {seconds:.1f} s", flush=True)
        for name in self.modules:
            self._try_module(import_module(name), session.items)
        return True

    def _try_module(self, module: ModuleType, items: list[Any]) -> None:
        from benchmarks.mutants import list_mutants

        short = module.__name__.rpartition(".")[2]
        # The tests of the same name first: they notice most.
        items = sorted(items, key=lambda item: f"test_{short}." not in item.nodeid)
        if self._own:
            own = (f"test_{short}.", NOMINAL)
            items = [item for item in items if any(name in item.nodeid for name in own)]
        tree = ast.parse(Path(str(module.__file__)).read_text())
        if not items or _is_noticed(module, tree, items, self._limit):
            raise RuntimeError(
                f"{short}: the tests fail with the unchanged source put in its place"
            )
        started, first = time.perf_counter(), len(self.outcomes)
        for mutant in list_mutants(tree):
            mutant.apply()
            noticed = _is_noticed(module, tree, items, self._limit)
            mutant.undo()
            place = f"{short}.py:{mutant.line} {mutant.function}"
            self.outcomes.append(Outcome(place, mutant.sort, mutant.text, noticed))
            if not noticed and not self._quiet:
                print(f"  not noticed: {place}: {mutant.text}", flush=True)
        tried = self.outcomes[first:]
        seconds = time.perf_counter() - started
        caught = sum(outcome.noticed for outcome in tried)
        print(f"{short}: {caught} of {len(tried)} noticed, {seconds:.0f} s", flush=True)


def _run(items: list[Any]) -> str:
    """Run tests until the first one fails and return its name; empty if none fails."""
    from _pytest.runner import runtestprotocol

    for number, item in enumerate(items):
        following = items[number + 1] if number + 1 < len(items) else None
        for report in runtestprotocol(item, nextitem=following, log=False):
            if report.failed:
                return f"{item.nodeid}: {report.longreprtext[-400:]}"
    return ""


def _is_noticed(module: ModuleType, tree: ast.Module, items: list[Any], limit: float) -> bool:
    """Run the tests on a changed module in a forked process, for `limit` seconds at most."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            signal.alarm(round(limit))
            silent = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silent, 1)
            os.dup2(silent, 2)
            transplant(module, tree)
            status = 1 if _run(items) else 0
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    return status != 0


def _modules_of(target: str, names: Sequence[str]) -> list[str]:
    package, usual, _ = TARGETS[target]
    folder = ROOT / package.replace(".", "/")
    chosen = names or usual or [path.stem for path in sorted(folder.glob("*.py"))]
    return [f"{package}.{name}" for name in chosen if name != "__init__"]


def summarise(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the counts in lines, by sort of mutant."""
    for sort in (*dict.fromkeys(outcome.sort for outcome in outcomes), ""):
        own = [outcome for outcome in outcomes if sort in ("", outcome.sort)]
        caught = sum(outcome.noticed for outcome in own)
        share = 100.0 * caught / max(len(own), 1)
        yield f"{sort or 'all'}: {caught} of {len(own)} noticed, {share:.1f} %"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutation", description=__doc__)
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("modules", nargs="*", help="modules of the target; all by default")
    parser.add_argument("--quiet", action="store_true", help="print counts only")
    parser.add_argument(
        "--own", action="store_true", help="run only the tests named like the module"
    )
    asked = parser.parse_intermixed_args(arguments)
    if asked.target == "components":
        # Read when numba is imported: a changed Python function is then what the models call.
        os.environ["NUMBA_DISABLE_JIT"] = "1"
    import pytest

    session = Session(_modules_of(asked.target, asked.modules), asked.quiet, asked.own)
    options = ["-p", "no:cacheprovider", "-p", "no:terminal", "--capture=no", "-o", "addopts="]
    tests = [str(ROOT / path) for path in TARGETS[asked.target][2]]
    if asked.own:
        names = {f"test_{name.rpartition('.')[2]}.py" for name in session.modules} | {NOMINAL}
        tests = [
            str(path)
            for folder in tests
            for path in Path(folder).glob("test_*.py")
            if path.name in names
        ]
    status = pytest.main([*options, "-m", "not slow", *tests], plugins=[session])
    print("\n".join(summarise(session.outcomes)))
    return int(status)


if __name__ == "__main__":
    raise SystemExit(main())
