"""Is a recording of a described machine fit to be diagnosed? Faults of the data, before anybody takes them for physics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigtwin.diagnosis.checks import SHORTEST, Fault, check, gaps
from rigtwin.diagnosis.evidence import cut_off
from rigtwin.machine.configuration import Configuration
from rigtwin.machine.machine import Machine
from rigtwin.models.replaying import Setup, predictor
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms, white_noise

SHORTEST_TIME = 0.5
"""s."""
STEPS = 2
"""Of integration a tick, for a rough prediction."""
ALIKE = 0.8
"""How well a signal goes with what is expected of it, from which its sign and unit can be told."""
MOVES = 10.0
"""A signal this many times its noise says what its scale is."""
OUTLIER = 100.0
"""Times the range of nearly all of a signal at which a sample is damage."""
CLOSE = 0.15
"""How close a ratio must be to that of two units."""
UNITS = {
    "m": ((1e3, "mm"), (1e2, "cm"), (1e6, "um")),
    "rad": ((57.2958, "degrees"),),
    "m/s": ((1e3, "mm/s"),),
    "N": ((1e-3, "kN"),),
}
"""SI unit → (how many of another make one, its name)."""


def faults_of(machine: Machine, recording: Recording, setup: Configuration | Setup) -> tuple[Fault, ...]:
    """All faults found, the gravest first. Later checks are left out where earlier ones make them meaningless."""
    if isinstance(setup, Configuration):
        return check(recording, setup)
    found: list[Fault] = []
    for stage in (_presence, _values, _scale):
        found += stage(machine, recording, setup)
        if any(fault.fatal for fault in found):
            break
    return tuple(sorted(found, key=lambda fault: not fault.fatal))


def channels(machine: Machine) -> list[tuple[str, str]]:
    """(topic, field) of everything that the machine's replays need, in order."""
    found = []
    for replay in machine.replays:
        mover = machine.components[replay.moved_by[0]].channel
        if mover is not None and not replay.closed:
            found.append(mover)
        if replay.closed and machine.control is not None:
            found += machine.control.inputs.values()
            found.append(("/command", machine.control.output))
        found += [row.channel for row in replay.rows]
    return list(dict.fromkeys(found))


def _presence(machine: Machine, recording: Recording, _setup: Setup) -> Iterator[Fault]:
    if recording.machine != machine.name:
        yield Fault("wrong machine", "recording", f"it is of machine {recording.machine!r}; this twin is {machine.name!r}")
    for topic, name in channels(machine):
        if not recording.has(topic, name):
            there = ", ".join(f"{t}.{n}" for t, fields in recording.columns.items() for n in fields)
            yield Fault("missing", f"{topic}.{name}", f"channel {topic}.{name} is missing; it has {there}")
    if recording.ticks < SHORTEST:
        yield Fault("too short", "recording", f"it has {recording.ticks} ticks; a comparison needs at least {SHORTEST}")


def _lasts(recording: Recording) -> Iterator[Fault]:
    """A test of less than a few periods of anything that a machine does says nothing."""
    if recording.ticks * recording.period < SHORTEST_TIME:
        lasts = recording.ticks * recording.period
        yield Fault(
            "too short",
            "recording",
            f"it lasts {lasts:.3g} s; a comparison needs at least {SHORTEST_TIME:g} s (is the time's unit right?)",
        )


def _values(machine: Machine, recording: Recording, _setup: Setup) -> Iterator[Fault]:
    yield from _lasts(recording)
    yield from gaps(recording)
    moving = [machine.components[replay.moved_by[0]].channel for replay in machine.replays]
    for topic, name in channels(machine):
        signal, where = recording.column(topic, name), f"{topic}.{name}"
        wrong = ~np.isfinite(signal)
        if wrong.any():
            yield Fault("not a number", where, f"{where} is not a number at {recording.time[np.argmax(wrong)]:.3f} s")
            continue
        spread = float(np.subtract(*np.quantile(signal, [0.999, 0.001])))
        middle = float(np.median(signal))
        if spread > 0.0 and float(np.max(np.abs(signal - middle))) > OUTLIER * spread:
            at = int(np.argmax(np.abs(signal - middle)))
            when = recording.time[at]
            yield Fault(
                "implausible", where, f"{where} is {signal[at]:.4g} at {when:.3f} s, far outside of all else ({spread:.3g})"
            )
            continue
        if np.ptp(signal) == 0.0 and ((topic, name) in moving or topic == "/sensor"):
            yield Fault("dead", where, f"{where} does not change throughout: a dead or disconnected channel")
        elif topic == "/sensor" and (cut := cut_off(signal)).any():
            yield Fault("clipped", where, f"{where} is cut off ({100 * cut.mean():.2g} % of the ticks)", fatal=False)


def _scale(machine: Machine, recording: Recording, setup: Setup) -> Iterator[Fault]:
    """Signs and units, by how a signal goes with what the nominal machine would show."""
    predicted = predictor(machine, recording, setup, STEPS).sensed(machine.plant)
    for row, model in zip(machine.rows, predicted, strict=True):
        signal = recording.column(*row.channel)
        a, b = signal - signal.mean(), model - model.mean()
        if rms(b) == 0.0 or rms(a) < MOVES * white_noise(signal) or not np.isfinite(b).all():
            continue
        alike = float(a @ b) / float(np.sqrt((a @ a) * (b @ b)))
        where = f"{row.channel[0]}.{row.channel[1]}"
        if alike < -ALIKE:
            yield Fault("sign", where, f"{where} has the wrong sign: it goes against what the description predicts")
        slope = float(a @ b / (b @ b))
        for factor, unit in UNITS.get(row.unit, ()):
            if alike > ALIKE and abs(slope / factor - 1.0) < CLOSE:
                yield Fault(
                    "unit", where, f"{where} is {slope:.4g} times what is predicted, as if in {unit}; expected {row.unit}"
                )
