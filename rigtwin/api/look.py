"""A recording beside its twin, to move effects by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.api.answers import described_machine
from rigtwin.api.machines import Settings, twin_of
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.looking import Look
from rigtwin.looking.given import read_answer
from rigtwin.recording import reader

if TYPE_CHECKING:
    from rigtwin.looking.page import Page


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


def show_look(
    look: Look,
    *,
    port: int = 0,
    diagnosis: str | Path | None = None,
    save_twin: str | Path | None = None,
) -> Page:
    """A look in the browser: the machine and its twin in motion, traces, a slider for each effect.

    Parameters
    ----------
    look
        What `look` gave.
    port
        Of this computer, which alone reaches the page; 0 takes a free one.
    diagnosis
        JSON of a diagnosis of the same recording, with whose effects the page begins.
    save_twin
        What the page's save button writes; by default a file in the working folder named after
        the recording.

    Returns
    -------
    Page
        Open at its `url` until its `close` is called; `wait` returns then.

    Raises
    ------
    RigtwinError
        If the port is taken, the diagnosis is none of this recording, or viser is missing.
    """
    try:
        from rigtwin.looking.page import Page
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "trimesh"):
            raise
        raise RigtwinError(f"the page needs {error.name}; pip install 'rigtwin[look]'") from None
    given = None if diagnosis is None else read_answer(diagnosis, look)
    out = Path(f"{look.recording.path.stem}_twin.toml") if save_twin is None else Path(save_twin)
    return Page(look, port, given, out)
