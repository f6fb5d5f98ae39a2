"""Pictures that show each effect in the data: the kind of picture, and its numbers.

An effect is shown alone: `before` is the prediction with every named effect except this one,
`after` the prediction with it too. The step from one to the other is the effect; the data show
whether they make the same step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.effect import GROUPS, Motion
from rigtwin.components.plant import Plant, parameter_of, select, with_parameters
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.localisation import is_angular
from rigtwin.diagnosis.overlay import COUNTS, LOOKED_AT
from rigtwin.diagnosis.words import name_part
from rigtwin.numerics.arrays import Array

BINS = 30
"""Bins of the axis against which a residual is drawn."""
FEWEST = 12
"""Ticks that a bin must hold to be drawn."""
AGREES = 0.1
"""Relative difference between the fitted size of an effect and that of the nominal one below which
they agree."""
CYCLE_FACTOR = 2.2
"""Length of a drawn loop in half strokes: one stroke to and fro, and a little more."""
LONGEST_CYCLE = 10.0
"""Longest loop that is drawn, s."""
POINTS = 1500
"""Points of a cloud at most."""
EXTREME = 0.004
"""Share of the ticks at either end that lies outside of the axis."""
VISIBLE = 0.02
"""Amplitude, relative to the largest, from which a signal's phase at a frequency is drawn."""
RESPONDS = 40.0
"""Frequency up to which a response is drawn, Hz."""
SEGMENT, SHORTEST_SEGMENT = 2.0, 64
"""Length of the segments of a spectrum, s, and the fewest ticks of one."""


@dataclass(frozen=True)
class PictureCurve:
    """One line or cloud of points of a picture.

    Attributes
    ----------
    role
        "measured", "before", "after" or "samples".
    x, y
        Coordinates in the picture's units, shape (points,).
    points
        True for a cloud of points, False for a line.
    """

    role: str
    x: Array
    y: Array
    points: bool = False


@dataclass(frozen=True)
class Picture:
    """An effect in the data.

    Attributes
    ----------
    effect
        Name of the effect, `kind@component`.
    form
        Form of the picture, a key of `FORMS`.
    recording, sensor
        Recording and sensor that it shows.
    x, x_unit, y, y_unit
        Labels and SI units of the axes.
    curves
        Lines and clouds.
    logarithmic
        Whether the x axis and the y axis are logarithmic.
    caption
        Sentences that tell what to see in it.
    """

    effect: str
    form: str
    recording: str
    sensor: str
    x: str
    x_unit: str
    y: str
    y_unit: str
    curves: tuple[PictureCurve, ...]
    logarithmic: tuple[bool, bool]
    caption: str


