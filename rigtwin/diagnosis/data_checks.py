"""Faults of recorded data, which a diagnosis would take for physics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from rigtwin.components import Schedule
from rigtwin.components.sensors import sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine, Row
from rigtwin.diagnosis.dead_commands import dead_commands
from rigtwin.diagnosis.direction import runs_backwards
from rigtwin.diagnosis.units import spell
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import rms, smallest_step, white_noise
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
MOVES = 10.0
"""Ratio of signal to noise from which the scale of a signal is checked."""
OUTLIER = 100.0
"""Multiple of a signal's usual range from which a sample counts as damaged."""
PLAUSIBLE = 1e9
"""Largest plausible value, in SI units."""
WOUND_UP = 0.05
"""Share of ticks with a command at its limit from which the scale of its force is not checked."""
MOST_SWAPPED = 4
"""Most sensors of one unit whose exchange is tested: the permutations grow with the factorial."""
UNITS: Mapping[str, tuple[tuple[float, str], ...]] = {
    "m": ((1e3, "mm"), (1e2, "cm"), (39.37, "inch"), (1e6, "um")),
    "rad": ((57.2958, "degrees"),),
    "m/s": ((1e3, "mm/s"),),
    "N": ((1e-3, "kN"), (0.2248, "lbf"), (9.81**-1, "kgf")),
    "Nm": ((1e3, "Nmm"),),
}
"""SI unit → factor and name of the units it is often confused with."""


CORRELATED = 0.75
"""Correlation of a signal with its prediction from which its sign and unit are checked."""
SAME_UNIT, NEAR_UNIT = 0.15, 0.5
"""Differences of log(scale) and log(unit factor). Below the first the unit is wrong. Below the
second a scale that is implausible anyway is described as resembling that unit."""
EXCHANGED = 0.5
"""Share of the signals' power that their best order may leave unexplained."""


@dataclass(frozen=True)
class Fault:
    """One fault of the data.

    Attributes
    ----------
    kind : str
        Short name of the fault.
    where : str
        Channel, or the recording.
    message : str
        Description in one line.
    fatal : bool
        Whether the fault makes every comparison meaningless.
    """

    kind: str
    where: str
    message: str
    fatal: bool = True


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
            faults += _check_order(machine, recording, predicted)
        if not any(fault.fatal for fault in faults):
            faults += _check_inputs(machine, recording, configuration, predicted)
        if not any(fault.fatal for fault in faults):
            faults += _check_scale(machine, recording, predicted)
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


def channels(machine: Machine) -> list[tuple[str, str]]:
    """Return topic and field of every channel that a diagnosis of the machine reads."""
    required = []
    for replay in machine.replays:
        movers = [machine.components[name].channel for name in replay.moved_by]
        required += [channel for channel in movers if channel is not None and not replay.closed]
        required += [row.channel for row in replay.rows]
    required += [
        component.channel
        for name, component in machine.components.items()
        if component.channel is not None and component.component_type is Schedule
    ]
    if machine.control is not None:
        required += machine.control.channels
        required += [("/command", name) for name in machine.control.outputs]
    return list(dict.fromkeys(required))


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
        if component.element != "sensor" and name not in _movers(machine):
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


def _movers(machine: Machine) -> set[str]:
    """Return the channels that move the machine."""
    return {name for replay in machine.replays if not replay.closed for name in replay.moved_by}


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


def _check_order(machine: Machine, recording: RecordedTest, predicted: Array) -> Iterator[Fault]:
    """Yield exchanged channels: another order of the sensors of one unit fits far better."""
    # Sensors of different units cannot be exchanged unnoticed: their scales would be wrong.
    for unit in dict.fromkeys(row.unit for row in machine.rows if row.kind != "command"):
        rows = [
            (n, row)
            for n, row in enumerate(machine.rows)
            if row.unit == unit and row.kind != "command"
        ]
        if not 1 < len(rows) <= MOST_SWAPPED:
            continue
        names = [row.name for _, row in rows]
        misfits = {}
        for _, row in rows:
            for number, model in rows:
                difference = recording.column(*row.channel) - predicted[number]
                misfits[row.name, model.name] = rms(difference - np.mean(difference)) ** 2

        def total(
            order: tuple[str, ...],
            names: list[str] = names,
            misfits: dict[tuple[str, str], float] = misfits,
        ) -> float:
            return (
                sum(misfits[name, model] for name, model in zip(names, order, strict=True)) ** 0.5
            )

        orders = list(permutations(names))
        least = min(total(order) for order in orders)
        # The size of the signals is the reference: an order that leaves more than half of it is no
        # explanation.
        swings = [np.std(recording.column(*row.channel)) for _, row in rows]
        size = float(np.linalg.norm(swings))
        # A defect may make a wrong order fit slightly better. An exchange must fit three times as
        # well, and explain most of the motion.
        if least < min(total(tuple(names)) / 3, EXCHANGED * size):
            # Orders that fit about as well differ in what these data cannot tell; the fewest swaps
            # are the likeliest.
            likely = [order for order in orders if total(order) < 1.5 * least]
            best = min(
                likely, key=lambda order: sum(n != m for n, m in zip(names, order, strict=True))
            )
            swapped = ", ".join(
                f"{name} holds {model}"
                for name, model in zip(names, best, strict=True)
                if name != model
            )
            yield Fault("swapped", "/sensor", f"channels of /sensor are swapped: {swapped}")


