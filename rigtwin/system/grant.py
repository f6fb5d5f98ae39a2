"""Privileges that a loop in real time requests from the system."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Grant:
    """Result of one request.

    Attributes
    ----------
    name
        Name of the privilege.
    lacking
        Why it was refused, and how to obtain it; empty if it was granted.
    """

    name: str
    lacking: str = ""


SCHEDULING, MEMORY = "FIFO scheduling", "locked memory"
