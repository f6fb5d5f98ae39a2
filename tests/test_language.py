"""Names and docstrings that a reader understands without their neighbours."""

from __future__ import annotations

import ast
import functools
import itertools
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("rigtwin", "controllers", "experiments", "referee")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
PLACEHOLDERS = {
    *("each", "found", "told", "own", "left", "apart", "given", "several", "kept", "there"),
    *("others", "another", "other", "which", "whose", "what", "something", "instead", "here"),
    *("many", "much", "these", "those", "everything", "nothing", "anything", "alike", "same"),
}
"""Names that say nothing about what they hold."""
ALLOWED_SHARE = 0.005
"""Share of bound names that may be placeholders, as in `for each in ...` of one line."""
FRAGMENT = re.compile(r"(Of|That|Whose|What|Which|Those|Where|How|By which|In which|To which)\b")
"""Beginning of a description that is no sentence by itself."""
PUBLIC_TWICE = {"Recording"}
"""`rigtwin.Recording` adds what people call to the recording that all modules read."""


@functools.cache
def trees() -> list[tuple[Path, ast.Module]]:
    return [(path.relative_to(ROOT), ast.parse(path.read_text())) for path in SOURCES]


def bound_names(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def descriptions(docstring: str) -> Iterator[str]:
    """Yield the first line of each description in the sections of a NumPy docstring."""
    lines = docstring.splitlines()
    sections = any(line and set(line) == {"-"} for line in lines)
    for line, below in itertools.pairwise(lines):
        if sections and line and not line.startswith((" ", "-")) and below.startswith("    "):
            yield below.strip()


def test_a_class_name_has_one_meaning() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for path, tree in trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(str(path))
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert set(twice) <= PUBLIC_TWICE, twice


def test_names_say_what_they_hold() -> None:
    names = [(path, name) for path, tree in trees() for name in bound_names(tree)]
    vague = [f"{path}: {name}" for path, name in names if name.strip("_") in PLACEHOLDERS]
    assert len(vague) <= ALLOWED_SHARE * len(names), vague


@pytest.mark.parametrize("package", PACKAGES)
def test_descriptions_are_sentences_of_their_own(package: str) -> None:
    fragments = [
        f"{path}: {line}"
        for path, tree in trees()
        if path.parts[0] == package
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
        for line in descriptions(ast.get_docstring(node) or "")
        if FRAGMENT.match(line)
    ]
    assert not fragments
