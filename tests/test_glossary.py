"""The glossary has every public class, kind of effect and unit once, and class names are unique."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

import rigtwin
from rigtwin.components import library
from rigtwin.importing.units import UNITS

ROOT = Path(__file__).parents[1]
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
CODE = Counter(re.findall(r"`([^`]+)`", GLOSSARY))
CLASSES = [name for name in rigtwin.__all__ if isinstance(getattr(rigtwin, name), type)]
KINDS = sorted({kind.name for kind in library.KINDS})


@pytest.mark.parametrize("name", [*CLASSES, *KINDS, *UNITS])
def test_a_public_name_stands_in_the_glossary_once(name: str) -> None:
    assert CODE[name] == 1


def test_a_public_class_has_its_name_alone() -> None:
    classes = [getattr(rigtwin, name) for name in CLASSES]
    assert len(set(CLASSES)) == len(set(classes)) == len(CLASSES)
    for name, one in zip(CLASSES, classes, strict=True):
        assert one.__name__ == name


def test_the_lazy_table_has_every_public_name() -> None:
    assert sorted(rigtwin._WHERE) == sorted(rigtwin.__all__)


def test_a_word_is_defined_once() -> None:
    terms = re.findall(r"^- (?:\*\*[^*]+\*\*(?:, )?)+", GLOSSARY, re.MULTILINE)
    words = [word for term in terms for word in re.findall(r"\*\*([^*]+)\*\*", term)]
    twice = {word for word, count in Counter(words).items() if count > 1}
    assert len(words) > 50
    assert not twice
