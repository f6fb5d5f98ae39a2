"""Digest of the sources and models that every result of this version depends on."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

SOURCES = {
    "rigtwin": "*.py",
    "controllers": "*.py",
    "experiments": "*.py",
    "machines": "*.toml",
    "models": "*.xml",
}
"""Package → pattern of its files. The packages are located without being imported."""


@cache
def source_digest() -> str:
    """Return a digest of all sources, twelve hexadecimal digits.

    Two computers with equal digests compute equal results.
    """
    # Files are read in sorted order, because the order of a directory differs between systems.
    digest = hashlib.sha256()
    for package, pattern in SOURCES.items():
        spec = find_spec(package)
        for folder in sorted(spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(Path(folder).rglob(pattern)):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
