"""Calibration of a channel table: zero, span and sign of each signal, with date and operator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from controllers import Measurements, Mode, Settings
from controllers.force import MOTOR_CONSTANT
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import CardLine, ChannelTable
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.rig import DrivenRig

REST_TICKS = 2000
"""Ticks averaged for a zero or a span; they cover many mains periods, whose hum cancels."""
BUMP = 1.0
"""Duration of one output's motion out and back, in s."""
STEADY = 5.0
"""Number of standard errors a response must reach before its direction is accepted."""


@dataclass(frozen=True)
class RestReading:
    """Readings of one signal at rest.

    Attributes
    ----------
    name
        Name of the signal.
    mean, noise
        Mean and standard deviation, in the signal's unit.
    repeats
        Largest number of equal readings in a row.
    """

    name: str
    mean: float
    noise: float
    repeats: int


def measure_rest(rig: DrivenRig, ticks: int = REST_TICKS) -> tuple[RestReading, ...]:
    """Measure every input while nothing moves.

    Parameters
    ----------
    rig : DrivenRig
        Rig that has been started. No output is written.
    ticks : int
        Number of readings.

    Raises
    ------
    RigtwinError
        If the rig cannot be read.
    """
    values = np.array([rig.read() for _ in range(ticks)])
    return tuple(
        RestReading(name, float(np.mean(column)), float(np.std(column)), _count_repeats(column))
        for name, column in zip(Measurements._fields, values.T, strict=True)
    )


def _count_repeats(column: Array) -> int:
    """Return the length of the longest run of equal values."""
    # A run ends where the value changes; both ends of the record count as changes.
    changes = np.flatnonzero(np.diff(column) != 0.0)
    return int(np.max(np.diff(np.concatenate(([-1], changes, [len(column) - 1])))))


def set_zeros(
    table: ChannelTable, still: tuple[RestReading, ...], references: Mapping[str, float]
) -> ChannelTable:
    """Set the zeros of the inputs.

    Parameters
    ----------
    table : ChannelTable
        Table before the calibration.
    still : tuple of RestReading
        Readings of the inputs at rest.
    references : mapping
        Input → reference value, in its unit. Inputs without an entry are to read zero.

    Returns
    -------
    ChannelTable
        Table with new offsets.
    """
    # Value = factor · volts + offset: a reading that is wrong by the same amount everywhere is
    # corrected in the offset alone, whatever the span.
    lines = [
        _rescale(line, offset=line.scaling.offset - signal.mean + references.get(line.name, 0.0))
        for line, signal in zip(table.inputs, still, strict=True)
    ]
    return replace(table, inputs=tuple(lines))


def set_spans(
    table: ChannelTable, still: tuple[RestReading, ...], references: Mapping[str, float]
) -> ChannelTable:
    """Set the spans of inputs whose zeros are right.

    Parameters
    ----------
    table : ChannelTable
        Table before the calibration.
    still : tuple of RestReading
        Readings of the inputs with the rig at the references.
    references : mapping
        Input → reference value, in its unit.

    Raises
    ------
    RigtwinError
        If a reference is too close to zero, or the reading has the opposite sign.
    """
    lines = []
    for line, signal in zip(table.inputs, still, strict=True):
        if line.name in references:
            # value = factor · volts + offset: the span scales only the part without the offset.
            moved = signal.mean - line.scaling.offset
            wanted = references[line.name] - line.scaling.offset
            # Near zero the span is a quotient of two small numbers.
            if abs(moved) < 10.0 * signal.noise:
                raise RigtwinError(
                    f"span of {line.name}: it reads {signal.mean:.4g} {line.unit}, which is noise; "
                    "place it at its reference"
                )
            factor = wanted / moved
            # A negative factor would be a wrong sign hidden in the scale.
            if factor <= 0.0:
                raise RigtwinError(
                    f"span of {line.name}: it reads {signal.mean:.4g} {line.unit}, the wrong way; "
                    "check signs first"
                )
            line = _rescale(line, scale=line.scaling.scale * factor)
        lines.append(line)
    return replace(table, inputs=tuple(lines))


def _rescale(line: CardLine, **changes: float) -> CardLine:
    return line._replace(scaling=line.scaling._replace(**changes))


def plan_bumps(stroke: float, force: float, period: float) -> tuple[Configuration, Array]:
    """Plan a session that moves one output after another a little and back.

    The outputs move without feedback: the force loop has only its feedforward gain.

    Parameters
    ----------
    stroke
        Motion of ground and structure, in m.
    force
        Force of the motor, in N.
    period
        Period of a tick, in s.

    Returns
    -------
    tuple of Configuration and Array
        Configuration of the session, and its demands, shape (ticks, 3).
    """
    ticks = round(BUMP / period)
    # A raised cosine starts and ends without a jump in velocity.
    bump = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(ticks) / ticks)
    demands = np.zeros((3 * ticks, 3))
    for column, height in enumerate((stroke, stroke, force)):
        demands[column * ticks : (column + 1) * ticks, column] = height * bump
    # Imposed motion with feedforward only: no loop can react to a sign that is wrong.
    settings = Settings(mode=Mode.IMPOSED, kp=0.0, ki=0.0, kff=1.0, preload=0.0, start=0.0)
    return Configuration(
        controller=settings, timing=Timing(duration=3 * BUMP, period=period)
    ), demands


