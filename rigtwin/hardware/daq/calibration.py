"""Finds out what a channel table must say: zero, span, and which way each signal goes.

Writes it down with date and name.
"""

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
from rigtwin.hardware.daq.table import ChannelTable, Line
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.rig import DrivenRig

LOOKED = 2000
"""Ticks that a zero or a span is averaged over: many periods of the mains."""
BUMP = 1.0
"""s that each output takes to go out and back."""
STEADY = 5.0
"""Standard errors by which a response must stand out before its direction is believed."""


@dataclass(frozen=True)
class Still:
    """A signal at rest. mean, noise: in its unit; repeats: most same readings in a row."""

    name: str
    mean: float
    noise: float
    repeats: int


def measure_rest(rig: DrivenRig, ticks: int = LOOKED) -> tuple[Still, ...]:
    """Every input while nothing moves.

    The rig must have been started; no output is written. Raises RigtwinError.
    """
    values = np.array([rig.read() for _ in range(ticks)])
    return tuple(
        Still(name, float(np.mean(column)), float(np.std(column)), _count_repeats(column))
        for name, column in zip(Measurements._fields, values.T, strict=True)
    )


def _count_repeats(column: Array) -> int:
    changes = np.flatnonzero(np.diff(column) != 0.0)
    return int(np.max(np.diff(np.concatenate(([-1], changes, [len(column) - 1])))))


def set_zeros(
    table: ChannelTable, still: tuple[Still, ...], references: Mapping[str, float]
) -> ChannelTable:
    """Sets the inputs' zeros.

    Parameters
    ----------
    table : ChannelTable
        As it was.
    still : tuple of Still
        The inputs as the rig now stands.
    references : mapping
        Input → what it is to read, in its unit; zero where none is given.

    Returns
    -------
    ChannelTable
        With other offsets.
    """
    lines = [
        _rescale(line, offset=line.scaling.offset - signal.mean + references.get(line.name, 0.0))
        for line, signal in zip(table.inputs, still, strict=True)
    ]
    return replace(table, inputs=tuple(lines))


def set_spans(
    table: ChannelTable, still: tuple[Still, ...], references: Mapping[str, float]
) -> ChannelTable:
    """Sets the spans of inputs that read true at zero, by their references as the rig now stands.

    Raises RigtwinError for a reference too close to zero.
    """
    lines = []
    for line, signal in zip(table.inputs, still, strict=True):
        if line.name in references:
            # What an offset makes of the reading is no part of the span.
            moved, wanted = (
                signal.mean - line.scaling.offset,
                references[line.name] - line.scaling.offset,
            )
            if abs(moved) < 10.0 * signal.noise:
                raise RigtwinError(
                    f"span of {line.name}: it reads {signal.mean:.4g} {line.unit}, which is noise; "
                    "place it at its reference"
                )
            factor = wanted / moved
            if factor <= 0.0:
                raise RigtwinError(
                    f"span of {line.name}: it reads {signal.mean:.4g} {line.unit}, the wrong way; "
                    "check signs first"
                )
            line = _rescale(line, scale=line.scaling.scale * factor)
        lines.append(line)
    return replace(table, inputs=tuple(lines))


def _rescale(line: Line, **changes: float) -> Line:
    return line._replace(scaling=line.scaling._replace(**changes))


def plan_bumps(stroke: float, force: float, period: float) -> tuple[Configuration, Array]:
    """A session that moves one output after the other a little and back.

    The ground and the structure by `stroke`, m, then the motor by `force`, N, without feedback.
    Returns configuration and demands, shape (ticks, 3).
    """
    ticks = round(BUMP / period)
    bump = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(ticks) / ticks)
    demands = np.zeros((3 * ticks, 3))
    for column, height in enumerate((stroke, stroke, force)):
        demands[column * ticks : (column + 1) * ticks, column] = height * bump
    settings = Settings(mode=Mode.IMPOSED, kp=0.0, ki=0.0, kff=1.0, preload=0.0, start=0.0)
    return Configuration(
        controller=settings, timing=Timing(duration=3 * BUMP, period=period)
    ), demands