@dataclass(frozen=True)
class View:
    """Data of a picture: one sensor of one recording, with and without an effect.

    Attributes
    ----------
    effect
        Effect that is shown.
    recording, sensor, kind, unit
        Name of the recording, name and kind of the sensor, and the SI unit of its signal.
    angular
        Whether the effect's component turns.
    time
        Time, s, shape (ticks,).
    raw
        Signal as recorded, with its mains hum, in `unit`, shape (ticks,).
    measured, before, after
        Signal, and predictions without and with the effect, in `unit`, shape (ticks,).
    motion
        Motion of the effect's component.
    counts
        Weight of each tick, 0 to 1, shape (ticks,).
    period
        Duration of a tick, s.
    """

    effect: Finding
    recording: str
    sensor: str
    kind: str
    unit: str
    angular: bool
    time: Array
    raw: Array
    measured: Array
    before: Array
    after: Array
    motion: Motion
    counts: Array
    period: float

    @property
    def part(self) -> str:
        """Component of the effect in words."""
        return name_part(self.effect.name.component)

    @property
    def sensor_name(self) -> str:
        """Sensor in words."""
        return name_part(self.sensor)

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Ticks that count, shape (ticks,)."""
        return self.counts > COUNTS


def _compare_size(view: View) -> str:
    """Sentence on the size of the effect in this recording, relative to the fitted one.

    It is the slope of a regression of the residual on the effect's own response d,
    dᵀ(measured - before) / dᵀd; 1 if the recording agrees with the fit.
    """
    response = (view.after - view.before)[view.counted]
    power = float(response @ response)
    if power <= 0.0:
        return ""
    ratio = float(response @ (view.measured - view.before)[view.counted]) / power
    if abs(ratio - 1.0) < AGREES:
        return f" In {view.recording} the effect has the fitted size."
    return f" In {view.recording} the effect has {ratio:.2f} times the fitted size."


def _stretch(view: View, weight: Array, seconds: float) -> slice:
    """Ticks of the stretch of that length with the largest sum of a weight, shape (ticks,)."""
    ticks = min(max(round(seconds / view.period), 2), len(view.time))
    # Differences of the cumulative sum are the sums over all windows of that length.
    sums = np.concatenate([[0.0], np.cumsum(weight)])
    start = int(np.argmax(sums[ticks:] - sums[:-ticks]))
    return slice(start, start + ticks)


def _cycle(view: View) -> float:
    """Duration of one stroke to and fro, 1 to 10 s; 1 s for a motion that hardly reverses."""
    speed = view.motion.speed
    turns = np.flatnonzero(np.diff(np.sign(speed - np.mean(speed))) != 0)
    if len(turns) < 3:
        return LOOKED_AT
    strokes = np.diff(turns) * view.period
    # Noise at standstill reverses too. Weighted by their duration, the strokes outweigh it.
    typical = float(np.sum(strokes**2) / np.sum(strokes))
    return min(max(CYCLE_FACTOR * typical, LOOKED_AT), LONGEST_CYCLE)


def _picture(
    view: View,
    form: str,
    x: tuple[str, str],
    y: tuple[str, str],
    curves: list[PictureCurve],
    caption: str,
    logarithmic: tuple[bool, bool] = (False, False),
) -> Picture:
    return Picture(
        str(view.effect.name),
        form,
        view.recording,
        view.sensor,
        *x,
        *y,
        tuple(curves),
        logarithmic,
        caption,
    )


def _against(
    view: View, along: Array, form: str, name: str, unit: str, along_what: str = ""
) -> Picture:
    """Residual without the effect, and the effect's response, against a regressor.

    along: regressor, shape (ticks,); name, unit: its label and SI unit; along_what: its name in the
    caption, unless it is a quantity of the component.
    """
    counted = view.counted
    along, residual = along[counted], (view.measured - view.before)[counted]
    law = (view.after - view.before)[counted]
    # Quantiles keep a few fast ticks from squeezing all others into the middle of the axis.
    low, high = np.quantile(along, [EXTREME, 1.0 - EXTREME])
    edges = np.linspace(low, high, BINS + 1)
    # -1 and `BINS` are the places of values outside of the axis, which belong to no bin.
    place = np.digitize(along, edges) - 1
    centres = 0.5 * (edges[1:] + edges[:-1])
    filled = [b for b in range(BINS) if np.count_nonzero(place == b) >= FEWEST]
    # Only the cloud is thinned. The averages use every tick.
    every = max(1, math.ceil(len(along) / POINTS))

    def average(values: Array) -> Array:
        return np.array([np.mean(values[place == b]) for b in filled])

    within = (along[::every] >= low) & (along[::every] <= high)
    curves = [
        PictureCurve("samples", along[::every][within], residual[::every][within], points=True),
        PictureCurve("before", np.array([low, high]), np.zeros(2)),
        PictureCurve("after", centres[filled], average(law)),
        PictureCurve("measured", centres[filled], average(residual), points=True),
    ]
    caption = (
        f"Residual of the {view.sensor_name} without {view.effect.name}, against "
        f"{along_what or f'the {name} of the {view.part}'}. The dots (averages of the data) should "
        "lie on the solid line, which is the response to the effect, and not on zero."
        f"{_compare_size(view)}"
    )
    return _picture(
        view, form, (f"{name}", unit), (f"{view.sensor_name}, residual", view.unit), curves, caption
    )


def _by_velocity(view: View) -> Picture:
    unit = "rad/s" if view.angular else "m/s"
    return _against(view, view.motion.speed, "velocity", "velocity", unit)


def _by_position(view: View) -> Picture:
    unit = "rad" if view.angular else "m"
    return _against(view, view.motion.position, "position", "position", unit)


def _by_acceleration(view: View) -> Picture:
    unit = "rad/s²" if view.angular else "m/s²"
    # Central differences have no delay, which would turn the averages into a loop.
    acceleration = np.gradient(view.motion.speed, view.period)
    return _against(view, acceleration, "acceleration", "acceleration", unit)


def _over_record(view: View) -> Picture:
    along = view.time - view.time[0]
    return _against(
        view, along, "record", "time", "s", "the time since the first tick of the recording"
    )


def _loop(view: View) -> Picture:
    """Force against displacement in the stroke to and fro that the effect changes most.

    Play, springs and compliance change the shape of this loop.
    """
    change = view.counted * (view.after - view.before) ** 2
    part = _stretch(view, change, _cycle(view))
    signals = {"measured": view.measured, "before": view.before, "after": view.after}
    length = "rad" if view.angular else "m"
    if view.kind == "force":
        x, y = (f"displacement of the {view.part}", length), (view.sensor_name, view.unit)
        curves = [
            PictureCurve(role, view.motion.position[part], signal[part])
            for role, signal in signals.items()
        ]
    else:
        force = "Nm" if view.angular else "N"
        x, y = (view.sensor_name, view.unit), (f"force at the {view.part}", force)
        curves = [
            PictureCurve(role, signal[part], view.motion.force[part])
            for role, signal in signals.items()
        ]
    caption = (
        f"Force against displacement, {view.time[part][0]:.2f} to {view.time[part][-1]:.2f} s. The "
        f"loop predicted with {view.effect.name} should lie on the measured one, and the loop "
        f"without it should not.{_compare_size(view)}"
    )
    return _picture(view, "loop", x, y, curves, caption)


def _phase(view: View) -> Picture:
    """Phase of the measured signal and of the prediction with the effect, against that without it.

    The phase is that of the cross spectrum; a delay T is the straight line -2π f T.
    """
    # Imported here, because scipy.signal is slow to import and only a report needs it.
    from scipy.signal import csd, welch

    counted = view.counted
    signals = {"measured": view.measured[counted], "after": view.after[counted]}
    base = view.before[counted] - np.mean(view.before[counted])
    length = _segment_length(view, len(base))
    frequency, power = welch(base, 1.0 / view.period, nperseg=length)
    # Where the signal has hardly any power the phase is that of noise, and would upset `unwrap`.
    drawn = (
        (frequency > 0.0)
        & (frequency <= RESPONDS)
        & (np.sqrt(power) >= VISIBLE * math.sqrt(float(np.max(power)) + 1e-300))
    )
    curves = [PictureCurve("before", frequency[drawn], np.zeros(int(np.count_nonzero(drawn))))]
    for role in ("after", "measured"):
        # scipy conjugates the first argument, so the angle is that of the signal against the base:
        # a delay has a falling phase.
        _, cross = csd(base, signals[role], 1.0 / view.period, nperseg=length)
        angle = np.unwrap(np.angle(cross[drawn])) if drawn.any() else np.zeros(0)
        curves.append(PictureCurve(role, frequency[drawn], angle, points=role == "measured"))
    caption = (
        f"Phase of the {view.sensor_name} against the prediction without {view.effect.name}. The "
        "dots are the data and should lie on the solid line, which is the prediction with the "
        "effect. A delay is a straight line."
    )
    return _picture(
        view=view,
        form="phase",
        x=("frequency", "Hz"),
        y=(f"{view.sensor_name}, phase", "rad"),
        curves=curves,
        caption=caption,
        logarithmic=(False, False),
    )


def _segment_length(view: View, ticks: int) -> int:
    """Ticks of one segment of Welch's method: 2 s, or the whole of a shorter recording."""
    return min(ticks, max(SHORTEST_SEGMENT, round(SEGMENT / view.period)))


