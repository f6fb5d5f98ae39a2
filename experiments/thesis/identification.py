"""§6.1: identification of actuators, tyre and rail on the twin.

Schroeder multisines identify both actuators. Static tests give the stiffness of the tyre and the
breakaway force of the rail.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from controllers import Mode, Settings
from experiments.experiment import time_of
from experiments.thesis.entry import Entry, factor, statement
from experiments.thesis.study import Conclusion, Drawing, Job, Result, ThesisStudy, sheet, span
from experiments.thesis.trial import seeded
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Safety, Timing
from rigtwin.numerics.arrays import Array
from rigtwin.render.plot import ASKED, SENSED
from rigtwin.signals.excitation import schroeder
from rigtwin.simulation.runner import simulate
from rigtwin.studies.friction_loop import filter_lag

Response = NDArray[np.complex128]

HIGHEST = 10
"""Highest frequency of the comparisons, Hz. The tests of chapters 6 and 7 excite none above it."""
FITTED = 20
"""Highest frequency of the cylinder's excitation and of its fit, Hz."""
SECONDS = 12
"""Length of a test, s.

The last ten periods of one second are averaged; the transient has decayed by then.
"""
MOST_SEEDS = 4
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
    for _ in range(30):
        columns = [s**power for power in range(zeros, -1, -1)] + [
            -response * s**power for power in range(poles - 1, -1, -1)
        ]
        # Unknown are the numerator and the denominator without its leading 1.
        matrix, right_side = (
            np.column_stack(columns) * weight[:, None],
            response * s**poles * weight,
        )
        coefficients = np.linalg.lstsq(
            np.concatenate([matrix.real, matrix.imag]),
            np.concatenate([right_side.real, right_side.imag]),
            rcond=None,
        )[0]
        numerator, denominator = (
            coefficients[: zeros + 1],
            np.concatenate([[1.0], coefficients[zeros + 1 :]]),
        )
        weight = 1.0 / np.abs(np.polyval(denominator, s))
    return (
        numerator * scale ** (poles - np.arange(zeros, -1.0, -1.0)),
        denominator * scale ** (poles - np.arange(poles, -1.0, -1.0)),
    )


def _press_tyre(seed: int) -> Result:
    """Press the tyre slowly with the motor and release it: force, N, and deflection, m.

    Half the difference between loading and unloading is the friction of the rail.
    """
    settings = Settings(mode=Mode.IMPOSED)
    configuration = Configuration(
        controller=settings, timing=Timing(duration=40.0), safety=Safety(force=1700.0)
    )
    time = time_of(configuration)
    force = 200.0 + 1200.0 * (0.5 - 0.5 * np.cos(2 * math.pi * time / 40.0))
    demands = np.column_stack([np.zeros_like(time), np.full_like(time, settings.start), force])
    ran = simulate(configuration, demands, seed)
    # Wheel = plate − travel, both true.
    wheel = ran.truth[:, 1] - ran.truth[:, 2]
    shown = slice(None, None, 40)
    return {"force": ran.truth[shown, 3], "deflection": -wheel[shown]}


def _ramp_force(direction: float, seed: int) -> Result:
    """Ramp the force of the motor until the carriage moves (Fig. 6.13); direction: 1 or −1."""
    settings = Settings(mode=Mode.IMPOSED)
    configuration = Configuration(controller=settings, timing=Timing(duration=10.0))
    time = time_of(configuration)
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


def jobs(seeds: int) -> Mapping[str, Job]:
    """Return the jobs of the study; the static tests run with one seed."""

    def response(measure: Callable[[int], Response]) -> Callable[[int], Result]:
        def work(seed: int) -> Result:
            measured = measure(seed)
            return {"real": measured.real, "imaginary": measured.imag}

        return work

    work_by_key = seeded(
        {"cylinder": response(cylinder_response), "force": response(force_response)},
        min(seeds, MOST_SEEDS),
    )
    work_by_key["tyre"] = lambda: _press_tyre(0)
    return work_by_key | {
        "rail/up": lambda: _ramp_force(1.0, 0),
        "rail/down": lambda: _ramp_force(-1.0, 0),
    }


def mean_response(results: Mapping[str, Result], name: str) -> Response:
    """Return the mean response over the seeds at 1 to `FITTED` Hz, shape (FITTED,)."""
    responses = [result for key, result in results.items() if key.startswith(f"{name}/")]
    return np.mean(
        [np.asarray(result["real"]) + 1j * np.asarray(result["imaginary"]) for result in responses],
        axis=0,
    )


def _decibel(response: Response) -> Array:
    """Return the magnitude of a response, dB."""
    return 20 * np.log10(np.abs(response))