def fit_responses(measured: Array, demands: Array) -> dict[str, tuple[str, float, float]]:
    """Fit the gain of each input on its output in a session of `plan_bumps`.

    Parameters
    ----------
    measured : Array
        Measurements, shape (ticks, 4), in the order of `controllers.Measurements`.
    demands : Array
        Demands of the session, shape (ticks, 3).

    Returns
    -------
    dict
        Output → the input that follows it, the gain, and the standard error of the gain.
    """
    ticks = len(demands) // 3
    responses: dict[str, tuple[str, float, float]] = {}
    for column, (output, sensor) in enumerate(FOLLOWS.items()):
        stretch = slice(column * ticks, (column + 1) * ticks)
        gain, error = _fit_gain(
            demands[stretch, column], measured[stretch, Measurements._fields.index(sensor)]
        )
        responses[output] = (sensor, gain, error)
    # The rail's friction holds the carriage, so the travel follows the structure's motion.
    stretch = slice(ticks, 2 * ticks)
    gain, error = _fit_gain(
        demands[stretch, 1], measured[stretch, Measurements._fields.index("suspension_lvdt")]
    )
    responses["travel"] = ("suspension_lvdt", gain, error)
    return responses


FOLLOWS = {"ground": "ground_lvdt", "structure": "structure_lvdt", "voltage": "load_cell"}
"""Output → input that it moves. The travel follows the structure too, while the rail holds the
carriage."""


def _fit_gain(asked: Array, read: Array) -> tuple[float, float]:
    """Return the least-squares gain of `read` on `asked` and a constant, and its standard error."""
    design = np.column_stack([asked, np.ones(len(asked))])
    solution, residual, *_ = np.linalg.lstsq(design, read, rcond=None)
    # Standard error of a slope: σ / ‖asked − mean‖, with two parameters fitted.
    spread = float(np.sqrt(residual[0] / (len(read) - 2))) if len(residual) else 0.0
    return float(solution[0]), spread / float(np.linalg.norm(asked - asked.mean()))


def correct_signs(
    table: ChannelTable, responses: Mapping[str, tuple[str, float, float]], moved: Mapping[str, int]
) -> tuple[ChannelTable, tuple[str, ...]]:
    """Correct the sign of every signal, and mark all signs as checked.

    Parameters
    ----------
    table
        Table before the check.
    responses
        Result of `fit_responses`.
    moved
        Output → 1 if the operator saw it move in the direction of its command's sign, else −1.
        For the voltage it is the direction of the force on the plate.

    Returns
    -------
    tuple of ChannelTable and texts
        Corrected table, and a line for each correction.

    Raises
    ------
    RigtwinError
        If a signal hardly responds.
    """
    inputs = {line.name: line for line in table.inputs}
    outputs = {line.name: line for line in table.outputs}
    said: list[str] = []
    for output, (sensor, gain, error) in responses.items():
        # A gain is about 1 or −1 for a calibrated span; below 0.2 its sign means nothing.
        if abs(gain) < max(0.2, STEADY * error):
            raise RigtwinError(
                f"sign of {sensor}: it hardly answers (gain {gain:.2g} ± {error:.1g}); "
                "is it connected, has the rig pressure?"
            )
        # The travel is no output of its own: it follows the structure, so the operator judged
        # that motion.
        driven = "structure" if output == "travel" else output
        went = moved[driven]
        if output in outputs:
            if went < 0:
                outputs[output] = _turn_sign(outputs[output])
                said.append(f"{output}: output went the wrong way; its sign is turned")
            outputs[output] = outputs[output]._replace(sign_checked=True)
        # The operator sees the true motion, whose sign the input must have.
        if np.sign(gain) != went:
            inputs[sensor] = _turn_sign(inputs[sensor])
            said.append(f"{sensor}: reads the wrong way; its sign is turned")
        inputs[sensor] = inputs[sensor]._replace(sign_checked=True)
    turned = replace(table, inputs=tuple(inputs.values()), outputs=tuple(outputs.values()))
    return turned, tuple(said)


def _turn_sign(line: CardLine) -> CardLine:
    """Return the line with the opposite sign; the offset changes its sign with it."""
    return _rescale(line, sign=-line.scaling.sign, offset=-line.scaling.offset)


def sign_off(table: ChannelTable, operator: str, note: str, today: date) -> ChannelTable:
    """Return the table signed by an operator with date and note."""
    return replace(table, calibrated=today.isoformat(), operator=operator, note=note)


FORCE = 0.4 * MOTOR_CONSTANT
"""Force of the motor's motion, in N; above the dry friction of motor and rail together."""
