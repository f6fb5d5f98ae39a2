"""Answers that take a log otherwise, where the first answer does not explain it.

A log may be judged as another kind of test, see `other_view`. Its rows may also hold the state
after their command, as a loop writes them that sends a command, waits and then reads the sensors.
The command of such a row acts from the row before it on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.api.describing import record_again
from rigtwin.api.diagnosis_data import DiagnosisData
from rigtwin.api.recordings import Origin, Recording
from rigtwin.describing.other_view import DRIVES, VIEWS, describe_otherwise
from rigtwin.description.implied import FORCES, INVERSE, SERVOS
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.diagnose import diagnose as diagnose_machine
from rigtwin.diagnosis.evidence import Evidence, relative_errors
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.recording import RecordedTest

EARLIER = 0.7
"""Share of the nominal twin's error that commands one row earlier must leave at most to be
tried."""
LESS = 0.8
"""Share of the first answer's residual that another one must leave at most."""
DRIVE_EFFORT = 100.0
"""Most processor time spent on the servos of a machine whose forces show no gap, s."""
PREDICTED = "the motion that the servos' commands cause shows no gap either"
UNPREDICTED = (
    "the forces are right, but the motion that the commands would cause by the model's servos is "
    "not the measured one: --test servos says why"
)
"""Notes on servos whose commands are not the reason for another answer."""
COMMANDS = "/command"
"""Topic of the commands."""
AFTER = (
    "each row is taken to hold the state after its command, as the motion needs fewer effects then"
)
"""Why the commands of a log are taken one row earlier."""


@dataclass(frozen=True)
class Attempt:
    """Logs taken otherwise.

    Attributes
    ----------
    data
        Recordings of the logs.
    least
        Share of the gap that their answer must close to be given; None where it must leave less.
    reason
        Why the logs are taken so, for a note.
    """

    data: DiagnosisData
    least: float | None
    reason: str


def reinterpret_logs(
    diagnosis: Diagnosis,
    data: DiagnosisData,
    thresholds: Thresholds,
    progress: Callable[[str, int], object],
) -> Diagnosis:
    """Return the answer to logs taken otherwise, where that explains enough.

    Parameters
    ----------
    diagnosis
        First answer, which is returned where no other one explains enough.
    data
        Recordings that were judged.
    thresholds
        Thresholds of the search.
    progress
        Called with the name of a stage and the number of steps done in it.
    """
    if diagnosis.verdict == "unusable":
        return diagnosis
    if diagnosis.verdict == "no gap":
        return _judge_drives(diagnosis, data, thresholds, progress)
    closed = _closed_share(diagnosis)
    for attempt in _attempts(data, closed):
        other = diagnose_machine(
            attempt.data.machine,
            attempt.data.recordings,
            None,
            attempt.data.held_out,
            (),
            progress=progress,
            thresholds=thresholds,
        )
        if other.verdict == "no gap" and _names_force_sensor(diagnosis, data.machine):
            continue
        if other.verdict != "unusable" and _is_better(other, diagnosis, attempt.least):
            # Of two explanations the one with fewer effects is given.
            simpler = len(other.effects) < len(diagnosis.effects)
            if simpler or closed < 1.0:
                return _with_note(other, diagnosis, attempt.reason)
    return diagnosis


def _judge_drives(
    diagnosis: Diagnosis,
    data: DiagnosisData,
    thresholds: Thresholds,
    progress: Callable[[str, int], object],
) -> Diagnosis:
    """Return what the commands of servos show where the forces along the motion show no gap."""
    logs = _logs(data)
    if not logs or logs[0].described.reading.kind.test != INVERSE:
        return diagnosis
    seen = describe_otherwise(logs[0].described, DRIVES)
    if seen is None:
        return diagnosis
    other = _record_again(seen.machine, record_again(seen, logs), data)
    # What a reference does that is no command of these servos cannot be explained, however long.
    brief = replace(thresholds, effort=min(thresholds.effort, DRIVE_EFFORT))
    drives = diagnose_machine(
        other.machine,
        other.recordings,
        None,
        other.held_out,
        (),
        progress=progress,
        thresholds=brief,
    )
    if drives.verdict == "explained":
        return _with_note(drives, diagnosis, DRIVES.reason)
    note = PREDICTED if drives.verdict == "no gap" else UNPREDICTED
    answer = replace(diagnosis.answer, notes=(note, *diagnosis.answer.notes))
    return replace(diagnosis, answer=answer)


