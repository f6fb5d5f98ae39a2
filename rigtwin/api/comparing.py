"""Comparison of a recording with its twin, and of two recordings with each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rigtwin.api.diagnosis_data import Recorded
from rigtwin.api.machines import described_machine, machine_of
from rigtwin.api.recordings import resolve_recording
from rigtwin.api.twin import Effects, Settings, effect_texts, require_unrecorded, twin_of
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.compare import Comparison, differences
from rigtwin.diagnosis.compare import compare as compare_with_twin
from rigtwin.diagnosis.compare import compare_recordings as find_differences
from rigtwin.diagnosis.residual import Residual


def compare(
    recording: Recorded,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    effects: Effects = (),
    progress: Callable[[str], object] = lambda _replay: None,
) -> Comparison:
    """Compare a recording with its twin.

    On the suspension rig, every component is replayed: driven by its recorded inputs, its output is
    compared with the recorded one. On any other machine the signals are compared one by one.

    Parameters
    ----------
    recording
        Recording, or its path.
    machine
        Machine the recording belongs to, or its name, or the path of its description. Defaults to
        the one named in the recording.
    settings
        Changes of the twin: of its plant and `timing.timestep`. All other settings are the
        recording's own.
    effects
        Effects added to the twin, such as {"coulomb@rail": 80}.
    progress
        Function called with the name of each replay.

    Returns
    -------
    Comparison
        `replays`, replay → `Residual` with the residual's rms, its noise floor (both in `unit`),
        their `ratio` (1 is noise alone) and the band of most of its power in Hz; `left_out`,
        replay → reason why it was impossible; ``notes``; ``gap``, the rms of all residuals in units
        of white noise.

    Raises
    ------
    RigtwinError
        If the data make a comparison meaningless; the message names every fault.

    Examples
    --------
    >>> import rigtwin
    >>> recording = rigtwin.run("emps", "positioning", effects={"coulomb@guide": 20})
    >>> rigtwin.compare(recording).gap > 2.0
    True
    """
    recording = resolve_recording(recording)
    described = described_machine(recording, machine)
    require_unrecorded(settings, described, [recording])
    base = twin_of(described, settings, (), effect_texts(effects))
    configuration = described.configuration_of(recording, base)
    return compare_with_twin(described, recording, configuration, progress)


def compare_recordings(
    first: Recorded, second: Recorded
) -> tuple[dict[str, Residual], tuple[str, ...]]:
    """Compare two recordings of one test, sensor by sensor and tick by tick.

    Parameters
    ----------
    first, second
        Recordings of one machine, or their paths. Both need the same period.

    Returns
    -------
    residuals : dict
        Sensor → `Residual` of the difference: its rms and noise floor (both in `unit`), and their
        ratio. A ratio of 1 is noise alone.
    differences : tuple of str
        Test conditions that differ, one line each.

    Raises
    ------
    RigtwinError
        If the periods differ or the recordings share no sensor.

    Examples
    --------
    >>> residuals, differences = rigtwin.compare_recordings(
    ...     "rig.mcap", "twin.mcap")  # doctest: +SKIP
    >>> residuals["load_cell"].ratio  # doctest: +SKIP
    """
    first, second = resolve_recording(first), resolve_recording(second)
    return find_differences(machine_of(first), first, second), differences(first, second)
