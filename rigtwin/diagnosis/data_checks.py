"""Faults of recorded data, which a diagnosis would take for physics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigtwin.components.sensors import sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine
from rigtwin.description.replay import Row
from rigtwin.diagnosis.dead_commands import dead_commands
from rigtwin.diagnosis.direction import runs_backwards
from rigtwin.diagnosis.unit_checks import Fault, channels, check_order, check_scale, moving_channels
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import smallest_step
from rigtwin.signals.runs import find_cut_off, longest_run

SHORTEST = 200
"""Ticks that a noise floor needs: of one recording, or of all recordings of a set together."""
SHORTEST_PART = 40
"""Ticks that each recording of a set needs, so that filters settle."""
SHORTEST_TIME = 0.5
"""Shortest recording, s: fewer than a few periods of a machine's motion cannot be judged."""
STEPS = 2
"""Integration steps per tick of the rough prediction."""
STUCK = 200
"""Equal samples in a row from which a sensor with declared noise counts as dead."""
COARSE = 20.0
"""Multiple of the declared resolution from which a sensor counts as coarse."""
OUTLIER = 100.0
"""Multiple of a signal's usual range from which a sample counts as damaged."""
PLAUSIBLE = 1e9
"""Largest plausible value, in SI units."""


def find_faults(
    machine: Machine,
    recording: RecordedTest,
    configuration: Configuration,
    least: int = SHORTEST,
) -> tuple[Fault, ...]:
    """Find all faults of a recording.

    Parameters
    ----------
    machine
        Machine the recording should belong to.
    recording
        Data to check.
    configuration
        Settings of the twin, see `Machine.configuration_of`.
    least
        Ticks that the recording must have. Fewer suffice in a set, see `least_ticks`.

    Returns
    -------
    tuple of Fault
        Faults, the gravest first. Later checks are skipped where earlier faults make them
        meaningless.
    """
    # Every check relies on the earlier ones: a missing channel cannot be read, a single NaN spoils
    # all statistics, and a model driven by a dead command predicts nothing to compare with.
    faults = [*_check_presence(machine, recording, least)]
    if not faults:
        faults += _check_values(machine, recording)
    if not faults:
        predicted = machine.physics.model(machine, recording.inputs, configuration, STEPS).predict(
            configuration.plant
        )
        faults += _check_alive(machine, recording, predicted)
        if not any(fault.fatal for fault in faults):
            faults += check_order(machine, recording, predicted)
        if not any(fault.fatal for fault in faults):
            faults += _check_inputs(machine, recording, configuration, predicted)
        if not any(fault.fatal for fault in faults):
            faults += check_scale(machine, recording, predicted)
    return tuple(sorted(faults, key=lambda fault: not fault.fatal))


def require_fit(
    machine: Machine,
    recording: RecordedTest,
    configuration: Configuration,
    least: int = SHORTEST,
) -> tuple[Fault, ...]:
    """Return the faults that allow a comparison. Raise RigtwinError that names all fatal ones."""
    faults = find_faults(machine, recording, configuration, least)
    if fatal := [fault.message for fault in faults if fault.fatal]:
        raise RigtwinError(f"{recording.path}: {'; '.join(fatal)}")
    return faults


def _check_presence(machine: Machine, recording: RecordedTest, least: int) -> Iterator[Fault]:
    if recording.machine != machine.name:
        yield Fault(
            "wrong machine",
            "recording",
            f"it is of machine {recording.machine!r}; this twin is {machine.name!r}",
        )
    observed = any(row.kind == "command" for row in machine.rows)
    if OWN in recording.controller and observed:
        message = "its controller was not the described one, whose command is what is observed"
        yield Fault("other controller", "recording", message)
        return
    for topic, name in channels(machine):
        if not recording.has(topic, name):
            recorded = ", ".join(
                f"{t}.{n}" for t, fields in recording.columns.items() for n in fields
            )
            yield Fault(
                "missing",
                f"{topic}.{name}",
                f"channel {topic}.{name} is missing; it has {recorded}",
            )
    lasts = recording.ticks * recording.period
    if recording.ticks < least:
        yield Fault(
            "too short",
            "recording",
            f"it has {recording.ticks} ticks; a comparison needs at least {least}",
        )
    elif lasts < SHORTEST_TIME:
        message = (
            f"it lasts {lasts:.3g} s; a comparison needs at least "
            f"{SHORTEST_TIME:g} s (is the time's unit right?)"
        )
        yield Fault("too short", "recording", message)


