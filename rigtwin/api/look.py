"""A recording beside its twin, to move effects by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.api.machines import Settings, described_machine, twin_of
from rigtwin.api.recordings import load, resolve_recording
from rigtwin.api.watching import PATIENCE, watch
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.looking import Look
from rigtwin.looking.starting_point import from_alarm, read_diagnosis
from rigtwin.recording import reader
from rigtwin.watching import Watch

if TYPE_CHECKING:
    from rigtwin.looking.live import LivePage
    from rigtwin.looking.page import Page


def look(
    recording: reader.Recording | str | Path,
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
    recording = resolve_recording(recording)
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
    given = None if diagnosis is None else read_diagnosis(diagnosis, look)
    with _needs_viser():
        from rigtwin.looking.local_server import open_server
        from rigtwin.looking.page import Page
    server = open_server(port, f"{look.machine.title}: {look.recording.path.name}")
    return Page(server, look, given, _twin_file(look.recording.path, save_twin))


def show_live(
    path: str | Path,
    *,
    port: int = 0,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    patience: float = PATIENCE,
    save_twin: str | Path | None = None,
    said: Callable[[str], object] = lambda _: None,
) -> LivePage:
    """A test that is running beside its twin, in the browser: both in motion, the gap as it arises,
    an alarm when it is more than noise and tolerances explain. When the test is over, the page
    becomes that of `show_look`.

    Parameters
    ----------
    path
        Of the recording, which another program writes or is about to.
    port, save_twin
        As `show_look` takes them.
    machine, settings, without, patience
        As `watch` takes them.
    said
        Called with what there is to say, a line each: an alarm, its suspects, why the watch ended
        early.

    Returns
    -------
    LivePage
        Open at its `url` until its `close` is called; `wait` returns then, and raises what went
        wrong with the recording.

    Raises
    ------
    RigtwinError
        If the port is taken or viser is missing.
    """
    with _needs_viser():
        from rigtwin.looking.live import LivePage
        from rigtwin.looking.local_server import LocalServer, open_server
        from rigtwin.looking.page import Page

    def follow(on_update: Callable[[Watch], object], stop: Callable[[], bool]) -> Watch:
        return watch(
            path,
            machine=machine,
            settings=settings,
            without=without,
            told=on_update,
            patience=patience,
            stop=stop,
        )

    def look_back(server: LocalServer, watched: Watch) -> Page:
        whole = look(
            load(path, machine), machine=watched.machine, settings=settings, without=without
        )
        given = None if watched.alarm is None else from_alarm(watched.alarm, whole)
        return Page(server, whole, given, _twin_file(Path(path), save_twin))

    return LivePage(open_server(port, Path(path).name), follow, look_back, said)


@contextmanager
def _needs_viser() -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "trimesh"):
            raise
        raise RigtwinError(f"the page needs {error.name}; pip install 'rigtwin[look]'") from None


def _twin_file(recording: Path, named: str | Path | None) -> Path:
    return Path(f"{recording.stem}_twin.toml") if named is None else Path(named)
