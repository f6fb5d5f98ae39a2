"""Section 6.1: both actuators identified on the running twin by Schroeder multisines, beside the thesis' fits."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controllers import Mode, Settings
from controllers.filters import low_pass
from experiments.experiment import Progress, time_of
from rigtwin.arrays import Array
from rigtwin.configuration import Configuration, Timing
from rigtwin.excitation import schroeder
from rigtwin.loop import run_compiled
from rigtwin.twin import Twin

Response = NDArray[np.complex128]

HIGHEST = 10
"""Hz; the tests of chapter 6 and 7 excite nothing above."""
SECONDS = 12
"""Length of a test; the last ten periods of a second each are averaged, when the transient has gone."""


def electric(frequencies: Array) -> Response:
    """G(s), thesis Eq. 6.1: force demanded → force sensed and filtered."""
    s = 2j * math.pi * frequencies
    return (0.1562 * s**2 - 68.9 * s + 4.716e4) / (s**2 + 438.8 * s + 4.706e4)


def hydraulic(frequencies: Array) -> Response:
    """H(s)/H(0), thesis Eq. 6.2: position demanded → position."""
    s = 2j * math.pi * frequencies
    above = 1817 * s**2 + 7.719e4 * s + 6.243e5
    return above / (s**4 + 165.9 * s**3 + 6674 * s**2 + 8.598e4 * s + 6.281e5) * 6.281e5 / 6.243e5


def _tested(demanded: Callable[[Array, Settings], Array], seed: int) -> tuple[Array, Array]:
    """Commands and measurements of an imposed test on the nominal twin, the mean of the last ten seconds."""
    configuration = Configuration(controller=Settings(mode=Mode.IMPOSED), timing=Timing(duration=float(SECONDS)))
    demands = demanded(time_of(configuration), configuration.controller)
    blocks = list(run_compiled(Twin(configuration, 0.0, seed), configuration, demands))
    second = round(1.0 / configuration.timing.period)
    averaged = [
        np.concatenate(parts)[-10 * second :].reshape(10, second, 4).mean(axis=0)
        for parts in ([block.commands for block in blocks], [block.measurements for block in blocks])
    ]
    return averaged[0], averaged[1]


def _ratio(out: Array, into: Array) -> Response:
    """At 1, 2, … HIGHEST Hz, of one second each."""
    return np.fft.rfft(out)[1 : HIGHEST + 1] / np.fft.rfft(into)[1 : HIGHEST + 1]


def cylinder_response(seed: int) -> Response:
    """The structure cylinder's response at 1 … 10 Hz, the hold's half tick taken out."""

    def demanded(time: Array, settings: Settings) -> Array:
        position = schroeder(time, np.arange(1.0, 21.0), 5e-4)
        return np.column_stack([np.zeros_like(time), settings.start + position - position[0], np.full_like(time, 200.0)])

    commands, measured = _tested(demanded, seed)
    hold = np.exp(2j * math.pi * np.arange(1, HIGHEST + 1) * 0.5e-3)
    return _ratio(measured[:, 1], commands[:, 1]) * hold


def force_response(seed: int) -> Response:
    """The force loop's response at 1 … 10 Hz as sensed and filtered, both plates at rest and the carriage held by the rail:
    a swing below its breakaway."""

    def demanded(time: Array, settings: Settings) -> Array:
        force = settings.preload + schroeder(time, np.arange(1.0, 101.0), 1.5)
        return np.column_stack([np.zeros_like(time), np.full_like(time, settings.start), force])

    commands, measured = _tested(demanded, seed)
    # The filter is linear: it is applied to the periodic average, run through twice so that its start is forgotten.
    filtered, output = [], float(measured[0, 3])
    for sample in np.tile(measured[:, 3], 2).tolist():
        output = low_pass(output, sample, Settings().filter_force, 1e-3)
        filtered.append(output)
    return _ratio(np.array(filtered[-len(measured) :]), commands[:, 2])


def identification(seeds: int, out: Path | None, progress: Progress) -> str:
    """Both responses, mean over noise seeds, and their difference from the thesis."""
    cylinders, forces = [], []
    for seed in range(seeds):
        cylinders.append(cylinder_response(seed))
        forces.append(force_response(seed))
        progress(1)
    frequencies = np.arange(1.0, HIGHEST + 1.0)
    lines = [
        f"identified on the twin, mean of {seeds} seeds, less the thesis' fit",
        "   Hz   cylinder against H(s)   force loop against G(s)",
    ]
    cylinder = np.mean(cylinders, axis=0) / hydraulic(frequencies)
    force = np.mean(forces, axis=0) / electric(frequencies)
    for frequency, one, other in zip(frequencies, cylinder, force, strict=True):
        texts = [f"{20 * math.log10(abs(r)):+7.2f} dB {math.degrees(np.angle(r)):+7.2f} deg" for r in (one, other)]
        lines.append(f"{frequency:5g}   {texts[0]}    {texts[1]}")
    return "\n".join(lines)