def _check_scale(machine: Machine, recording: RecordedTest, predicted: Array) -> Iterator[Fault]:
    """Yield wrong signs and units, by comparing signals with the nominal prediction."""
    far = machine.prior.implausible_scale
    odd: dict[Row, float] = {}
    for row, model in zip(machine.rows, predicted, strict=True):
        signal, where = recording.column(*row.channel), ".".join(row.channel)
        # The zero of a sensor may be displaced, so the means are left out. A force of known scale
        # has its preload, which says its scale even at rest.
        whole = row.kind == "force" and np.isfinite(far)
        a, b = (signal, model) if whole else (signal - signal.mean(), model - model.mean())
        if rms(b) == 0.0 or rms(a) < MOVES * white_noise(signal) or not np.isfinite(b).all():
            continue
        correlation, slope = (
            float(a @ b) / float(np.sqrt((a @ a) * (b @ b))),
            float(a @ b / (b @ b)),
        )
        # `correlation` is that of signal and prediction, and `slope` the regression of the
        # signal on the prediction: its scale.
        if correlation < -CORRELATED:
            yield Fault(
                "sign", where, f"{where} has the wrong sign: it goes against what is predicted"
            )
        elif correlation > CORRELATED:
            near = any(
                abs(np.log(factor / slope)) < SAME_UNIT for factor, _ in UNITS.get(row.unit, ())
            )
            if not 1 / far < slope < far or near:
                odd[row] = slope
    for row, slope in _unexplained_scales(machine, recording, odd).items():
        known = UNITS.get(row.unit, ((1.0, ""),))
        # Scales are compared by their logarithms: twice too large and twice too small are equally
        # wrong.
        factor, guess = min(known, key=lambda pair: abs(np.log(pair[0] / slope)))
        as_if = f", as if in {guess}" if abs(np.log(factor / slope)) < NEAR_UNIT and guess else ""
        where = ".".join(row.channel)
        yield Fault(
            "unit",
            where,
            f"{where} is {spell(slope, 3)} times what is predicted{as_if}; expected {row.unit}",
        )


def _unexplained_scales(
    machine: Machine, recording: RecordedTest, odd: Mapping[Row, float]
) -> dict[Row, float]:
    """Return the implausible scales that no physical cause explains."""
    suspicious = dict(odd)
    for row in odd:
        if row.kind == "force" and _is_wound_up(machine, recording):
            # A loop at its limit says that the force is not to be had; whose fault it is, is for
            # the diagnosis.
            del suspicious[row]
    for unit in {row.unit for row in odd}:
        same_unit = [row for row in odd if row.unit == unit]
        if len(same_unit) == 2 and len([row for row in machine.rows if row.unit == unit]) > 2:
            first, second = (odd[row] for row in same_unit)
            if 0.5 < first / second < 2.0:
                # Two sensors that agree on something that hardly moves: it hardly moves.
                suspicious = {
                    row: slope for row, slope in suspicious.items() if row not in same_unit
                }
    return suspicious


def _is_wound_up(machine: Machine, recording: RecordedTest) -> bool:
    """Return whether a force actuator's command is at its limit for long."""
    for name in _movers(machine):
        component = machine.components[name]
        if component.channel is None or component.element != "actuator":
            continue
        size = np.abs(recording.column(*component.channel))
        if np.any(size) and float(np.mean(size >= 0.99 * float(size.max()))) > WOUND_UP:
            return True
    return False
