"""Checks of a recording's units and of the order of its columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from rigtwin.components import Schedule
from rigtwin.description.machine import Machine
from rigtwin.description.replay import Row
from rigtwin.diagnosis.units import spell
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import rms, white_noise

MOVES = 10.0
"""Ratio of signal to noise from which the scale of a signal is checked."""
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


def moving_channels(machine: Machine) -> set[str]:
    """Return the channels that move the machine."""
    return {name for replay in machine.replays if not replay.closed for name in replay.moved_by}


def check_order(machine: Machine, recording: RecordedTest, predicted: Array) -> Iterator[Fault]:
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


def check_scale(machine: Machine, recording: RecordedTest, predicted: Array) -> Iterator[Fault]:
    """Yield wrong signs and units, by comparing signals with the nominal prediction."""
    far = machine.prior.implausible_scale
    odd: dict[Row, float] = {}
    for row, model in zip(machine.rows, predicted, strict=True):
        signal, where = recording.column(*row.channel), ".".join(row.channel)
        # The zero of a sensor may be displaced, so the means are left out. A force of known scale
        # has its preload, which says its scale even at rest.
        whole = row.kind == "force" and np.isfinite(far)
        a, b = (signal, model) if whole else (signal - signal.mean(), model - model.mean())
        if rms(b) == 0.0 or rms(a) <= MOVES * white_noise(signal) or not np.isfinite(b).all():
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
    for name in moving_channels(machine):
        component = machine.components[name]
        if component.channel is None or component.element != "actuator":
            continue
        size = np.abs(recording.column(*component.channel))
        if np.any(size) and float(np.mean(size >= 0.99 * float(size.max()))) > WOUND_UP:
            return True
    return False
