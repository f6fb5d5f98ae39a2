"""What the loop and its guardian share: the guardian's settings, and the memory of the ticks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.session.recorder import ROW
from rigtwin.hardware.supervisor import Phase
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

SharedMemory = ctypes.Array[ctypes.c_double]

RING = 8192
"""Ticks that the shared memory holds for the recording: seconds of them."""
BEAT, GROUND, STRUCTURE, GUARDED, WRITTEN, READ, PREPARED, ALIVE, NUMBERS = range(9)
"""Numbers in the shared memory, before the ticks: time of the last tick, positions held, whether
there is anything to guard, ticks written by the loop and read by the guardian, whether it could
stop the rig, when it last looked."""


def split_memory(memory: SharedMemory) -> tuple[Array, Array]:
    """Gives views of the numbers, shape (NUMBERS,), and of the ring of ticks, shape (RING, ROW)."""
    whole = np.frombuffer(memoryview(memory))
    return whole[:NUMBERS], whole[NUMBERS:].reshape(RING, ROW)


@dataclass(frozen=True)
class GuardianSettings:
    """What the guardian has to know.

    Parameters
    ----------
    open_writer : callable
        Opens the recording; picklable.
    metadata : dict
        Records added at once.
    table : ChannelTable or None
        Of the card; None for a rig that needs no stopping.
    patience : float
        s without a tick before the guardian acts.
    hold : float
        s before it takes the pressure off.
    live : int
        Port of a live view on this computer, 0 for none.
    phases : tuple of Phase
        Those in which the loop is guarded.
    """

    open_writer: Callable[[], Writer]
    metadata: dict[str, dict[str, str]]
    table: ChannelTable | None
    patience: float
    hold: float
    live: int = 0
    phases: tuple[Phase, ...] = (Phase.ARMED, Phase.RAMPING, Phase.RUNNING, Phase.STOPPING)
