"""What recordings say: diagnoses, comparisons, calibrations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rigtwin.api.describing import describe, is_model, record_log
from rigtwin.api.machines import (
    Effects,
    Settings,
    described_machine,
    effect_texts,
    machine_of,
    names_of,
    require_unrecorded,
    twin_of,
)
from rigtwin.api.recordings import the_recording
from rigtwin.components import RigPlant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.change import Changes
from rigtwin.diagnosis.changes import find_changes
from rigtwin.diagnosis.compare import Comparison, differences
from rigtwin.diagnosis.compare import compare as compare_with_twin
from rigtwin.diagnosis.compare import compare_recordings as find_differences
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.diagnose import diagnose as find_reasons
from rigtwin.diagnosis.first_look import FirstLook as FirstLook
from rigtwin.diagnosis.residual import Residual
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader
from rigtwin.simulation.experiment import find_experiment
from rigtwin.studies.friction_spikes import Calibration, find_compensator

Recorded = reader.Recording | str | Path
"""A recording, or the path of one."""


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
) -> Diagnosis:
    """Says why recordings of one machine and its twin disagree.

    Parameters
    ----------
    recordings
        One, or several that are explained together; or their paths. Logs of other programs where
        `machine` is a model.
    machine
        That they are of; by default the one that they name. An MJCF or URDF is described from the
        first log, see `describe`; what was assumed is in the notes of the answer.
    held_out
        Recordings of the same machine that the correction is judged on and not fitted to.
    settings
        Changes of the twin that they are compared with: of its plant and `timing.timestep`.
    without
        Effects that are taken out of the twin first, such as "coulomb@rail".
    exclude
        Effects that are not searched for, such as "delay@motor", or "delay" at every component.
    progress
        Called with a stage's name and the steps done in it.
    first_look
        Called after a second or two with what the gap is and which effects may be behind it, while
        the judgement goes on.
    columns, test
        What a log does not state, see `describe`; for a machine that is a model.

    Returns
    -------
    The verdict, the effects with confidence, where the gap lies, and how far it shrinks. In a
    notebook it shows its report.

    Raises
    ------
    RigtwinError
        If the recordings' settings are unknown, or held-out data are not fit to be compared.
    """
    given = read_inputs(recordings, machine, held_out, columns, test)
    found = given.machine.excluding(names_of("exclude", exclude))
    require_unrecorded(settings, found, [*given.recordings, *given.held_out])
    base = twin_of(found, settings, without)
    tests = [find_experiment(found, name) for name in found.next_tests]
    return find_reasons(
        found,
        given.recordings,
        base,
        given.held_out,
        tests,
        progress=progress,
        first_look=first_look,
    )


@dataclass(frozen=True)
class Given:
    """Recordings of one machine.

    Attributes
    ----------
    machine : Machine
        Machine they belong to.
    recordings, held_out : tuple of Recording
        Recordings to fit, and recordings to judge on.
    """

    machine: Machine
    recordings: tuple[reader.Recording, ...]
    held_out: tuple[reader.Recording, ...]


def read_inputs(
    recordings: Recorded | Sequence[Recorded],
    machine: Machine | str | Path | None,
    held_out: Recorded | Sequence[Recorded],
    columns: Mapping[str, str] | None,
    test: str,
) -> Given:
    """Read recordings, or logs of a machine that is a model, see `diagnose`.

    Raises
    ------
    RigtwinError
        For no recording, one named twice, or a machine that cannot be told.
    """
    if is_model(machine):
        logs = _logs(recordings)
        if not logs:
            raise RigtwinError("no recording to diagnose")
        described = describe(machine, logs[0], columns=columns, test=test)  # type: ignore[arg-type]
        recordings = [record_log(described, log) for log in logs]
        held_out = [record_log(described, log) for log in _logs(held_out)]
        machine = described.machine
    elif columns or test:
        raise RigtwinError("columns and test describe a log; expected a model as the machine")
    several = list(_several(recordings))
    apart = list(_several(held_out))
    paths = [each.path.resolve() for each in (*several, *apart) if each.path.exists()]
    if len(set(paths)) < len(paths) or not several:
        raise RigtwinError(
            "a recording is named twice; each counts once, and what is held out must not be fitted"
            if several
            else "no recording to diagnose"
        )
    found = described_machine(several[0], machine)
    return Given(found, tuple(several), tuple(apart))


def what_changed(
    recordings: Sequence[Recorded],
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    without: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
) -> Changes:
    """Says what changed between recordings of one machine, and what that goes with.

    Parameters
    ----------
    recordings
        Two or more, in the order of time.
    machine
        That they are of; by default the one that they name.
    settings
        Changes of the twin that they are compared with: of its plant and `timing.timestep`.
    without
        Effects that are taken out of the twin first, such as "coulomb@rail".
    exclude
        Effects that are not searched for, such as "delay@motor", or "delay" at every component.
    progress
        Called with a stage's name and the steps done in it.

    Returns
    -------
    Every parameter in every recording, which are not the same, and of which these cannot tell.

    Raises
    ------
    RigtwinError
        For fewer than two recordings, one named twice, or data that cannot be diagnosed.
    """
    several = list(_several(recordings))
    paths = [each.path.resolve() for each in several if each.path.exists()]
    if len(set(paths)) < len(paths):
        raise RigtwinError("a recording is named twice; it is the same as itself")
    if not several:
        raise RigtwinError("what changed is a question to two recordings or more; none was given")
    found = described_machine(several[0], machine).excluding(names_of("exclude", exclude))
    require_unrecorded(settings, found, several)
    return find_changes(found, several, twin_of(found, settings, without), progress)


def compare(
    recording: Recorded,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    effects: Effects = (),
    progress: Callable[[str], object] = lambda _replay: None,
) -> Comparison:
    """What a recording and a twin differ by: replay by replay of the suspension rig's components,
    signal by signal of another machine.

    Parameters
    ----------
    recording
        The data.
    machine
        That it is compared with; by default the one that it names.
    settings
        Changes of the twin: of its plant and `timing.timestep`.
    effects
        That the twin is given.
    progress
        Called with each replay's name.

    Raises
    ------
    RigtwinError
        Naming every fault of the data that makes a comparison meaningless.
    """
    recording = the_recording(recording)
    found = described_machine(recording, machine)
    require_unrecorded(settings, found, [recording])
    base = twin_of(found, settings, (), effect_texts(effects))
    return compare_with_twin(found, recording, found.configuration_of(recording, base), progress)


def compare_recordings(
    first: Recorded, second: Recorded
) -> tuple[dict[str, Residual], tuple[str, ...]]:
    """Two recordings of one test, sensor by sensor.

    Parameters
    ----------
    first, second
        Of one machine.

    Returns
    -------
    What they differ by, by sensor; and what was not the same in the tests, a line each.

    Raises
    ------
    RigtwinError
        If their periods differ or they share no sensor.
    """
    first, second = the_recording(first), the_recording(second)
    return find_differences(machine_of(first), first, second), differences(first, second)


def calibrate(recording: Recorded) -> Calibration:
    """The friction compensator's settings that a recording of the suspension rig asks for.

    Parameters
    ----------
    recording
        Made without compensation, that reverses often, such as `friction-road`.

    Raises
    ------
    RigtwinError
        If the data are unfit, or a compensator found from them would do harm.
    """
    recording = the_recording(recording)
    of = machine_of(recording)
    if not isinstance(of.plant, RigPlant):
        raise RigtwinError(
            f"{recording.path}: it is of machine {of.name!r}; expected a suspension rig"
        )
    configuration = of.configuration_of(recording)
    require_fit(of, recording, configuration)
    found = find_compensator(recording, configuration.controller)
    if found.detected < 0.8 * found.reversals or found.false > 0.1 * found.reversals:
        raise RigtwinError(
            f"{recording.path}: a compensator found from it would do harm; record a test that "
            "reverses often, such as friction-road, without compensation"
        )
    return found


def _logs(given: Recorded | Sequence[Recorded]) -> list[Recorded]:
    """Logs, or recordings, as a list."""
    if isinstance(given, Sequence) and not isinstance(given, str):
        return list(given)
    return [given]


def _several(given: Recorded | Sequence[Recorded]) -> Iterator[reader.Recording]:
    several = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    for each in several:
        yield the_recording(each)
