"""The first look at a gap: a recording against the twin, replay by replay, or against another
recording of the same test."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.contacts import find_contacts
from rigtwin.diagnosis.copies import digest
from rigtwin.diagnosis.cross_validation import gap_level
from rigtwin.diagnosis.data_checks import SHORTEST, require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.residual import Residual, compute_residual
from rigtwin.errors import RigtwinError
from rigtwin.recording import Recording
from rigtwin.signals.noise import remove_mains, white_noise

STILL = 0.1
"""Share of its noise floor below which a signal does not change."""
NOTHING = 1e-30
"""SI units; no sensor reads so little."""


@dataclass(frozen=True)
class Comparison:
    """What each replay of a recording leaves, by its name, and what could not be replayed and why.
    gap: rms of all signals less what the twin predicts of them, in units of their white noise; 1 is
    noise alone."""

    replays: dict[str, Residual]
    left_out: dict[str, str]
    notes: tuple[str, ...]
    gap: float


def compare(
    machine: Machine,
    recording: Recording,
    configuration: Configuration | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> Comparison:
    """A recording against the twin.

    Parameters
    ----------
    machine
        That the recording is of.
    recording
        The data.
    configuration
        Of the twin, see `Machine.configuration_of`; by default that of the description.
    progress
        Called with each replay's name.

    Returns
    -------
    Comparison
        What each replay leaves, and what could not be replayed.

    Raises
    ------
    RigtwinError
        Naming every fault of the data that makes a comparison meaningless.
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
    """What each signal of the first recording has left.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.

    Returns
    -------
    dict
        Name of the signal → its residual.
    """
    lines, period = evidence.lines[0], evidence.recordings[0].period
    difference = lines.measured - evidence.predict(evidence.plant)[0]
    return {
        row.name: compute_residual(
            difference[n][lines.fade[n] > 0.5], float(lines.noise[n]), row.unit, period
        )
        for n, row in enumerate(evidence.machine.rows)
    }


def differences(first: Recording, second: Recording) -> tuple[str, ...]:
    """What was not the same in two tests.

    Parameters
    ----------
    first, second
        Their recordings.

    Returns
    -------
    tuple of str
        A line each; empty if they were asked the same.
    """
    notes = []
    if digest(first) == digest(second):
        notes.append("both hold the same data, so no difference says anything")
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
        apart = (
            first.column("/command", "ground")[:ticks] - second.column("/command", "ground")[:ticks]
        )
        if np.max(np.abs(apart)) > 1e-6:
            notes.append("different ground motions were commanded")
    if str(first.controller.get("mode")) == "mil":
        notes.append(
            "with a model in the loop a limit cycle drifts in "
            "phase, so two runs of one rig differ too"
        )
    return tuple(notes)


def compare_recordings(
    machine: Machine, first: Recording, second: Recording
) -> dict[str, Residual]:
    """Two recordings of one test, sensor by sensor over their common length.

    Parameters
    ----------
    machine
        That both are of.
    first, second
        The recordings.

    Returns
    -------
    dict
        Name of the sensor → its residual, whose floor is both sensors' noise together.

    Raises
    ------
    RigtwinError
        If one is of another machine, their periods differ, they have too little in common or share
        no sensor.
    """
    for each in (first, second):
        if each.machine != machine.name:
            raise RigtwinError(
                f"{each.path}: it is of machine {each.machine!r}; expected {machine.name!r}"
            )
    if first.period != second.period:
        raise RigtwinError(
            f"periods differ: {first.path} has {first.period:g} "
            f"s, {second.path} has {second.period:g} s"
        )
    ticks = min(first.ticks, second.ticks)
    if ticks < SHORTEST:
        raise RigtwinError(f"only {ticks} ticks in common; a comparison needs at least {SHORTEST}")
    results: dict[str, Residual] = {}
    still: list[str] = []
    sensors = [
        each
        for each in machine.components.values()
        if each.channel is not None and each.element == "sensor"
    ]
    for sensor in sensors:
        topic, name = sensor.channel or ("", "")
        if first.has(topic, name) and second.has(topic, name):
            one, other = first.column(topic, name)[:ticks], second.column(topic, name)[:ticks]
            if not (np.isfinite(one).all() and np.isfinite(other).all()):
                raise RigtwinError(
                    f"{topic}.{name} is not a number somewhere in {first.path} or {second.path}"
                )
            difference = remove_mains(one - other, first.period, machine.plant.mains.frequency)
            if np.ptp(one) == 0.0 and np.ptp(other) == 0.0:
                still.append(sensor.name)
            results[sensor.name] = compute_residual(
                difference,
                math.hypot(white_noise(one), white_noise(other)),
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