def _check_values(machine: Machine, recording: RecordedTest) -> Iterator[Fault]:
    steps = np.diff(recording.time)
    # Half a period tells the jitter of a clock from a lost tick.
    gaps = np.nonzero(np.abs(steps - recording.period) > 0.5 * recording.period)[0]
    if len(gaps):
        first = gaps[0]
        message = (
            f"{len(gaps)} gaps in time, the first of {steps[first]:.4g} "
            f"s at {recording.time[first]:.3f} s"
        )
        yield Fault("gap", "recording", message)
    for topic, name in channels(machine):
        signal, where = recording.column(topic, name), f"{topic}.{name}"
        wrong = ~np.isfinite(signal)
        if wrong.any():
            yield Fault(
                "not a number",
                where,
                f"{where} is not a number at {recording.time[np.argmax(wrong)]:.3f} s",
            )
            continue
        # Quantiles, because the damaged samples would inflate a standard deviation until they look
        # usual.
        spread = float(np.subtract(*np.quantile(signal, [0.999, 0.001])))
        away = np.abs(signal - float(np.median(signal)))
        at = int(np.argmax(away))
        if (spread > 0.0 and away[at] > OUTLIER * spread) or abs(signal[at]) > PLAUSIBLE:
            when = f"{signal[at]:.4g} at {recording.time[at]:.3f} s"
            yield Fault(
                "implausible", where, f"{where} is {when}, far outside of all else ({spread:.3g})"
            )


def _check_alive(machine: Machine, recording: RecordedTest, predicted: Array) -> Iterator[Fault]:
    if not any(np.ptp(recording.column(*channel)) for channel in channels(machine)):
        yield Fault("dead", "recording", "no channel changes throughout: nothing was recorded")
        return
    still = {
        row.name
        for row, model in zip(machine.rows, predicted, strict=True)
        if _is_at_rest(machine, row, model)
    }
    for name, component in machine.components.items():
        if component.channel is None or not recording.has(*component.channel):
            continue
        where, signal = ".".join(component.channel), recording.column(*component.channel)
        if component.element != "sensor" and name not in moving_channels(machine):
            continue
        first, length = longest_run(signal, np.ones(len(signal), bool))
        if length == len(signal):
            if name not in still and component.element == "sensor":
                yield Fault(
                    "dead",
                    where,
                    f"{where} does not change throughout: a dead or disconnected channel",
                )
            continue
        if component.element != "sensor":
            continue
        bit = _declared_resolution(machine, name)
        # A sensor that resolves its declared bit shows noise all the time. A coarser one may
        # rightly repeat a value, for example while the machine rests.
        if bit > 0.0 and length >= STUCK and smallest_step(signal) <= COARSE * bit:
            since = f"for {length * recording.period:.3g} s from {recording.time[first]:.3f} s"
            yield Fault(
                "dead", where, f"{where} does not change {since}: a dead or disconnected sensor"
            )
            continue
        yield from _check_clipping(where, signal)


def _is_at_rest(machine: Machine, row: Row, predicted: Array) -> bool:
    """Return whether a signal should stand still, because no command changes."""
    return float(np.ptp(predicted)) <= _declared_resolution(machine, row.name)


def _declared_resolution(machine: Machine, name: str) -> float:
    """Return the declared resolution of a sensor in its unit; 0 for a controller's command."""
    component = machine.components.get(name)
    if component is None or not component.quantity:
        return 0.0
    return sensor_of(machine.plant, name).resolution


def _check_clipping(where: str, signal: Array) -> Iterator[Fault]:
    at_end = find_cut_off(signal)
    for end, extreme in (("above", signal.max()), ("below", signal.min())):
        share = 100 * float(np.mean(at_end & (signal == extreme)))
        if share > 0.0:
            message = f"{where} is cut off {end} {extreme:.4g} ({share:.2g} % of the ticks)"
            yield Fault("clipped", where, message, fatal=False)


def _check_inputs(
    machine: Machine, recording: RecordedTest, configuration: Configuration, predicted: Array
) -> Iterator[Fault]:
    dead = dead_commands(machine, recording, configuration)
    for where, moved in dead.items():
        message = f"{where} does not change throughout, but {moved}: a dead or disconnected channel"
        yield Fault("dead", where, message)
    if not dead and runs_backwards(machine, recording, configuration, predicted):
        message = "its time runs backwards: from its end, the machine goes as it should"
        yield Fault("backwards", "recording", message)