def _line(view: View) -> Picture:
    """Measured signal, and prediction with the effect, against the prediction without it.

    A gain is a slope, an offset a shift and a saturation a plateau.
    """
    counted = view.counted
    # The corrected prediction is a cloud as well: a lag or a play gives it several values for one
    # nominal value.
    x, y, z = view.before[counted], view.measured[counted], view.after[counted]
    every = max(1, math.ceil(len(x) / POINTS))
    x, y, z = x[::every], y[::every], z[::every]
    order = np.argsort(x)
    ends = np.array([x.min(), x.max()])
    curves = [
        PictureCurve("measured", x, y, points=True),
        PictureCurve("before", ends, ends),
        PictureCurve("after", x[order], z[order], points=True),
    ]
    caption = (
        f"Measured {view.sensor_name} against the prediction without {view.effect.name}. If that "
        "were right, the points would lie on the dashed diagonal. The prediction with the effect "
        f"should lie on the data.{_compare_size(view)}"
    )
    return _picture(
        view,
        "line",
        (f"{view.sensor_name} predicted without the effect", view.unit),
        (f"{view.sensor_name} measured", view.unit),
        curves,
        caption,
    )


def _spectrum(view: View) -> Picture:
    """Amplitude spectrum of the residual of the sensor as it was recorded."""
    # Imported here, because scipy.signal is slow to import and only a report needs it.
    from scipy.signal import welch

    # `measured` lacks the mains line, which belongs into this picture.
    residual = (view.raw - view.after)[view.counted]
    length = _segment_length(view, len(residual))
    frequency, power = welch(residual - np.mean(residual), 1.0 / view.period, nperseg=length)
    positive = frequency > 0.0
    # White noise of rms σ has the one-sided density σ sqrt(2 T) at a sampling period T.
    level = math.sqrt(2.0 * view.period)
    curves = [PictureCurve("measured", frequency[positive], np.sqrt(power[positive]))]
    white = _white_noise(view.effect)
    if white is not None:
        ends = np.array([frequency[positive][0], frequency[positive][-1]])
        before, after = white
        curves += [
            PictureCurve("before", ends, np.full(2, before * level)),
            PictureCurve("after", ends, np.full(2, after * level)),
        ]
    caption = (
        f"Spectrum of the residual of the {view.sensor_name}. Noise is its level, and hum the line "
        "at the mains frequency."
        + (" The level should lie on the solid line." if white is not None else "")
    )
    return _picture(
        view=view,
        form="spectrum",
        x=("frequency", "Hz"),
        y=(f"{view.sensor_name}, residual", f"{view.unit}/√Hz"),
        curves=curves,
        caption=caption,
        logarithmic=(True, True),
    )


