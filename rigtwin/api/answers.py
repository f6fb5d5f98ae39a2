"""Questions about recordings: diagnosis, changes, calibration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rigtwin.api.diagnosis_data import Recorded, as_list, has_duplicate, read_data
from rigtwin.api.machines import described_machine, machine_of
from rigtwin.api.other_answers import reinterpret_logs
from rigtwin.api.recordings import resolve_recording
from rigtwin.api.twin import Settings, names_of, require_unrecorded, twin_of
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.change import Changes
from rigtwin.diagnosis.changes import find_changes
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.diagnose import diagnose as diagnose_machine
from rigtwin.diagnosis.first_look import FirstLook as FirstLook
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.thresholds import STANDARD
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import find_experiment
from rigtwin.studies.friction_spikes import Calibration

LEAST_DETECTED, MOST_FALSE = 0.8, 0.1
"""Least share of reversals that a friction compensator detects, and most false steps per reversal,
on the recording it was identified from."""


def diagnose(
    recordings: Recorded | Sequence[Recorded],
    *,
    machine: Machine | str | Path | None = None,
    held_out: Recorded | Sequence[Recorded] = (),
    settings: Settings = (),
    without: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
    first_look: Callable[[FirstLook], object] = lambda _: None,
    columns: Mapping[str, str] | None = None,
    test: str = "",
    effort: float = STANDARD.effort,
) -> Diagnosis:
    """Diagnose why recordings of one machine disagree with its twin.

    Every effect that the machine can have is fitted, with all toleranced parameters free beside
    it. Hypotheses are compared by cross-validation, and the answer states how far the gap shrinks
    on data that were not fitted.

    Parameters
    ----------
    recordings
        Recording, or several of one machine that are explained jointly, or their paths. If
        `machine` is a model, these are logs of other programs: their paths, pandas DataFrames, or
        dictionaries of name → array.
    machine
        Machine the recordings belong to, or its name, or the path of its description. Defaults to
        the one named in the first recording. A model (MJCF or URDF) is described from the first
        log, see `describe`; the answer's notes state the assumptions.
    held_out
        Recordings of the same machine on which the correction is judged. They are not fitted.
    settings
        Changes of the twin before the comparison: of its plant and `timing.timestep`. All other
        settings are the recording's own.
    without
        Effects of the nominal machine that are removed from the twin first, such as
        "coulomb@rail".
    exclude
        Effects that are not searched for: "delay@motor", or "delay" at every component.
    progress
        Function called with the name of a stage and the number of steps since its last call.
    first_look
        Function called after a second or two with a `FirstLook`: the gap of each sensor and the
        effects that may cause it. The diagnosis continues meanwhile. It is called once for each
        joint of a machine whose joints do not act on each other.
    columns, test
        Column assignments and kind of test, as for `describe`. They require a model as the machine.
    effort
        Processor time after which the search tries no further hypothesis, s. It is estimated from
        the integration steps, so that the answer does not depend on the computer.

    Returns
    -------
    Diagnosis
        Answer: ``verdict`` ("no gap", "explained", "partly explained", "unknown" or "unusable"),
        ``sentence``, ``effects`` with value, interval and confidence, ``where`` the gap lies, and
        the ``gap`` before and after the correction, in units of white noise (1 is noise alone).
        `report(path)` writes a report, `save_twin(path)` the corrected twin, and `machine` is the
        corrected machine. In a notebook it shows its report.

    Raises
    ------
    RigtwinError
        If there is no recording, a recording is given twice, the settings of a recording are
        unknown, or held-out data are unfit for a comparison.

    Examples
    --------
    >>> recording = rigtwin.run("suspension-rig", "imposed", seed=1,
    ...                         effects={"viscous@motor": 50})  # doctest: +SKIP
    >>> diagnosis = rigtwin.diagnose(recording)  # doctest: +SKIP
    >>> [str(effect.name) for effect in diagnosis.effects]  # doctest: +SKIP
    ['viscous@motor']
    """
    if not effort > 0.0:
        raise RigtwinError(f"effort must be positive, not {effort:g} s")
    data = read_data(recordings, machine, held_out, columns, test)
    # Excluded effects leave the machine itself, so that no later step can propose them again.
    described = data.machine.excluding(names_of("exclude", exclude))
    require_unrecorded(settings, described, [*data.recordings, *data.held_out])
    base = twin_of(described, settings, without)
    tests = [find_experiment(described, name) for name in described.next_tests]
    thresholds = replace(STANDARD, effort=effort)
    diagnosis = diagnose_machine(
        described,
        data.recordings,
        base,
        data.held_out,
        tests,
        progress=progress,
        thresholds=thresholds,
        first_look=first_look,
    )
    # Settings and exclusions refer to components that do not exist in another kind of test.
    if settings or without or exclude:
        return diagnosis
    return reinterpret_logs(diagnosis, data, thresholds, progress)


def what_changed(
    recordings: Sequence[Recorded],
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
) -> Changes:
    """Find the parameters that changed between recordings of one machine.

    Parameters
    ----------
    recordings
        At least two recordings, or their paths, in the order of time.
    machine
        Machine the recordings belong to, or its name, or the path of its description. Defaults to
        the one named in the first recording.
    settings
        Changes of the twin before the comparison: of its plant and `timing.timestep`. All other
        settings are the recording's own.
    without
        Effects of the nominal machine that are removed from the twin first, such as
        "coulomb@rail".
    exclude
        Effects that are not searched for: "delay@motor", or "delay" at every component.
    progress
        Function called with the name of a stage and the number of steps since its last call.

    Returns
    -------
    Changes
        `sentence`, the answer in a sentence; `changed`, the parameters that differ, with their
        value in every recording; `unseen`, effects that these recordings cannot show; `zeros`,
        sensor offsets, which differ without a change of the machine.

    Raises
    ------
    RigtwinError
        For fewer than two recordings, one named twice, or data that cannot be diagnosed.

    Examples
    --------
    >>> changes = rigtwin.what_changed(["monday.mcap", "friday.mcap"])  # doctest: +SKIP
    >>> [parameter.name for parameter in changes.changed]  # doctest: +SKIP
    """
    # The order is kept: it is the order of time, in which a change is looked for.
    loaded = [resolve_recording(recording) for recording in as_list(recordings)]
    if has_duplicate(loaded):
        raise RigtwinError("a recording is named twice; expected different recordings")
    if not loaded:
        raise RigtwinError("what_changed needs at least two recordings; it has none")
    described = described_machine(loaded[0], machine).excluding(names_of("exclude", exclude))
    require_unrecorded(settings, described, loaded)
    return find_changes(described, loaded, twin_of(described, settings, without), progress)


def calibrate(recording: Recorded) -> Calibration:
    """Identify the friction compensator's settings from a recording of the suspension rig.

    Parameters
    ----------
    recording
        Recording without compensation whose motion reverses often, such as `friction-road`, or its
        path.

    Returns
    -------
    Calibration
        Settings, and their score on the recording: reversals detected, and false steps. `toml()`
        returns them as text for `--config`.

    Raises
    ------
    RigtwinError
        If the data are unfit, or the compensator misses more than a fifth of the reversals or adds
        false steps at more than a tenth of them.
    """
    recording = resolve_recording(recording)
    machine = machine_of(recording)
    configuration = machine.configuration_of(recording)
    require_fit(machine, recording, configuration)
    calibration = machine.physics.find_compensator(recording, configuration)
    # A compensator that misses reversals or steps falsely adds force errors of twice the
    # friction.
    if (
        calibration.detected < LEAST_DETECTED * calibration.reversals
        or calibration.false > MOST_FALSE * calibration.reversals
    ):
        raise RigtwinError(
            f"{recording.path}: a compensator identified from it would do harm; record a test that "
            "reverses often, such as friction-road, without compensation"
        )
    return calibration
