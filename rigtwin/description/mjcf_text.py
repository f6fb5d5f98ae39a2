"""Text of an MJCF whose attributes can be set: every other byte stays the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from rigtwin.errors import RigtwinError

PARENTS = {"joint": "body", "tendon": "tendon", "actuator": "actuator"}
"""Element of a description → tag that encloses the element's tag."""


@dataclass(eq=False)
class Tag:
    """Start tag of an element.

    Attributes
    ----------
    name
        Name of the tag, such as `joint`.
    attributes
        Attribute → value.
    first
        Offset of its first byte in the file.
    parent
        Tag that encloses it; None for the root.
    children
        Tags that it encloses directly.
    """

    name: str
    attributes: dict[str, str]
    first: int
    parent: Tag | None
    children: list[Tag] = field(default_factory=list)

    def walk(self) -> Iterator[Tag]:
        """Yield the tag and all tags inside of it."""
        yield self
        for child in self.children:
            yield from child.walk()


class Document:
    """Text of an MJCF, whose attributes can be set.

    Attributes
    ----------
    path
        Path of the MJCF.
    root
        Tag of the root.
    """

    def __init__(self, path: Path) -> None:
        """Read a file. Raises RigtwinError if it cannot be read or is no XML."""
        self.path = path
        try:
            self._text = path.read_bytes()
        except OSError as error:
            raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
        self._edits: dict[int, dict[str, str]] = {}
        # expat states the byte offset of every tag, which a tree of elements would not keep.
        stack: list[Tag] = []
        parser = expat.ParserCreate()

        def begin(name: str, attributes: dict[str, str]) -> None:
            parent = stack[-1] if stack else None
            tag = Tag(name, attributes, parser.CurrentByteIndex, parent)
            if parent is not None:
                parent.children.append(tag)
            else:
                self.root = tag
            stack.append(tag)

        def end(_: str) -> None:
            stack.pop()

        parser.StartElementHandler, parser.EndElementHandler = begin, end
        try:
            parser.Parse(self._text, True)
        except expat.ExpatError as error:
            raise RigtwinError(f"model {path}: {error}") from None

    def find(self, element: str, name: str) -> Tag:
        """Return the tag of a named joint, tendon, actuator or body.

        Raises RigtwinError if the file has none, which may then be in an included file.
        """
        for tag in self.root.walk():
            matches = tag.name == "body" if element == "body" else self._is_of(tag, element)
            if matches and tag.attributes.get("name") == name:
                return tag
        raise RigtwinError(
            f"{self.path.name} has no {element} {name!r} itself; give the {element} that name, or "
            "change it in the file that it includes"
        )

    @staticmethod
    def _is_of(tag: Tag, element: str) -> bool:
        """Return whether a tag is a joint, tendon or actuator of the model."""
        # Defaults and keyframes use the same tag names, so the enclosing tag decides.
        inside = tag.parent is not None and tag.parent.name == PARENTS[element]
        return inside and (element != "joint" or tag.name == "joint")

    def set(self, tag: Tag, attribute: str, value: str) -> None:
        """Set an attribute of a tag."""
        self._edits.setdefault(tag.first, {})[attribute] = value

    def text(self) -> bytes:
        """Return the text of the file with the attributes that were set."""
        out = self._text
        # From the end to the beginning, so that the offsets of earlier tags stay valid.
        for first in sorted(self._edits, reverse=True):
            last = _end_of_tag(out, first)
            tag = out[first:last].decode()
            for attribute, value in self._edits[first].items():
                tag = _with_attribute(tag, attribute, value)
            out = out[:first] + tag.encode() + out[last:]
        return out


def _end_of_tag(text: bytes, first: int) -> int:
    """Return the offset after a start tag. A `>` inside of quotes does not end the tag."""
    quote = 0
    for place in range(first, len(text)):
        byte = text[place]
        if quote:
            quote = 0 if byte == quote else quote
        elif byte in b"\"'":
            quote = byte
        elif byte == ord(">"):
            return place + 1
    return len(text)


def _with_attribute(tag: str, attribute: str, value: str) -> str:
    """Return a start tag with an attribute replaced or appended."""
    match = re.search(rf"(\s{attribute}\s*=\s*)(\"[^\"]*\"|'[^']*')", tag)
    if match is not None:
        return tag[: match.start()] + f'{match.group(1)}"{value}"' + tag[match.end() :]
    end = re.search(r"\s*/?>$", tag)
    assert end is not None
    return f'{tag[: end.start()]} {attribute}="{value}"{tag[end.start() :]}'
