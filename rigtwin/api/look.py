"""A recording beside its twin, to move effects by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigtwin.api.answers import described_machine
from rigtwin.api.machines import Settings, twin_of
from rigtwin.description.machine import Machine
from rigtwin.looking import Look
from rigtwin.recording import reader


def look(
    recording: reader.Recording,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
) -> Look:
    """A recording beside its twin, whose effects can be moved, fitted and saved.

    Parameters
    ----------
    recording
        The data.
    machine
        That it is of; by default the one that it names.
    settings
        Changes of the twin that it is compared with: of its plant and `timing.timestep`.
    without
        Effects that are taken out of the twin first, such as "coulomb@rail".

    Returns
    -------
    Look
        The candidate effects, and what the twin with any of them predicts.

    Raises
    ------
    RigtwinError
        Naming every fault of the data that makes a comparison meaningless.
    """
    found = described_machine(recording, machine)
    return Look(found, recording, twin_of(found, settings, without))
