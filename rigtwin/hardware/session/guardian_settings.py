"""What the loop and its guardian share: the guardian's settings, and the memory of the ticks."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.session.recorder import Layout
from rigtwin.hardware.supervisor import Phase
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer

SharedMemory = ctypes.Array[ctypes.c_double]

RING = 8192
"""Ticks that the shared memory holds for the recording: seconds of them."""
BEAT, GUARDED, WRITTEN, READ, PREPARED, ALIVE, SAFE = range(7)
"""Numbers in the shared memory, before the ticks: time of the last tick, whether there is anything
to guard, ticks written by the loop and read by the guardian, whether it could stop the rig, when it
last looked; then the outputs that are safe."""


def memory_size(layout: Layout) -> int:
    """How many numbers there are."""
    return SAFE + layout.outputs + RING * layout.row


def split_memory(memory: SharedMemory, layout: Layout) -> tuple[Array, Array]:
    """Gives views of the numbers before the ticks, shape (SAFE + outputs,), and of the ring of
    ticks, shape (RING, numbers)."""
    whole, first = np.frombuffer(memoryview(memory)), SAFE + layout.outputs
    return whole[:first], whole[first:].reshape(RING, layout.row)


@dataclass(frozen=True)
class GuardianSettings:
    """What the guardian has to know.

    Parameters
    ----------
    open_writer : callable
        Opens the recording; picklable.
    metadata : dict
        Records added at once.
    layout : Layout
        Of the ticks.
    table : ChannelTable or None
        Of the card; None for a rig that needs no stopping.
    patience : float
        s without a tick before the guardian acts.
    hold : float
        s before it takes the power off.
    live : int
        Port of a live view on this computer, 0 for none.
    phases : tuple of Phase
        Those in which the loop is guarded.
    """

    open_writer: Callable[[], Writer]
    metadata: dict[str, dict[str, str]]
    layout: Layout
    table: ChannelTable | None
    patience: float
    hold: float
    live: int = 0
    phases: tuple[Phase, ...] = (Phase.ARMED, Phase.RAMPING, Phase.RUNNING, Phase.STOPPING)
