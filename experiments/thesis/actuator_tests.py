"""Tests of §6.1 on the twin: responses of both actuators, static tests of tyre and rail, fits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controllers import Mode, Settings
from experiments.experiment import time_of
from experiments.thesis.study import Result
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Safety, Timing
from rigtwin.numerics.arrays import Array
from rigtwin.signals.excitation import schroeder
from rigtwin.simulation.runner import simulate
from rigtwin.studies.friction_loop import filter_lag

Response = NDArray[np.complex128]
FITTED = 20
"""Highest frequency of the cylinder's excitation and of its fit, Hz."""
SECONDS = 12
"""Length of a test, s.

The last ten periods of one second are averaged; the transient has decayed by then.
"""
ELECTRIC = (("0.1562", "-68.9", "4.716e4"), ("1", "438.8", "4.706e4"))
HYDRAULIC = (("1817", "7.719e4", "6.243e5"), ("1", "165.9", "6674", "8.598e4", "6.281e5"))
"""Numerator and denominator of thesis Eq. 6.1 and 6.2, highest power of s first."""


def _response(polynomials: tuple[tuple[str, ...], tuple[str, ...]], frequencies: Array) -> Response:
    """Return the frequency response of printed polynomials; frequencies: Hz."""
    s = 2j * math.pi * frequencies
    above, below = (
        np.polyval([float(text) for text in coefficients], s) for coefficients in polynomials
    )
    return above / below


def thesis_force_loop(frequencies: Array) -> Response:
    """Return G(s) of thesis Eq. 6.1, demanded → sensed and filtered force; frequencies: Hz."""
    return _response(ELECTRIC, frequencies)


def thesis_cylinder(frequencies: Array) -> Response:
    """Return H(s)/H(0) of thesis Eq. 6.2, demanded → true position; frequencies: Hz."""
    return _response(HYDRAULIC, frequencies) * 6.281e5 / 6.243e5


def _average_test(demanded: Callable[[Array, Settings], Array], seed: int) -> tuple[Array, Array]:
    """Return commands and measurements of an imposed test on the nominal twin.

    Both have shape (ticks of one second, 4) and are averages over the last ten seconds.
    """
    configuration = Configuration(
        controller=Settings(mode=Mode.IMPOSED), timing=Timing(duration=float(SECONDS))
    )
    ran = simulate(configuration, demanded(time_of(configuration), configuration.controller), seed)
    second = round(1.0 / configuration.timing.period)
    commands, measured = (
        # Averaging over periods lowers noise that is not periodic by √10, and leaves the
        # response.
        part[-10 * second :].reshape(10, second, 4).mean(axis=0)
        for part in (ran.commands, ran.measurements)
    )
    return commands, measured


def _ratio(out: Array, into: Array, highest: int) -> Response:
    """Return the response at 1, 2, … highest Hz from one second of output and input."""
    # All lines fall on whole periods of one second: no window, no leakage.
    return np.fft.rfft(out)[1 : highest + 1] / np.fft.rfft(into)[1 : highest + 1]


def cylinder_response(seed: int) -> Response:
    """Return the response of the structure cylinder at 1 to `FITTED` Hz, shape (FITTED,).

    The half tick of the command's zero-order hold is removed.
    """

    def demanded(time: Array, settings: Settings) -> Array:
        position = schroeder(time, np.arange(1.0, FITTED + 1.0), 5e-4)
        return np.column_stack(
            [
                np.zeros_like(time),
                # The multisine starts at zero, so that the cylinder does not jump at the first
                # tick.
                settings.start + position - position[0],
                np.full_like(time, 200.0),
            ]
        )

    commands, measured = _average_test(demanded, seed)
    # A command held over a tick of 1 ms acts half a tick late on average.
    hold = np.exp(2j * math.pi * np.arange(1, FITTED + 1) * 0.5e-3)
    return _ratio(measured[:, 1], commands[:, 1], FITTED) * hold


def force_response(seed: int) -> Response:
    """Return the response of the force loop at 1 to `FITTED` Hz, sensed and filtered.

    Both plates rest. The force swings below the breakaway of the rail, which holds the carriage.
    """

    def demanded(time: Array, settings: Settings) -> Array:
        force = settings.preload + schroeder(time, np.arange(1.0, 101.0), 1.5)
        return np.column_stack([np.zeros_like(time), np.full_like(time, settings.start), force])

    commands, measured = _average_test(demanded, seed)
    # The filter is linear, so it may act on the averaged period; a second period after the first
    # removes its transient.
    filtered = filter_lag(np.tile(measured[:, 3], 2), Settings().filter_force, 1e-3)
    return _ratio(filtered[-len(measured) :], commands[:, 2], FITTED)


