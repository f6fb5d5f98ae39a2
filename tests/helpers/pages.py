"""Reading of the project's Markdown pages: their blocks of code, headings and links."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS]
_FENCE = re.compile(r"^( *)```(\S*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"`(\w+\.(?:toml|xml))`")


@dataclass(frozen=True)
class Block:
    """Fenced block of code on a page.

    Attributes
    ----------
    language
        Word behind the opening fence; empty for what a command prints.
    text
        Lines of the block, without the fence's indentation.
    file
        Name of the file that the text before the block names last, or None.
    """

    language: str
    text: str
    file: str | None


def name_of(page: Path) -> str:
    """Return a page's path within the project."""
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page in their order."""
    text = page.read_text(encoding="utf-8")
    found, end = [], 0
    for match in _FENCE.finditer(text):
        named = _FILE.findall(text[end : match.start()])
        indent = match[1]
        body = "".join(line.removeprefix(indent) for line in match[3].splitlines(keepends=True))
        found.append(Block(match[2], body, named[-1] if named else None))
        end = match.end()
    return found


def without_blocks(page: Path) -> str:
    """Return the text of a page without its fenced blocks."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def indented_lines(page: Path) -> Iterator[str]:
    """Yield the lines of the indented blocks of code: those after an empty line."""
    inside, before = False, ""
    for line in without_blocks(page).splitlines():
        indented = line.startswith("    ") and line.strip() != ""
        inside = indented and (inside or before == "")
        if inside:
            yield line.strip()
        before = line.strip()


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and myst-parser name them."""
    headings = re.findall(r"^#{1,4} (.+)$", without_blocks(page), re.MULTILINE)
    plain = (re.sub(r"[`*_]|\[([^\]]*)\]\([^)]*\)", r"\1", heading) for heading in headings)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in plain}


def links(page: Path) -> list[str]:
    """Return the targets of a page's links and pictures within the project."""
    targets = re.findall(r"\]\(([^)\s]+)\)", without_blocks(page))
    return [target for target in targets if not target.startswith(("http:", "https:"))]
