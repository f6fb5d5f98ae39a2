"""Recordings with their machine: channels, plots, videos and exports."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.api.machines import machine_of, resolve_machine
from rigtwin.api.twin import Settings, twin_of
from rigtwin.describing.described import Described
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting
from rigtwin.importing.log_source import LogSource
from rigtwin.numerics.arrays import Array
from rigtwin.recording import export, reader


@dataclass(frozen=True)
class Origin:
    """Log that a recording was made from.

    Attributes
    ----------
    described
        Description by which the log was read.
    log
        Source of the log, files or a table in memory.
    test
        Number of the test among those of the log, from 0 on.
    """

    described: Described
    log: LogSource
    test: int


@dataclass(frozen=True)
class Recording(reader.RecordedTest):
    """One recorded test.

    `recording["/sensor.load_cell"]` is a channel, shape (ticks,). `recording.time` is its time in
    s, shape (ticks,). `recording.channels` names all channels, and `recording.units` their units.
    """

    described: Machine | None = field(default=None, repr=False)
    """Machine of the recording, if it was stated when the recording was loaded or made."""
    origin: Origin | None = field(default=None, repr=False)
    """Log that the recording was made from; None of a recorded test."""
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
        self, out: str | Path, *, ghost: float = 0.0, settings: Settings = (), **options: Any
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
            If this computer cannot draw, the package av is missing, the file cannot be written, or
            a ghost is asked for and the twin cannot be compared with the recording.
        """
        try:
            from rigtwin.render.video import film  # Imported late: scipy.signal takes a second.
        except ModuleNotFoundError as error:
            if error.name != "av":
                raise
            raise RigtwinError("videos need av: pip install 'rigtwin[video]'") from None

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
    described = resolve_optional(machine)
    return with_machine(reader.load(Path(path)), described)


def resolve_recording(recording: reader.RecordedTest | str | Path) -> reader.RecordedTest:
    """Return a recording; a path is read first. Raises RigtwinError for any other type."""
    if isinstance(recording, reader.RecordedTest):
        return recording
    if isinstance(recording, str | Path):
        return load(recording)
    # A table or dictionary prints itself in several lines: its type is enough.
    shown = type(recording).__name__ if hasattr(recording, "__len__") else f"{recording!r:.60}"
    raise RigtwinError(
        f"{shown}: expected a recording, or the path of one; data in memory need a model "
        "(MJCF or URDF) as the machine"
    )


def with_machine(recording: reader.RecordedTest, machine: Machine | None) -> Recording:
    """Return a recording with its machine attached, which spares a search for its description."""
    values = {attribute.name: getattr(recording, attribute.name) for attribute in fields(recording)}
    return Recording(**values, described=machine)


def resolve_optional(machine: Machine | str | Path | None) -> Machine | None:
    """Return the machine that an optional argument names; None stays None."""
    return None if machine is None else resolve_machine(machine)
