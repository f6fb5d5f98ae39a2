"""Comparison of a recording with the twin, replay by replay, or with another recording of the same
test."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.contacts import find_contacts
from rigtwin.diagnosis.copies import digest
from rigtwin.diagnosis.data_checks import SHORTEST, require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.residual import Residual, compute_residual
from rigtwin.diagnosis.shrinkage import gap_level
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import remove_mains, white_noise

STILL = 0.1
"""Share of its noise floor below which a signal does not change."""
NOTHING = 1e-30
"""SI units; no sensor reads so little."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of a recording with the twin.

    Attributes
    ----------
    replays
        Name of the replay → its residual.
    left_out
        Name of a replay that is impossible → reason in words.
    notes
        Remarks on the recording, one line each.
    gap
        rms residual of all signals, in units of their white noise; 1 is noise alone.
    """

    replays: dict[str, Residual]
    left_out: dict[str, str]
    notes: tuple[str, ...]
    gap: float


def compare(
    machine: Machine,
    recording: RecordedTest,
    configuration: Configuration | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> Comparison:
    """Compare a recording with the twin.

    Parameters
    ----------
    machine
        Machine the recording belongs to.
    recording
        Recording that is compared.
    configuration
        Configuration of the twin. Defaults to `Machine.configuration_of` the recording.
    progress
        Called with the name of each replay.

    Returns
    -------
    Comparison
        Residual of each replay, and the replays that are impossible.

    Raises
    ------
    RigtwinError
        If the data have faults that forbid a comparison. The message names all of them.
    """
    configuration = configuration or machine.configuration_of(recording)
    faults = require_fit(machine, recording, configuration)
    messages = [fault.message for fault in faults]
    notes = (*recording.notes, *messages, *find_contacts(machine, recording))
    evidence = Evidence(machine, [recording], [configuration])
    notes = (*notes, *_still_signals(evidence))
    gap = gap_level(evidence, configuration.plant)
    replays, left_out = machine.physics.residuals(evidence, progress)
    return Comparison(replays, left_out, notes, gap)


def _still_signals(evidence: Evidence) -> list[str]:
    """Notes on signals that neither change nor should, whose ratio says nothing.

    Raises
    ------
    RigtwinError
        If no signal of the first recording changes.
    """
    lines, predicted = evidence.lines[0], evidence.predict(evidence.plant)[0]
    still = [
        row.name
        for n, row in enumerate(evidence.machine.rows)
        # A signal that should move and does not is a finding. Only one that is still in both is
        # none.
        if max(np.std(lines.measured[n]), np.std(predicted[n])) < STILL * float(lines.noise[n])
        or np.ptp(evidence.recordings[0].column(*row.channel)) < NOTHING
    ]
    if len(still) == len(evidence.machine.rows):
        raise RigtwinError(
            f"{evidence.recordings[0].path}: there is no signal to compare: {', '.join(still)} "
            "stand still; expected a test that moves the machine"
        )
    return [f"{name}: there is no signal to compare, its ratio says nothing" for name in still]


def signal_residuals(evidence: Evidence) -> dict[str, Residual]:
    """Return the residual of each signal of the first recording.

    Parameters
    ----------
    evidence
        Recordings about their nominal plant.

    Returns
    -------
    dict
        Name of the signal → its residual.
    """
    lines, period = evidence.lines[0], evidence.recordings[0].period
    difference = lines.measured - evidence.predict(evidence.plant)[0]
    return {
        row.name: compute_residual(
            difference[n][lines.counts[n]], float(lines.noise[n]), row.unit, period
        )
        for n, row in enumerate(evidence.machine.rows)
    }


def differences(first: RecordedTest, second: RecordedTest) -> tuple[str, ...]:
    """Return the test conditions that differ between two recordings.

    Parameters
    ----------
    first, second
        Recordings of two tests.

    Returns
    -------
    tuple of str
        One line for each difference; empty if the conditions are the same.
    """
    notes = []
    if digest(first) == digest(second):
        notes.append("both hold the same data, so no difference says anything")
    # Notes do not stop the comparison: two unlike tests may be compared on purpose.
    if first.experiment != second.experiment:
        notes.append(f"different experiments: {first.experiment} and {second.experiment}")
    settings = {*first.controller, *second.controller}
    unlike = sorted(
        key for key in settings if first.controller.get(key) != second.controller.get(key)
    )
    if unlike:
        notes.append(f"different controller settings: {', '.join(unlike)}")
    ticks = min(first.ticks, second.ticks)
    if first.has("/command", "ground") and second.has("/command", "ground"):
        deviation = (
            first.column("/command", "ground")[:ticks] - second.column("/command", "ground")[:ticks]
        )
        # Commands are the same up to the rounding of a file; a micrometre is far above that.
        if np.max(np.abs(deviation)) > 1e-6:
            notes.append("different ground motions were commanded")
    if str(first.controller.get("mode")) == "mil":
        notes.append(
            "with a model in the loop a limit cycle drifts in "
            "phase, so two runs of one rig differ too"
        )
    return tuple(notes)


def compare_recordings(
    machine: Machine, first: RecordedTest, second: RecordedTest
) -> dict[str, Residual]:
    """Compare two recordings of one test, sensor by sensor over their common length.

    Parameters
    ----------
    machine
        Machine both recordings belong to.
    first, second
        Recordings that are compared.

    Returns
    -------
    dict
        Name of the sensor → its residual. The noise floor combines the noise of both recordings.

    Raises
    ------
    RigtwinError
        If a recording belongs to another machine, the periods differ, the common length is too
        short, or no sensor is in both.
    """
    _require_comparable(machine, first, second)
    ticks = min(first.ticks, second.ticks)
    results: dict[str, Residual] = {}
    still: list[str] = []
    sensors = [
        component
        for component in machine.components.values()
        if component.channel is not None and component.element == "sensor"
    ]
    for sensor in sensors:
        topic, name = sensor.channel or ("", "")
        if first.has(topic, name) and second.has(topic, name):
            before, after = first.column(topic, name)[:ticks], second.column(topic, name)[:ticks]
            if not (np.isfinite(before).all() and np.isfinite(after).all()):
                raise RigtwinError(
                    f"{topic}.{name} is not a number somewhere in {first.path} or {second.path}"
                )
            # The mains has another phase in every recording, so its line is in the difference even
            # where the machine is the same.
            difference = remove_mains(before - after, first.period, machine.plant.mains.frequency)
            if np.ptp(before) == 0.0 and np.ptp(after) == 0.0:
                still.append(sensor.name)
            results[sensor.name] = compute_residual(
                difference,
                # Independent noises of two recordings add in power.
                math.hypot(white_noise(before), white_noise(after)),
                sensor.unit,
                first.period,
            )
    if not results:
        raise RigtwinError(f"{first.path} and {second.path} share no sensor")
    if len(still) == len(results):
        raise RigtwinError(
            f"{first.path} and {second.path}: there is no signal to compare: {', '.join(still)} "
            "stand still in both"
        )
    return results


def _require_comparable(machine: Machine, first: RecordedTest, second: RecordedTest) -> None:
    """Raise RigtwinError unless two recordings can be compared tick by tick."""
    for recording in (first, second):
        if recording.machine != machine.name:
            raise RigtwinError(
                f"{recording.path}: it is of machine {recording.machine!r}; "
                f"expected {machine.name!r}"
            )
    if first.period != second.period:
        raise RigtwinError(
            f"periods differ: {first.path} has {first.period:g} "
            f"s, {second.path} has {second.period:g} s"
        )
    ticks = min(first.ticks, second.ticks)
    if ticks < SHORTEST:
        raise RigtwinError(f"only {ticks} ticks in common; a comparison needs at least {SHORTEST}")
