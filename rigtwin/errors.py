"""The one exception that users see."""

from __future__ import annotations


class RigtwinError(Exception):
    """Invalid input of any kind.

    The message says in one line what is wrong, where, and what was expected.
    """
