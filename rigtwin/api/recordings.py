"""Recordings with their machine: channels, plots, videos, exports and imports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.api.machines import Settings, machine_of, resolve_machine, twin_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting
from rigtwin.importing.convert import Data, convert, convert_episodes
from rigtwin.numerics.arrays import Array
from rigtwin.recording import export, reader


@dataclass(frozen=True)
class Recording(reader.Recording):
    """One recorded test.

    `recording["/sensor.load_cell"]` is a channel, shape (ticks,). `recording.time` is its time in
    s, shape (ticks,). `recording.channels` names all channels, and `recording.units` their units.
    """

    described: Machine | None = field(default=None, repr=False)
    """Machine of the recording, if it was stated when the recording was loaded or made."""
    report: tuple[str, ...] = field(default=(), repr=False)
    """Lines about the imported data: gaps, units, columns used. Empty unless it was imported."""

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
        """Draw the recorded signals over time.

        Parameters
        ----------
        out
            File to write, with the ending png, svg or pdf.
        start, until
            Interval that is drawn, in s. `until` defaults to the end of the test.
        style
            "screen", "paper" (one column of a journal) or "paper-wide" (two columns).
        panels
            Beginnings of the titles of the panels that are drawn. Defaults to all panels.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RigtwinError
            For an unknown ending, style or panel, or an empty interval.
        """
        from rigtwin.render.plot import draw  # Imported late: matplotlib takes a second.
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
        """Film the machine in motion, with its signals beneath.

        Parameters
        ----------
        out
            File to write, mp4.
        ghost
            Magnification of the gap between the machine and its twin, whose prediction is drawn
            through the machine. 0, the default, draws no twin.
        settings
            Changes of the twin that is drawn: of its plant and `timing.timestep`.
        **options
            `camera`, `start` and `until` in s, `magnify`, `progress`; see
            `rigtwin.render.video.film`.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RigtwinError
            If this computer cannot draw, the file cannot be written, or a ghost is asked for and
            the twin cannot be compared with the recording.
        """
        from rigtwin.render.video import film  # Imported late: scipy.signal takes a second.

        machine = machine_of(self)
        if not 0.0 <= ghost < math.inf:
            raise RigtwinError(f"a ghost's gap {ghost:g} times as large; expected 0 or more")
        if ghost:
            options["ghost"] = _ghost(self, machine, twin_of(machine, settings, ()), ghost)
        film(self, forbid_overwriting(out, self.path, *machine.files), machine, **options)
        return Path(out)

    def export(self, out: str | Path) -> Path:
        """Write the recording as CSV or MAT.

        Parameters
        ----------
        out
            File to write; its ending, csv or mat, selects the format.

        Raises
        ------
        RigtwinError
            For any other ending.
        """
        export.export(self, forbid_overwriting(out, self.path))
        return Path(out)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel that the machine's description knows: channel → unit."""
        known = machine_of(self).units
        return {name: known[name] for name in self.channels if name in known}


def _ghost(
    recording: Recording, machine: Machine, twin: Configuration, magnify: float
) -> dict[str, Array]:
    """Return the twin's joint positions for drawing, with its gap to the machine magnified.

    The drawn position is q + m (q_twin - q), with the measured position q and magnification m.

    Returns
    -------
    dict
        Joint → position at every tick, in m or rad, shape (ticks,).

    Raises
    ------
    RigtwinError
        If the twin's motion is prescribed by the measurement, so that the two coincide.
    """
    from rigtwin.looking import Look

    look = Look(machine, recording, twin)
    if not look.predicts_motion:
        raise RigtwinError(f"{machine.name}: its twin moves as measured and has no ghost")
    measured, predicted = look.positions(), look.positions(look.nominal)
    return {
        # The twin's time grid may be coarser than the recording's.
        joint: np.interp(recording.time, look.time, values + magnify * (predicted[joint] - values))
        for joint, values in measured.items()
    }