def _crossing(frequencies: Array, decibel: Array, level: float) -> float:
    """Return the lowest frequency at which a magnitude falls below a level, Hz."""
    below = np.flatnonzero(decibel < level)
    return float(frequencies[below[0]]) if len(below) else math.inf


def _entries(results: Mapping[str, Result], frequencies: Array) -> list[Entry]:
    """Return all entries of §6.1, with those of §3.3 about the same actuators."""
    cylinder, force = mean_response(results, "cylinder"), mean_response(results, "force")
    return [
        *_coefficients(frequencies, cylinder),
        *_responses(frequencies, cylinder, force),
        *_bandwidths(),
        *_delays(cylinder),
        *_mechanical(results),
    ]


def _coefficients(frequencies: Array, cylinder: Response) -> list[Entry]:
    """Return the entries of the coefficients of Eq. 6.2, fitted to the twin's cylinder."""
    entries: list[Entry] = []
    fitted = fit_transfer_function(frequencies, cylinder, 2, 4)
    for part, printed, values in zip(("numerator", "denominator"), HYDRAULIC, fitted, strict=True):
        for power, (text, value) in enumerate(zip(printed[::-1], values[::-1], strict=True)):
            entries.append(
                factor("Equation 6.2", f"{part}, s^{power}", text, [float(value)], "", 1.25)
            )
    return entries


def _responses(frequencies: Array, cylinder: Response, force: Response) -> list[Entry]:
    """Return the entries that compare the twin's responses with Eq. 6.1 and 6.2 up to 10 Hz."""
    # The fitted coefficients of Eq. 6.1 differ, because the twin's loop has another structure. Its
    # response is what counts, so the responses are compared.
    inside = frequencies <= HIGHEST
    worst, angle, text = _deviation(force[inside] / thesis_force_loop(frequencies[inside]))
    entries = [
        statement(
            "Equation 6.1",
            "force loop's response",
            "G(s) to 1 dB and 6 deg",
            worst < 1.0 and angle < 6.0,
            text,
        )
    ]
    worst, angle, text = _deviation(cylinder[inside] / thesis_cylinder(frequencies[inside]))
    entries.append(
        statement(
            "Equation 6.2",
            "cylinder's response",
            "H(s) to 0.2 dB and 2 deg",
            worst < 0.2 and angle < 2.0,
            text,
        )
    )
    return entries


def _deviation(ratio: Response) -> tuple[float, float, str]:
    """Return the largest deviation of a ratio from 1, in dB and in degrees, and both as text."""
    worst = float(np.max(np.abs(_decibel(ratio))))
    angle = float(np.max(np.abs(np.degrees(np.angle(ratio)))))
    return worst, angle, f"off by at most {worst:.2f} dB and {angle:.1f} deg over 1 to 10 Hz"


def _bandwidths() -> list[Entry]:
    """Return the entries of the bandwidths that §3.3 quotes, from the printed equations."""
    fine = np.linspace(0.1, 40.0, 4000)
    loop = _crossing(fine, _decibel(thesis_force_loop(fine)), -3.0)
    cylinder = _crossing(fine, _decibel(thesis_cylinder(fine)), -3.0)
    note = "at 3.5 Hz it is 3 dB down; 10 Hz is where it is 13 dB down"
    return [
        factor("§3.3", "bandwidth of the force loop, G(s)", "20", [loop], "Hz", 1.2),
        factor("§3.3", "bandwidth of the cylinder, H(s)", "10", [cylinder], "Hz", 1.5, note),
    ]


def _delays(cylinder: Response) -> list[Entry]:
    """Return the entries of delay and phase of the cylinder, and of the order of Eq. 6.1."""
    low = np.linspace(0.1, 40.0, 4000)
    low = low[low < 15.0]
    # Phase delay −φ/(2π f); the thesis reads its maximum off Figure 6.11.
    delay = -np.unwrap(np.angle(thesis_cylinder(low))) / (2 * math.pi * low)
    longest = float(low[np.argmax(delay)])
    at_one = -math.degrees(float(np.angle(thesis_cylinder(np.array([1.0]))[0])))
    measured = -math.degrees(float(np.angle(cylinder[0])))
    phase_note = (
        "§6.1.3 reads 90 deg off its figure; its own Eq. 6.2 gives 12.5 "
        "deg: the equation is right, the twin agrees with it"
    )
    order_note = (
        "§6.1.2 calls it third order with one zero and prints second "
        "order with two; the printed one is what is used"
    )
    return [
        factor("Figure 6.11", "frequency of the longest delay", "3", [longest], "Hz", 1.25),
        factor(
            "§6.1.3", "phase lag of the cylinder at 1 Hz", "90", [at_one], "deg", 1.2, phase_note
        ),
        factor(
            "§6.1.3", "the same, Eq. 6.2 against the twin", f"{at_one:.1f}", [measured], "deg", 1.05
        ),
        statement(
            "§6.1.2",
            "order of Eq. 6.1",
            "third order, one zero",
            False,
            "second order, two zeros",
            order_note,
        ),
    ]


