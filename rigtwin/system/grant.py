"""What a loop in real time asks of the system."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Grant:
    """One thing that a loop in real time wants of the system.

    lacking: why it is not there and how to get it, or empty.
    """

    name: str
    lacking: str = ""


SCHEDULING, MEMORY = "FIFO scheduling", "locked memory"