def load(path: str | Path, machine: Machine | str | Path | None = None) -> Recording:
    """Read a recording.

    Parameters
    ----------
    path
        MCAP file in the format of docs/recording.md: a test on a rig, on a twin, or imported data.
    machine
        Machine the recording belongs to, or its name, or the path of its description. Defaults to
        the one named in the recording.

    Returns
    -------
    Recording
        The test. `recording["/sensor.load_cell"]` is a channel of shape (ticks,), `recording.time`
        is in s; `plot`, `video` and `export` write files of it.

    Raises
    ------
    RigtwinError
        If the file is missing, is no recording, is empty, or has a format that this version does
        not read. Also for an unknown machine.

    Examples
    --------
    >>> recording = rigtwin.load("rig.mcap")  # doctest: +SKIP
    >>> recording["/sensor.load_cell"].mean()  # doctest: +SKIP
    """
    if not isinstance(path, str | Path):
        raise RigtwinError(f"{path!r:.60}: expected the path of a recording")
    # The machine first: a model or a folder in its place is the likelier mistake.
    described = _resolve_optional(machine)
    return with_machine(reader.load(Path(path)), described)


def resolve_recording(recording: reader.Recording | str | Path) -> reader.Recording:
    """Return a recording; a path is read first. Raises RigtwinError for any other type."""
    if isinstance(recording, reader.Recording):
        return recording
    if isinstance(recording, str | Path):
        return load(recording)
    raise RigtwinError(f"{recording!r:.60}: expected a recording, or the path of one")


def with_machine(recording: reader.Recording, machine: Machine | None) -> Recording:
    """Return a recording with its machine attached, which spares a search for its description."""
    values = {attribute.name: getattr(recording, attribute.name) for attribute in fields(recording)}
    return Recording(**values, described=machine)


def import_data(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> Recording:
    """Convert another program's data to a recording.

    Parameters
    ----------
    data
        File or folder of a kind that docs/importing.md lists; several files, which are put side by
        side, row by row; or data in memory: a pandas DataFrame, an Arrow table, or a dictionary of
        name → array, shape (rows,) or (rows, items).
    mapping
        Map from columns to channels (docs/importing.md): a TOML file, or its tables as a
        dictionary.
    out
        File of the recording, MCAP.
    machine
        Machine the data belong to, or its name or description. Defaults to the one named in the
        map.

    Returns
    -------
    Recording
        The recording. Its `report` has lines about the data: gaps, repeated times, columns used.

    Raises
    ------
    RigtwinError
        If the data cannot be imported; the message names the column, unit or line. Also for data
        of several episodes, which `import_episodes` reads.

    Examples
    --------
    >>> rigtwin.import_data("bench.csv", "map.toml", "bench.mcap")  # doctest: +SKIP
    """
    described = _resolve_optional(machine)
    report = convert(_as_paths(data), _as_map(mapping), Path(out), described)
    return replace(load(out, described), report=tuple(report))


def import_episodes(
    data: Data | str | Path | Sequence[str | Path],
    mapping: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    machine: Machine | str | Path | None = None,
) -> tuple[Recording, ...]:
    """Convert each episode of another program's data to a recording.

    Parameters
    ----------
    data, mapping, machine
        As for `import_data`.
    folder
        Folder of the recordings. It is created if it does not exist.

    Returns
    -------
    tuple of Recording
        Recordings in the order of the episodes. An episode that cannot be imported is omitted, and
        every report states so.

    Raises
    ------
    RigtwinError
        If no episode can be imported.
    """
    described = _resolve_optional(machine)
    episodes = convert_episodes(_as_paths(data), _as_map(mapping), Path(folder), described)
    return tuple(
        replace(load(episode.path, described), report=episode.report) for episode in episodes
    )


def _resolve_optional(machine: Machine | str | Path | None) -> Machine | None:
    return None if machine is None else resolve_machine(machine)


def _as_paths(data: Any) -> Any:
    """Return paths as a list, and data in memory as they are."""
    if isinstance(data, str | Path):
        return [Path(data)]
    if (
        isinstance(data, list | tuple)
        and data
        and all(isinstance(name, str | Path) for name in data)
    ):
        return [Path(name) for name in data]
    if isinstance(data, bool | int | float) or data is None:
        raise RigtwinError(f"data {data!r}: expected the path of a file, or a table in memory")
    return data


def _as_map(mapping: str | Path | Mapping[str, Any]) -> Path | Mapping[str, Any]:
    return mapping if isinstance(mapping, Mapping) else Path(mapping)