def _mechanical(results: Mapping[str, Result]) -> list[Entry]:
    """Return the entries of the static tests of rail and tyre (Fig. 6.12, 6.13)."""
    entries = []
    for way in ("up", "down"):
        breakaway = float(results[f"rail/{way}"]["breakaway"])
        entries.append(
            factor("Figure 6.13", f"breakaway of the rail, {way}", "50", [breakaway], "N", 1.05)
        )
    force, deflection = (
        np.asarray(results["tyre"]["force"]),
        np.asarray(results["tyre"]["deflection"]),
    )
    # Least squares through the origin: friction acts both ways and cancels.
    line = float(np.sum(force * deflection) / np.sum(deflection**2))
    note = (
        "46 kN/m from the static test, 50 kN/m from the running rig; the nominal rig has the latter"
    )
    entries.append(
        factor(
            "§6.1.3",
            "tyre stiffness, straight line through the origin",
            "46000",
            [line],
            "N/m",
            1.1,
            note,
        )
    )
    entries.append(
        factor("§6.3", "tyre stiffness of the ideal system", "50000", [line], "N/m", 1.02)
    )
    polynomial = np.polynomial.Polynomial.fit(deflection, force, 5)
    remaining = float(np.std(force - polynomial(deflection)))
    text = f"left over {remaining:.0f} N rms: the rail's friction, 50 N either way"
    entries.append(
        statement(
            "Figure 6.12", "5th-order polynomial", "describes the tyre", remaining < 55.0, text
        )
    )
    return entries


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, drawings and remarks of §6.1."""
    frequencies = np.arange(1.0, FITTED + 1.0)
    cylinder, force = mean_response(results, "cylinder"), mean_response(results, "force")
    figure, axes = sheet(2, 2)
    fine = np.geomspace(0.5, 30.0, 400)
    for column, (name, printed, measured) in enumerate(
        (("force loop", thesis_force_loop, force), ("cylinder", thesis_cylinder, cylinder))
    ):
        magnitude, phase = axes[0][column], axes[1][column]
        magnitude.semilogx(fine, _decibel(printed(fine)), color=ASKED, label="thesis")
        magnitude.semilogx(frequencies, _decibel(measured), ".", color=SENSED, label="twin")
        phase.semilogx(fine, np.degrees(np.unwrap(np.angle(printed(fine)))), color=ASKED)
        phase.semilogx(frequencies, np.degrees(np.unwrap(np.angle(measured))), ".", color=SENSED)
        magnitude.set(title=name, ylabel="dB")
        phase.set(xlabel="Hz", ylabel="deg")
        magnitude.legend(fontsize=8)
    bode = Drawing(
        "figure-6.6",
        "Figure 6.4 to 6.11",
        "Schroeder multisines on the twin beside Eq. 6.1 and 6.2.",
        figure,
    )
    figure, axes = sheet(1, 2)
    tyre = results["tyre"]
    axes[0][0].plot(
        1e3 * np.asarray(tyre["deflection"]), tyre["force"], color=SENSED, linewidth=0.9
    )
    axes[0][0].set(
        xlabel="tyre deflection, mm",
        ylabel="N",
        title="pressed and let go: the loop is the rail's friction",
    )
    for way, colour in (("up", SENSED), ("down", ASKED)):
        ramp = results[f"rail/{way}"]
        axes[0][1].plot(ramp["force"], ramp["wheel"], color=colour, label=f"ramped {way}")
    axes[0][1].set(
        xlabel="motor force, N (tyre 200 N)",
        ylabel="carriage, um",
        ylim=(-400, 400),
        title="breakaway",
    )
    axes[0][1].legend(fontsize=8)
    statics = Drawing("figure-6.12", "Figure 6.12 and 6.13", "Static tests.", figure)
    numerator, denominator = fit_transfer_function(frequencies, force, 2, 2)
    remark = "the twin's force loop fitted in the form of Eq. 6.1: "
    remark += (
        f"({numerator[0]:.3g} s^2 {numerator[1]:+.3g} s {numerator[2]:+.3g}) "
        f"/ (s^2 {denominator[1]:+.3g} s {denominator[2]:+.3g})"
    )
    return Conclusion(_entries(results, frequencies), [bode, statics], [remark])


STUDY = ThesisStudy(
    "identification",
    "Identification of actuators, tyre and rail",
    "6",
    ("Equation 6.1", "Equation 6.2", *span("Figure", "6.", 4, 13)),
    conclude,
    jobs,
)