def fit_transfer_function(
    frequencies: Array, response: Response, zeros: int, poles: int
) -> tuple[Array, Array]:
    """Fit a transfer function to a frequency response.

    Minimises |N(s) − H D(s)|² / |D_before(s)|², with the denominator of the previous iteration as
    the weight (Sanathanan and Koerner, IEEE Trans. Autom. Control 8 (1963) 56).

    Parameters
    ----------
    frequencies : ndarray
        Frequencies, Hz, shape (n,).
    response : ndarray
        Complex response H at these frequencies, shape (n,).
    zeros, poles : int
        Degrees of numerator and denominator.

    Returns
    -------
    tuple of ndarray
        Numerator, shape (zeros + 1,), and monic denominator, shape (poles + 1,), highest power of
        s first.
    """
    # s is scaled to order one: the powers of rad/s would span many decades.
    scale = 2 * math.pi * float(np.exp(np.mean(np.log(frequencies))))
    s = 2j * math.pi * frequencies / scale
    weight = np.ones(len(s))
    numerator, denominator = np.zeros(zeros + 1), np.zeros(poles + 1)
    # Each iteration weights by the denominator of the one before, which turns the equation error
    # N − H D back into the output error N/D − H.
    for _ in range(30):
        columns = [s**power for power in range(zeros, -1, -1)] + [
            -response * s**power for power in range(poles - 1, -1, -1)
        ]
        # Unknown are the numerator and the denominator without its leading 1.
        matrix = np.column_stack(columns) * weight[:, None]
        right_side = response * s**poles * weight
        coefficients = np.linalg.lstsq(
            np.concatenate([matrix.real, matrix.imag]),
            np.concatenate([right_side.real, right_side.imag]),
            rcond=None,
        )[0]
        numerator = coefficients[: zeros + 1]
        denominator = np.concatenate([[1.0], coefficients[zeros + 1 :]])
        weight = 1.0 / np.abs(np.polyval(denominator, s))
    return (
        numerator * scale ** (poles - np.arange(zeros, -1.0, -1.0)),
        denominator * scale ** (poles - np.arange(poles, -1.0, -1.0)),
    )


def press_tyre(seed: int) -> Result:
    """Press the tyre slowly with the motor and release it: force, N, and deflection, m.

    Half the difference between loading and unloading is the friction of the rail.
    """
    settings = Settings(mode=Mode.IMPOSED)
    configuration = Configuration(
        controller=settings, timing=Timing(duration=40.0), safety=Safety(force=1700.0)
    )
    time = time_of(configuration)
    # A raised cosine: slow at both ends, where loading turns into unloading.
    force = 200.0 + 1200.0 * (0.5 - 0.5 * np.cos(2 * math.pi * time / 40.0))
    demands = np.column_stack([np.zeros_like(time), np.full_like(time, settings.start), force])
    ran = simulate(configuration, demands, seed)
    # Wheel = plate − travel, both true.
    wheel = ran.truth[:, 1] - ran.truth[:, 2]
    shown = slice(None, None, 40)
    return {"force": ran.truth[shown, 3], "deflection": -wheel[shown]}


def ramp_force(direction: float, seed: int) -> Result:
    """Ramp the force of the motor until the carriage moves (Fig. 6.13); direction: 1 or −1."""
    settings = Settings(mode=Mode.IMPOSED)
    configuration = Configuration(controller=settings, timing=Timing(duration=10.0))
    time = time_of(configuration)
    # 10 N/s: slow against the force loop, so that the force at breakaway is static.
    force = 200.0 + direction * np.maximum(10.0 * (time - 1.0), 0.0)
    demands = np.column_stack([np.zeros_like(time), np.full_like(time, settings.start), force])
    ran = simulate(configuration, demands, seed)
    wheel = ran.truth[:, 1] - ran.truth[:, 2]
    # Presliding moves the carriage by less than 5 µm.
    moved = np.abs(wheel - wheel[0]) > 5e-6
    shown = slice(None, None, 10)
    breakaway = abs(float(ran.truth[int(np.argmax(moved)), 3]) - 200.0) if moved.any() else math.nan
    return {
        "breakaway": breakaway,
        "time": time[shown],
        "force": ran.truth[shown, 3],
        "wheel": 1e6 * (wheel - wheel[0])[shown],
    }
