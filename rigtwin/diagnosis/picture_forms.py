"""Forms of pictures: residual against a regressor, loop, phase, line, spectrum and time."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.overlay import LOOKED_AT
from rigtwin.diagnosis.picture import (
    Picture,
    PictureCurve,
    View,
    compare_size,
    cycle_duration,
    make_picture,
    stretch,
)
from rigtwin.numerics.arrays import Array

BINS = 30
"""Bins of the axis against which a residual is drawn."""
FEWEST = 12
"""Ticks that a bin must hold to be drawn."""
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
        f"{compare_size(view)}"
    )
    return make_picture(
        view, form, (f"{name}", unit), (f"{view.sensor_name}, residual", view.unit), curves, caption
    )


def _by_velocity(view: View) -> Picture:
    unit = "rad/s" if view.angular else "m/s"
    return _against(view, view.motion.speed, "velocity", "velocity", unit)


def _by_position(view: View) -> Picture:
    unit = "rad" if view.angular else "m"
    return _against(view, view.motion.position, "position", "position", unit)


def _by_pitch(view: View) -> Picture:
    unit = "rad" if view.angular else "m"
    # Many waves along a stroke would fall between the bins; all pitches lie on one another.
    place = np.mod(view.motion.position, view.effect.parameters["cogging_pitch"].value)
    along_what = f"the position of the {view.part} within one pitch"
    return _against(view, place, "pitch", "position within one pitch", unit, along_what)


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
    part = stretch(view, change, cycle_duration(view))
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
        f"without it should not.{compare_size(view)}"
    )
    return make_picture(view, "loop", x, y, curves, caption)


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
    return make_picture(
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
    # The dashed line is the diagonal: a prediction against itself.
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
        f"should lie on the data.{compare_size(view)}"
    )
    return make_picture(
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
    return make_picture(
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
    part = stretch(view, view.counted * (view.measured - view.before) ** 2, LOOKED_AT)
    curves = [
        PictureCurve("measured", view.time[part], view.measured[part]),
        PictureCurve("before", view.time[part], view.before[part]),
        PictureCurve("after", view.time[part], view.after[part]),
    ]
    caption = (
        f"The {view.sensor_name} in the second with the largest error of the prediction without "
        f"{view.effect.name}. The prediction with the effect should follow the measured "
        f"line.{compare_size(view)}"
    )
    if np.array_equal(view.before, view.after):
        caption = (
            f"The {view.sensor_name} in the second with its largest error. {view.effect.name} was "
            "read off the recorded commands, which the prediction follows: it changes no line here."
        )
    return make_picture(view, "time", ("time", "s"), (view.sensor_name, view.unit), curves, caption)


FORMS: dict[str, Callable[[View], Picture]] = {
    "velocity": _by_velocity,
    "position": _by_position,
    "pitch": _by_pitch,
    "acceleration": _by_acceleration,
    "record": _over_record,
    "loop": _loop,
    "phase": _phase,
    "line": _line,
    "spectrum": _spectrum,
    "time": _by_time,
}
"""Form of a picture → function that makes it."""