def _white_noise(effect: Finding) -> tuple[float, float] | None:
    """Rms of white noise before and after, in the sensor's unit; None for any other effect."""
    if effect.name.kind == "noise":
        (estimate,) = effect.parameters.values()
        return estimate.nominal, estimate.value
    if effect.name.kind == "quantisation":
        (estimate,) = effect.parameters.values()
        # Rounding to steps of q is uniform noise of rms q / sqrt(12).
        return estimate.nominal / math.sqrt(12.0), estimate.value / math.sqrt(12.0)
    return None


def _by_time(view: View) -> Picture:
    """Signals over time in the second with the largest error without the effect."""
    part = _stretch(view, view.counted * (view.measured - view.before) ** 2, LOOKED_AT)
    curves = [
        PictureCurve("measured", view.time[part], view.measured[part]),
        PictureCurve("before", view.time[part], view.before[part]),
        PictureCurve("after", view.time[part], view.after[part]),
    ]
    caption = (
        f"The {view.sensor_name} in the second with the largest error of the prediction without "
        f"{view.effect.name}. The prediction with the effect should follow the measured "
        f"line.{_compare_size(view)}"
    )
    if np.array_equal(view.before, view.after):
        caption = (
            f"The {view.sensor_name} in the second with its largest error. {view.effect.name} was "
            "read off the recorded commands, which the prediction follows: it changes no line here."
        )
    return _picture(view, "time", ("time", "s"), (view.sensor_name, view.unit), curves, caption)


FORMS: dict[str, Callable[[View], Picture]] = {
    "velocity": _by_velocity,
    "position": _by_position,
    "acceleration": _by_acceleration,
    "record": _over_record,
    "loop": _loop,
    "phase": _phase,
    "line": _line,
    "spectrum": _spectrum,
    "time": _by_time,
}
"""Form of a picture → function that makes it."""