def fit_responses(measured: Array, demands: Array) -> dict[str, tuple[str, float, float]]:
    """Fits how the inputs answer the outputs in a session of `plan_bumps`.

    Parameters
    ----------
    measured : Array
        Columns of controllers.Measurements, shape (ticks, 4).
    demands : Array
        Of that session, shape (ticks, 3).

    Returns
    -------
    dict
        Output → input that must follow it, its gain on the demand, the gain's standard error.
    """
    ticks = len(demands) // 3
    found: dict[str, tuple[str, float, float]] = {}
    for column, (output, sensor) in enumerate(FOLLOWS.items()):
        stretch = slice(column * ticks, (column + 1) * ticks)
        gain, error = _fit_gain(
            demands[stretch, column], measured[stretch, Measurements._fields.index(sensor)]
        )
        found[output] = (sensor, gain, error)
    stretch = slice(ticks, 2 * ticks)
    gain, error = _fit_gain(
        demands[stretch, 1], measured[stretch, Measurements._fields.index("suspension_lvdt")]
    )
    found["travel"] = ("suspension_lvdt", gain, error)
    return found


FOLLOWS = {"ground": "ground_lvdt", "structure": "structure_lvdt", "voltage": "load_cell"}
"""Which input each output moves; the suspension's travel follows the structure while the rail
holds the carriage."""


def _fit_gain(asked: Array, read: Array) -> tuple[float, float]:
    """Least squares of `read` on `asked` and a constant."""
    design = np.column_stack([asked, np.ones(len(asked))])
    solution, residual, *_ = np.linalg.lstsq(design, read, rcond=None)
    spread = float(np.sqrt(residual[0] / (len(read) - 2))) if len(residual) else 0.0
    return float(solution[0]), spread / float(np.linalg.norm(asked - asked.mean()))


def correct_signs(
    table: ChannelTable, found: Mapping[str, tuple[str, float, float]], moved: Mapping[str, int]
) -> tuple[ChannelTable, tuple[str, ...]]:
    """The table with every sign as it must be, all of them checked, and what was changed.

    moved: output → 1 if the operator saw it go the way of its command's sign, else −1; the
    voltage's is that of the force on the plate. Raises RigtwinError where a signal hardly answers.
    """
    inputs = {line.name: line for line in table.inputs}
    outputs = {line.name: line for line in table.outputs}
    said: list[str] = []
    for output, (sensor, gain, error) in found.items():
        if abs(gain) < max(0.2, STEADY * error):
            raise RigtwinError(
                f"sign of {sensor}: it hardly answers (gain {gain:.2g} ± {error:.1g}); "
                "is it connected, has the rig pressure?"
            )
        driven = "structure" if output == "travel" else output
        went = moved[driven]
        if output in outputs:
            if went < 0:
                outputs[output] = _turn_sign(outputs[output])
                said.append(f"{output}: output went the wrong way; its sign is turned")
            outputs[output] = outputs[output]._replace(sign_checked=True)
        if np.sign(gain) != went:
            inputs[sensor] = _turn_sign(inputs[sensor])
            said.append(f"{sensor}: reads the wrong way; its sign is turned")
        inputs[sensor] = inputs[sensor]._replace(sign_checked=True)
    turned = replace(table, inputs=tuple(inputs.values()), outputs=tuple(outputs.values()))
    return turned, tuple(said)


def _turn_sign(line: Line) -> Line:
    """The other sign; what the offset makes of a reading turns with it."""
    return _rescale(line, sign=-line.scaling.sign, offset=-line.scaling.offset)


def sign_off(table: ChannelTable, operator: str, note: str, today: date) -> ChannelTable:
    return replace(table, calibrated=today.isoformat(), operator=operator, note=note)


FORCE = 0.4 * MOTOR_CONSTANT
"""N of the motor's bump: more than both dry frictions hold."""
