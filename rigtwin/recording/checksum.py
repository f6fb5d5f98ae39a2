"""Checksums of a recording's records."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

_CHECKSUM = "crc32"
"""Key of the metadata entry that holds the checksum of all other entries."""


def seal(values: Mapping[str, str]) -> dict[str, str]:
    """Return metadata with a checksum of their entries."""
    return {**values, _CHECKSUM: _checksum(values)}


def unseal(values: Mapping[str, str]) -> tuple[dict[str, str], bool]:
    """Return metadata without their checksum, and whether it is right or absent."""
    # Other programs write metadata without a checksum, which is not held against them.
    # The checksum covers all entries but itself.
    bare = {name: value for name, value in values.items() if name != _CHECKSUM}
    return bare, values.get(_CHECKSUM, _checksum(bare)) == _checksum(bare)


def _checksum(values: Mapping[str, str]) -> str:
    """Return the checksum of metadata, which does not depend on their order."""
    return f"{zlib.crc32(json.dumps(values, sort_keys=True).encode()):08x}"
