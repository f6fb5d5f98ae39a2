"""Data shared by the loop and its guardian: the guardian's settings, and the memory for ticks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.session.recorder import TickLayout
from rigtwin.hardware.supervisor import Phase
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

SharedMemory = ctypes.Array[ctypes.c_double]

RING = 8192
"""Number of ticks that the shared memory holds: several seconds."""
BEAT, GUARDED, WRITTEN, READ, PREPARED, ALIVE, SAFE = range(7)
"""Indices of the numbers before the ticks in shared memory: time of the last tick, whether the loop
is guarded, ticks written by the loop, ticks read by the guardian, whether the guardian could stop
the rig, time of its last check. The safe outputs follow. Each number has one writer, and a double
is written at once, so no lock is needed."""


def memory_size(layout: TickLayout) -> int:
    """Return the number of doubles in shared memory."""
    return SAFE + layout.outputs + RING * layout.row


def split_memory(memory: SharedMemory, layout: TickLayout) -> tuple[Array, Array]:
    """Return views of the shared memory.

    Returns
    -------
    tuple of two arrays
        Numbers before the ticks, shape (SAFE + outputs,), and the ring of ticks, shape
        (RING, numbers per tick).
    """
    # Views share the memory; nothing is copied.
    whole, first = np.frombuffer(memoryview(memory)), SAFE + layout.outputs
    return whole[:first], whole[first:].reshape(RING, layout.row)


@dataclass(frozen=True)
class GuardianSettings:
    """Settings of the guardian.

    Parameters
    ----------
    open_writer : callable
        Function that opens the recording; picklable.
    metadata : dict
        Metadata records added at the start.
    layout : TickLayout
        Layout of a tick.
    table : ChannelTable or None
        Channel table of the card; None for a rig that needs no stopping.
    patience : float
        Time without a tick after which the guardian acts, in s.
    hold : float
        Time before the guardian switches the power off, in s.
    live : int
        Port of a live view on this computer; 0 for none.
    phases : tuple of Phase
        Phases in which the loop is guarded.
    """

    open_writer: Callable[[], Writer]
    metadata: dict[str, dict[str, str]]
    layout: TickLayout
    table: ChannelTable | None
    patience: float
    hold: float
    live: int = 0
    phases: tuple[Phase, ...] = (Phase.ARMED, Phase.RAMPING, Phase.RUNNING, Phase.STOPPING)
