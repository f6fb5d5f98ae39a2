"""A recording beside its twin, whose effects are adjusted by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.api.machines import described_machine
from rigtwin.api.recordings import load, resolve_recording
from rigtwin.api.twin import Settings, twin_of
from rigtwin.api.watching import PATIENCE, watch
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.looking import Look
from rigtwin.looking.starting_point import from_alarm, from_first_look, read_diagnosis
from rigtwin.recording import reader
from rigtwin.watching import Watch

if TYPE_CHECKING:
    from rigtwin.looking.live import LivePage
    from rigtwin.looking.page import Page


def look(
    recording: reader.RecordedTest | str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
) -> Look:
    """Return a recording beside its twin, whose effects can be adjusted, fitted and saved.

    Parameters
    ----------
    recording
        Recording, or its path.
    machine
        Machine the recording belongs to, or its name, or the path of its description. Defaults to
        the one named in the recording.
    settings
        Changes of the twin before the comparison: of its plant and `timing.timestep`. All other
        settings are the recording's own.
    without
        Effects of the nominal machine that are removed from the twin first, such as
        "coulomb@rail".

    Returns
    -------
    Look
        `effects`, the effects that can be adjusted; `nominal`, the twin's prediction without any;
        `predict(values)`, `fit(names)` and `save(path, values)` predict, fit and save a twin with
        effects. `show_look` opens it in the browser.

    Raises
    ------
    RigtwinError
        If the data make a comparison meaningless; the message names every fault.

    Examples
    --------
    >>> view = rigtwin.look("rig.mcap")  # doctest: +SKIP
    >>> view.predict({"coulomb@rail": [80.0]}).percent  # doctest: +SKIP
    """
    recording = resolve_recording(recording)
    described = described_machine(recording, machine)
    return Look(described, recording, twin_of(described, settings, without))


def show_look(
    look: Look,
    *,
    port: int = 0,
    diagnosis: str | Path | None = None,
    save_twin: str | Path | None = None,
) -> Page:
    """Show a look in the browser: machine and twin in motion, traces, a slider for each effect.

    Parameters
    ----------
    look
        Result of `look`.
    port
        Port of the page on this computer; other computers cannot reach it. 0, the default, takes a
        free port.
    diagnosis
        JSON file of a diagnosis of the same recording. The page starts with its effects. By default
        it starts with the suspects of a first look, which takes a second or two.
    save_twin
        File that the page's save button writes, TOML. Defaults to RECORDING_twin.toml in the
        working folder.

    Returns
    -------
    Page
        Page at `url`, open until its `close` is called; `wait` blocks until then.

    Raises
    ------
    RigtwinError
        If the port is in use, the diagnosis is of another recording, or the package viser is
        missing.
    """
    start = from_first_look(look) if diagnosis is None else read_diagnosis(diagnosis, look)
    # Imported late: the page's packages are optional.
    with _needs_viser():
        from rigtwin.looking.local_server import open_server
        from rigtwin.looking.page import Page
    # Opened last: everything that can be refused has been by now.
    server = open_server(port, f"{look.machine.title}: {look.recording.path.name}")
    return Page(server, look, start, _twin_file(look.recording.path, save_twin))


def show_live(
    path: str | Path,
    *,
    port: int = 0,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    patience: float = PATIENCE,
    save_twin: str | Path | None = None,
    on_message: Callable[[str], object] = lambda _: None,
) -> LivePage:
    """Show a running test beside its twin in the browser.

    The page shows both in motion and the gap as it develops, and raises an alarm when the gap
    exceeds what noise and tolerances explain. After the test it becomes the page of `show_look`.

    Parameters
    ----------
    path
        File of the recording, which another program is writing or will write.
    port, save_twin
        Port of the page and file of its save button, see `show_look`.
    machine, settings, without, patience
        Machine, twin and waiting time, see `watch`.
    on_message
        Function called with one line for the operator: an alarm, its suspects, or the reason why
        the watch ended early.

    Returns
    -------
    LivePage
        Page at `url`, open until its `close` is called. `wait` blocks until then and raises the
        error that ended the watch, if any.

    Raises
    ------
    RigtwinError
        If the port is in use or the package viser is missing.
    """
    with _needs_viser():
        from rigtwin.looking.live import LivePage
        from rigtwin.looking.local_server import LocalServer, open_server
        from rigtwin.looking.page import Page

    follow = partial(
        watch, path, machine=machine, settings=settings, without=without, patience=patience
    )

    def look_back(server: LocalServer, watched: Watch) -> Page:
        # While the test ran, only its last seconds were held in memory.
        complete = look(
            load(path, machine), machine=watched.machine, settings=settings, without=without
        )
        start = None if watched.alarm is None else from_alarm(watched.alarm, complete)
        return Page(server, complete, start, _twin_file(Path(path), save_twin))

    return LivePage(open_server(port, Path(path).name), follow, look_back, on_message)


@contextmanager
def _needs_viser() -> Iterator[None]:
    """Turn a missing optional package into one line that says how to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "trimesh"):
            raise
        raise RigtwinError(f"the page needs {error.name}; pip install 'rigtwin[look]'") from None


def _twin_file(recording: Path, save_twin: str | Path | None) -> Path:
    return Path(f"{recording.stem}_twin.toml") if save_twin is None else Path(save_twin)
