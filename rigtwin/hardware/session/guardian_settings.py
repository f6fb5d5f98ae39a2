"""What the loop and its guardian share: what is watched, and the memory that ticks go through."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.session.recorder import ROW
from rigtwin.hardware.supervisor import Phase
from rigtwin.numerics.arrays import Array

RING = 8192
"""Ticks that the shared memory holds for the recording: seconds of them."""
BEAT, GROUND, STRUCTURE, GUARDED, WRITTEN, READ, PREPARED, ALIVE, NUMBERS = range(9)
"""Numbers in the shared memory, before the ticks: time of the last tick, positions held, whether there is anything to watch,
ticks written by the loop and read by the guardian, whether it could stop the rig, when it last looked."""


def split_memory(memory: Any) -> tuple[Array, Array]:
    """The numbers, and the ring of ticks."""
    whole = np.frombuffer(memory)
    return whole[:NUMBERS], whole[NUMBERS:].reshape(RING, ROW)


@dataclass(frozen=True)
class GuardianSettings:
    """What the guardian has to know. recording: arguments of rigtwin.recording.Writer; metadata: records added at once;
    table: of the card, None for a rig that needs no stopping; patience: s without a tick before it acts; hold: s before it
    takes the pressure off; live: port of a live view on this computer, 0 for none."""

    recording: dict[str, Any]
    metadata: dict[str, dict[str, str]]
    table: ChannelTable | None
    patience: float
    hold: float
    live: int = 0
    phases: tuple[Phase, ...] = field(
        default=(Phase.ARMED, Phase.RAMPING, Phase.RUNNING, Phase.STOPPING)
    )
