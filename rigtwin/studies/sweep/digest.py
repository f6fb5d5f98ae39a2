"""What a result depends on besides its job: the sources and models of this version."""

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
"""Package → files. They are looked for, not imported."""


@cache
def source_digest() -> str:
    """Digest all sources into twelve hexadecimal digits.

    The same on two computers means the same answers.
    """
    digest = hashlib.sha256()
    for package, pattern in SOURCES.items():
        spec = find_spec(package)
        for folder in sorted(spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(Path(folder).rglob(pattern)):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
