"""Settings as the command line takes them."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.description.changes import parse_assignments, with_changes
from rigtwin.description.configuration import Configuration


def from_assignments(configuration: Configuration, texts: Sequence[str]) -> Configuration:
    """Return a configuration with settings such as `rail.coulomb=60`."""
    return with_changes(configuration, list(parse_assignments(texts)))
