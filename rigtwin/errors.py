"""The one exception users see: a single clear line."""

from __future__ import annotations


class RigtwinError(Exception):
    """Bad input of any sort. The message says in one line what is wrong, where, and what was
    expected."""