PICTURES: dict[str, str] = {
    "coulomb": "velocity",
    "viscous": "velocity",
    "stribeck": "velocity",
    "asymmetry": "velocity",
    "viscous_asymmetry": "velocity",
    "load_friction": "velocity",
    "drag": "velocity",
    "damping": "velocity",
    "damping_gain": "velocity",
    "cogging": "position",
    "position_force": "position",
    "mass": "acceleration",
    "armature": "acceleration",
    "inertia": "acceleration",
    "payload": "acceleration",
    "lever_x": "position",
    "lever_y": "position",
    "lever_z": "position",
    "tilt_x": "position",
    "tilt_y": "position",
    "tilt_z": "position",
    "backlash": "loop",
    "stiffness": "loop",
    "hardening": "loop",
    "compliance": "loop",
    "mount": "loop",
    "relaxation": "loop",
    "lag": "phase",
    "two_lags": "phase",
    "resonance": "phase",
    "delay": "phase",
    "gain": "line",
    "gain_asymmetry": "line",
    "offset": "line",
    "drift": "record",
    "saturation": "line",
    "deadband": "line",
    "deadband_asymmetry": "line",
    "position_gain": "time",
    "force_limit": "time",
    "rate_limit": "time",
    "hum": "spectrum",
    "noise": "spectrum",
    "quantisation": "spectrum",
    "missed_ticks": "time",
    "setting": "time",
}
"""Kind of effect → form of its picture. Every kind has one."""


def without_effect(nominal: Plant, corrected: Plant, effect: Finding) -> Plant:
    """Return the corrected plant with the parameters of one effect at their nominal values.

    Parameters
    ----------
    nominal, corrected
        Plants before and after the correction.
    effect
        Effect that is removed. One that is no parameter of the plant changes nothing.

    Returns
    -------
    Plant
        Plant with all other corrections.
    """
    group = GROUPS.get(effect.name.component, effect.name.component)
    if group not in nominal._fields:
        return corrected
    (component,) = select(nominal, [group])
    values = {
        name: parameter_of(nominal, group, name)
        for name in effect.parameters
        if name in component._fields
    }
    return with_parameters(corrected, group, values)


def picture(evidence: Evidence, corrected: Plant, effect: Finding) -> Picture:
    """Return the picture of one effect, in the recording and sensor where it explains most.

    Parameters
    ----------
    evidence
        Recordings to show it in.
    corrected
        Plant with all corrections.
    effect
        Effect to be shown.

    Returns
    -------
    Picture
        Numbers only; `figures` draws them.
    """
    reduced = without_effect(evidence.plant, corrected, effect)
    before, after = evidence.predict(reduced), evidence.predict(corrected)
    # Decrease of χ² by the effect, for each sensor of each recording.
    gains = [
        np.sum(lines.fade * ((lines.measured - b) ** 2 - (lines.measured - a) ** 2), axis=1)
        / (lines.noise**2)
        for lines, b, a in zip(evidence.lines, before, after, strict=True)
    ]
    names = evidence.names
    if effect.name.component in names and PICTURES[effect.name.kind] == "spectrum":
        # Noise changes no prediction, so its sensor is known but no recording explains most.
        number, row = 0, names.index(effect.name.component)
    else:
        number = int(np.argmax([np.max(gain) for gain in gains]))
        row = int(np.argmax(gains[number]))
    view = _view(evidence, effect, number, row, before[number][row], after[number][row])
    return FORMS[PICTURES[effect.name.kind]](view)


def _view(
    evidence: Evidence, effect: Finding, number: int, row: int, before: Array, after: Array
) -> View:
    lines, recording = evidence.lines[number], evidence.recordings[number]
    model: Any = evidence.models[number]
    meaning = evidence.machine.rows[row]
    ticks = lines.measured.shape[1]
    measured = lines.measured[row]
    # The model may take every n-th tick only.
    raw = recording.column(*meaning.channel)[:: model.every]
    return View(
        effect=effect,
        recording=recording.path.name,
        sensor=meaning.name,
        kind=meaning.kind,
        unit=meaning.unit,
        angular=is_angular(evidence.machine, effect.name.component),
        time=recording.time[0] + lines.period * np.arange(ticks),
        raw=raw[:ticks],
        measured=measured,
        before=before,
        after=after,
        motion=model.motion(effect.name.component, evidence.plant),
        counts=lines.fade[row],
        period=lines.period,
    )
