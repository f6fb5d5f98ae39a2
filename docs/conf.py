"""Sphinx's settings: the pages of this folder, and a reference made of docstrings. `make docs`."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parents[1]))

import rigtwin
from controllers.quantity import Quantity, fields

PACKAGES = ("rigtwin", "controllers")
"""What the reference is of: the names in each one's `__all__`."""

project = "rigtwin"
author = "The rigtwin authors"
project_copyright = f"2026, {author}"
release = rigtwin.__version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "myst_parser"]
default_role = "literal"
# Several classes have an attribute of one name, such as gap; a word in a docstring means none.
suppress_warnings = ["ref.python"]
html_theme = "furo"
html_title = f"rigtwin {release}"
myst_heading_anchors = 3

python_maximum_signature_line_length = 88
autodoc_default_options = {"members": True, "undoc-members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Array": "Array"}
autodoc_typehints_format = "short"
napoleon_google_docstring = False
napoleon_use_ivar = True


def directive(thing: object) -> str:
    """The directive that documents a thing."""
    if isinstance(thing, ModuleType):
        return "automodule"
    if inspect.isclass(thing):
        return "autoexception" if issubclass(thing, BaseException) else "autoclass"
    return "autofunction" if callable(thing) else "autodata"


def entries(package: str) -> Iterator[tuple[str, str]]:
    """(directive, name) of every public name. Asks for each, since rigtwin loads them when
    asked."""
    module = import_module(package)
    for name in getattr(module, "__all__", ()):
        yield directive(getattr(module, name)), f"{package}.{name}"


def fill(app: Sphinx, page: str, source: list[str]) -> None:
    """Fills the public names into the reference."""
    if page == "api":
        packages = {name: list(entries(name)) for name in PACKAGES}
        source[0] = app.builder.templates.render_string(source[0], {"packages": packages})


def skip(
    _app: Sphinx, _kind: str, _name: str, thing: object, skipped: bool, _options: object
) -> bool:
    """Leaves out the fields of a NamedTuple, which its signature has."""
    return skipped or type(thing).__name__ == "_tuplegetter"


def complete(
    _app: Sphinx, kind: str, _name: str, thing: object, _options: object, lines: list[str]
) -> None:
    """Adds to a class what its fields mean, and takes from a value what its type's docstring
    says."""
    if kind == "data" and lines[:1] == (type(thing).__doc__ or "").splitlines()[:1]:
        lines.clear()
    if isinstance(thing, type) and hasattr(thing, "_fields"):
        meanings = {name: one for name, one in fields(thing).items() if isinstance(one, Quantity)}
        lines += table(meanings) if meanings else []


SHORTER = (
    (r"Annotated\[(\w+), Quantity\(.*?\)\]", r"\1"),  # the table below has it
    (r"(: \w+ = )\((?:[^()]|\([^()]*\))*\)", r"\1..."),  # a group of defaults as plain numbers
    (r"TypeAliasForwardRef\('(\w+)'\)", r"\1"),
)
"""Of signatures: what is replaced by what."""


def shorten(
    _app: Sphinx,
    _kind: str,
    _name: str,
    _thing: object,
    _options: object,
    signature: str | None,
    returns: str,
) -> tuple[str | None, str]:
    """Takes from a signature what nobody reads."""
    for pattern, replacement in SHORTER:
        signature = signature and re.sub(pattern, replacement, signature)
    return signature, returns


def table(meanings: dict[str, Quantity]) -> list[str]:
    """Unit, bounds and source of each field, in reStructuredText."""
    rows = [("field", "unit", "from", "to", "source")]
    rows += [(name, q.unit, f"{q.low:g}", f"{q.high:g}", q.source) for name, q in meanings.items()]
    lines = ["", ".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        lines += [f"   {mark} - {cell}" for mark, cell in zip("*    ", row, strict=True)]
    return [*lines, ""]


def setup(app: Sphinx) -> None:
    """Sphinx calls this."""
    app.connect("source-read", fill)
    app.connect("autodoc-skip-member", skip)
    app.connect("autodoc-process-docstring", complete)
    app.connect("autodoc-process-signature", shorten)