def _logs(data: DiagnosisData) -> list[Origin]:
    """Return the logs that the recordings of some data were made of, none if any is no log."""
    recordings = (*data.recordings, *data.held_out)
    origins = [recording.origin for recording in recordings if isinstance(recording, Recording)]
    logs = [origin for origin in origins if origin is not None]
    return logs if len(logs) == len(recordings) else []


def _closed_share(diagnosis: Diagnosis) -> float:
    """Return the share of the gap that an answer closes, 1 where there is no gap to close."""
    if diagnosis.verdict not in ("unknown", "partly explained") or diagnosis.gap is None:
        return 1.0
    return diagnosis.gap.shrinkage_held_out.value if diagnosis.effects else 0.0


def _is_better(other: Diagnosis, first: Diagnosis, least: float | None) -> bool:
    """Return whether another answer may take the place of the first one.

    `least` is that of the attempt.
    """
    if least is None:
        residuals = [each.answer.steps[-1].residual for each in (first, other)]
        left, left_otherwise = (sum(value**2 for value in each.values()) for each in residuals)
        return left_otherwise < LESS**2 * left
    # Of two answers that leave a part of the gap, the one that closes more of it is given.
    closed = _closed_share(first)
    return _closed_share(other) >= (least if closed == 1.0 else max(least, closed))


def _names_force_sensor(diagnosis: Diagnosis, machine: Machine) -> bool:
    """Return whether an answer names an effect of a force sensor, which only forces can show."""
    sensors = {name for name, part in machine.components.items() if part.quantity == "force"}
    return any(finding.name.component in sensors for finding in diagnosis.effects)


def _attempts(data: DiagnosisData, closed: float) -> Iterator[Attempt]:
    """Yield the ways to take logs otherwise, of which an answer closes a share of the gap."""
    logs = _logs(data)
    if not logs:
        return
    described = logs[0].described
    if described.reading.kind.test in (FORCES, SERVOS) and (early := _with_commands_earlier(data)):
        yield Attempt(early, 1.0, AFTER)
    for view in VIEWS.get(described.reading.kind.test, ()):
        if closed >= view.below or (seen := describe_otherwise(described, view)) is None:
            continue
        yield Attempt(
            _record_again(seen.machine, record_again(seen, logs), data), view.least, view.reason
        )


def _record_again(
    machine: Machine, recordings: Sequence[RecordedTest], data: DiagnosisData
) -> DiagnosisData:
    """Return recordings in the place of those of some data, in the same order."""
    count = len(data.recordings)
    return DiagnosisData(machine, tuple(recordings[:count]), tuple(recordings[count:]))


def _with_commands_earlier(data: DiagnosisData) -> DiagnosisData | None:
    """Return recordings whose commands act one row earlier; None where that predicts no better."""
    commands = [c for each in data.recordings for c in each.columns.get(COMMANDS, {}).values()]
    if not any(np.ptp(command) > 0.0 for command in commands):
        return None
    recordings = [_advance(recording) for recording in (*data.recordings, *data.held_out)]
    early = _record_again(data.machine, recordings, data)
    is_better = _nominal_error(early) < EARLIER * _nominal_error(data)
    return early if is_better else None


def _advance(recording: RecordedTest) -> RecordedTest:
    """Return a recording whose commands act one row earlier."""
    columns = dict(recording.columns)
    columns[COMMANDS] = {
        name: np.append(values[1:], values[-1]) for name, values in columns[COMMANDS].items()
    }
    return replace(recording, columns=columns)


def _nominal_error(data: DiagnosisData) -> float:
    """Return the relative error with which the nominal twin predicts the recordings to fit."""
    machine, recordings = data.machine, data.recordings
    configurations = [machine.configuration_of(recording) for recording in recordings]
    evidence = Evidence(machine, recordings, configurations)
    return float(np.sqrt(np.mean(relative_errors(evidence, evidence.plant) ** 2)))


def _with_note(diagnosis: Diagnosis, before: Diagnosis, reason: str) -> Diagnosis:
    """Return an answer with a note on the way in which a log is taken."""
    after = diagnosis.answer
    note = f"{reason}; otherwise the answer would be {before.verdict!r}"
    seconds = before.answer.seconds + after.seconds
    return replace(diagnosis, answer=replace(after, notes=(note, *after.notes), seconds=seconds))
