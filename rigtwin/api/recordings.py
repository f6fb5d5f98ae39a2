"""Recordings as they are worked with: channels, plots, videos, exports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.api.machines import Settings, machine, machine_of, the_machine, twin_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting
from rigtwin.importing.convert import Data, convert, convert_episodes
from rigtwin.numerics.arrays import Array
from rigtwin.recording import export, reader


@dataclass(frozen=True)
class Recording(reader.Recording):
    """A test as it was recorded.

    `recording["/sensor.load_cell"]` is a channel, shape (ticks,), `recording.time` its time in s,
    `recording.channels` names them all, `recording.units` says their units.
    """

    described: Machine | None = field(default=None, repr=False)
    """The machine that it is of, where it was said."""
    report: tuple[str, ...] = field(default=(), repr=False)
    """What was found in the data that it was made of, where it was imported."""

    @property
    def tripped(self) -> bool:
        """Whether a limit ended the test."""
        return self.end.startswith("trip")

    def plot(
        self,
        out: str | Path,
        start: float = 0.0,
        until: float | None = None,
        *,
        style: str = "screen",
        panels: Sequence[str] = (),
    ) -> Path:
        """Draws it.

        Parameters
        ----------
        out
            A png, svg or pdf file.
        start, until
            s, the stretch that is drawn; until the end by default.
        style
            "screen", or "paper" and "paper-wide" for one and two columns of a journal.
        panels
            What the titles of those that are drawn begin with; all by default.

        Raises
        ------
        RigtwinError
            For another ending or style, an empty stretch, or a panel that it does not have.
        """
        from rigtwin.render.plot import draw  # Late: matplotlib takes a second.
        from rigtwin.render.style import find_style

        draw(self, forbid_overwriting(out, self.path), start, until, find_style(style), panels)
        return Path(out)

    def video(
        self,
        out: str | Path,
        *,
        ghost: float = 0.0,
        settings: Settings = (),
        **options: Any,
    ) -> Path:
        """Films it.

        Parameters
        ----------
        out
            An mp4 file.
        ghost
            The twin's prediction is drawn through the machine, its gap so many times as large; 0
            for none.
        settings
            Changes of that twin.
        **options
            camera, start and until in s, magnify, progress; see `rigtwin.render.video.film`.

        Raises
        ------
        RigtwinError
            If this computer cannot draw, the file cannot be written, or there is to be a ghost and
            the twin cannot be held against it.
        """
        from rigtwin.render.video import film  # Late: so does scipy.signal.

        machine = machine_of(self)
        if not 0.0 <= ghost < math.inf:
            raise RigtwinError(f"a ghost's gap {ghost:g} times as large; expected 0 or more")
        if ghost:
            options["ghost"] = _ghost(self, machine, twin_of(machine, settings, ()), ghost)
        film(self, forbid_overwriting(out, self.path, *machine.files), machine, **options)
        return Path(out)

    def export(self, out: str | Path) -> Path:
        """Writes it as csv or mat, by the name's ending. Raises RigtwinError for any other."""
        export.export(self, forbid_overwriting(out, self.path))
        return Path(out)

    @property
    def units(self) -> dict[str, str]:
        """Channel → unit, of those that the machine's description knows."""
        known = machine_of(self).units
        return {name: known[name] for name in self.channels if name in known}


def _ghost(
    recording: Recording, machine: Machine, twin: Configuration, magnify: float
) -> dict[str, Array]:
    """Where a twin's joints stand, the gap drawn larger, at every tick. Raises RigtwinError where
    there is nothing to be drawn."""
    from rigtwin.looking import Look

    look = Look(machine, recording, twin)
    if not look.predicts_motion:
        raise RigtwinError(f"{machine.name}: its twin moves as measured and has no ghost")
    measured, predicted = look.positions(), look.positions(look.nominal)
    return {
        joint: np.interp(recording.time, look.time, values + magnify * (predicted[joint] - values))
        for joint, values in measured.items()
    }


def load(path: str | Path, of: Machine | str | Path | None = None) -> Recording:
    """Reads a recording.

    Parameters
    ----------
    path
        Of an MCAP file, whoever wrote it.
    of
        The machine, or its name or description; by default the one that the recording names.

    Raises
    ------
    RigtwinError
        If it is no recording, is empty, or is of a format that this version does not read.
    """
    if not isinstance(path, str | Path):
        raise RigtwinError(f"{path!r:.60}: expected the path of a recording")
    return faced(reader.load(Path(path)), machine(of) if isinstance(of, str | Path) else of)


def the_recording(given: reader.Recording | str | Path) -> reader.Recording:
    """A recording, or the one of that path. Raises RigtwinError for anything else."""
    if isinstance(given, reader.Recording):
        return given
    if isinstance(given, str | Path):
        return load(given)
    raise RigtwinError(f"{given!r:.60}: expected a recording, or the path of one")


def faced(plain: reader.Recording, described: Machine | None) -> Recording:
    return Recording(
        **{each.name: getattr(plain, each.name) for each in fields(plain)}, described=described
    )


def import_data(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> Recording:
    """Make a recording of another program's data.

    Parameters
    ----------
    data
        File or folder of a kind that docs/importing.md lists; several files, which are put side by
        side, row by row; or data in memory: a pandas DataFrame, an Arrow table, or a dictionary of
        name → array, shape (rows,) or (rows, items).
    mapping
        Map from columns to channels: a TOML file, or its tables as a dictionary.
    out
        The recording, an MCAP file.
    machine
        Machine the data belong to, or its name or description. Defaults to the one named in the
        map.

    Returns
    -------
    Recording
        The recording, with a report of what was found on the way.

    Raises
    ------
    RigtwinError
        Naming the column, unit or line that is at fault. Also for data of several episodes.
    """
    described = _described(machine)
    report = convert(_given(data), _map_of(mapping), Path(out), described)
    return replace(load(out, described), report=tuple(report))


def import_episodes(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> tuple[Recording, ...]:
    """Make a recording of each episode of another program's data.

    Parameters
    ----------
    data, mapping, machine
        As for `import_data`.
    folder
        Folder of the recordings, made if it is absent.

    Returns
    -------
    tuple of Recording
        In the order of the episodes. An episode that cannot be imported is left out, which every
        report states.

    Raises
    ------
    RigtwinError
        If no episode can be imported.
    """
    described = _described(machine)
    done = convert_episodes(_given(data), _map_of(mapping), Path(folder), described)
    return tuple(replace(load(each.path, described), report=each.report) for each in done)


def _described(given: Machine | str | Path | None) -> Machine | None:
    return None if given is None else the_machine(given)


def _given(data: Any) -> Any:
    """Return paths as a list, and data in memory as they are."""
    if isinstance(data, str | Path):
        return [Path(data)]
    if isinstance(data, list | tuple) and data and all(isinstance(n, str | Path) for n in data):
        return [Path(name) for name in data]
    if isinstance(data, bool | int | float) or data is None:
        raise RigtwinError(f"data {data!r}: expected the path of a file, or a table in memory")
    return data


def _map_of(given: str | Path | Mapping[str, Any]) -> Path | Mapping[str, Any]:
    return given if isinstance(given, Mapping) else Path(given)
