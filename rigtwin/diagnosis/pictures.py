"""The picture that shows an effect in the data: which one a kind of effect has, and its numbers.

An effect is shown alone: `before` is the prediction with everything that was found but this effect,
`after` the one with it too. What the effect is, is the step from one to the other; the data say
whether they make the same step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigtwin.components import with_parameters
from rigtwin.components.effect import GROUPS, Motion
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.overlay import COUNTS, LOOKED_AT
from rigtwin.numerics.arrays import Array

BINS = 30
"""Of what a residual is drawn against."""
FEWEST = 12
"""Ticks that a bin must hold to be drawn."""
AGREES = 0.1
"""Share by which what the data ask for may differ from what was found and agree with it."""
LONGEST_CYCLE = 10.0
"""s of a loop that is drawn."""
POINTS = 1500
"""Of a cloud."""
EXTREME = 0.004
"""Share of the ticks at either end that no axis reaches out to."""
SEEN = 0.02
"""Share of its greatest amplitude from which a signal's phase is known at a frequency."""
RESPONDS = 40.0
"""Hz, up to which a response is drawn."""


@dataclass(frozen=True)
class Curve:
    """One line or cloud. role: measured, before or after; x, y: in the picture's units."""

    role: str
    x: Array
    y: Array
    points: bool = False


@dataclass(frozen=True)
class Picture:
    """An effect in the data.

    effect: kind@component; form: the picture's name in `FORMS`; recording and sensor: that it is
    of; x, y and their units; curves; logarithmic: which axes are; caption: what to see in it, a
    sentence.
    """

    effect: str
    form: str
    recording: str
    sensor: str
    x: str
    x_unit: str
    y: str
    y_unit: str
    curves: tuple[Curve, ...]
    logarithmic: tuple[bool, bool]
    caption: str


@dataclass(frozen=True)
class View:
    """What a picture is made of: one sensor of one recording, with and without an effect.

    raw: as recorded, with its mains line; motion: of the effect's component; angular: whether it
    turns; counts: ticks that count; all signals of shape (ticks,); period: s.
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
        return self.effect.name.component.replace("_", " ")

    @property
    def sensor_name(self) -> str:
        return self.sensor.replace("_", " ")


def _weigh(view: View) -> str:
    """How much of the effect the data of this picture ask for."""
    there = view.counts > COUNTS
    step = (view.after - view.before)[there]
    power = float(step @ step)
    if power <= 0.0:
        return ""
    share = float(step @ (view.measured - view.before)[there]) / power
    if abs(share - 1.0) < AGREES:
        return f" {view.recording} asks for as much of it as was found."
    return f" {view.recording} asks for {share:.2f} times what was found."


def _stretch(view: View, weight: Array, seconds: float) -> slice:
    """Ticks of the stretch of that length over which a weight, shape (ticks,), is greatest."""
    ticks = min(max(round(seconds / view.period), 2), len(view.time))
    sums = np.concatenate([[0.0], np.cumsum(weight)])
    start = int(np.argmax(sums[ticks:] - sums[:-ticks]))
    return slice(start, start + ticks)


def _cycle(view: View) -> float:
    """s, of one motion to and fro, from 1 to 10; of what hardly reverses 1."""
    speed = view.motion.speed
    turns = np.flatnonzero(np.diff(np.sign(speed - np.mean(speed))) != 0)
    if len(turns) < 3:
        return LOOKED_AT
    apart = np.diff(turns) * view.period
    # Noise about standstill reverses too; the strokes are what takes most of the time.
    typical = float(np.sum(apart**2) / np.sum(apart))
    return min(max(2.2 * typical, LOOKED_AT), LONGEST_CYCLE)


def _picture(
    view: View,
    form: str,
    x: tuple[str, str],
    y: tuple[str, str],
    curves: list[Curve],
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
    """What is left without the effect against something that the component goes through, and what
    the effect says of it. along_what: in the caption, unless it is a quantity of the component."""
    there = view.counts > COUNTS
    along, left = along[there], (view.measured - view.before)[there]
    law = (view.after - view.before)[there]
    low, high = np.quantile(along, [EXTREME, 1.0 - EXTREME])
    edges = np.linspace(low, high, BINS + 1)
    place = np.digitize(along, edges) - 1
    centres = 0.5 * (edges[1:] + edges[:-1])
    filled = [b for b in range(BINS) if np.count_nonzero(place == b) >= FEWEST]
    every = max(1, math.ceil(len(along) / POINTS))

    def average(values: Array) -> Array:
        return np.array([np.mean(values[place == b]) for b in filled])

    within = (along[::every] >= low) & (along[::every] <= high)
    curves = [
        Curve("samples", along[::every][within], left[::every][within], points=True),
        Curve("before", np.array([low, high]), np.zeros(2)),
        Curve("after", centres[filled], average(law)),
        Curve("measured", centres[filled], average(left), points=True),
    ]
    caption = (
        f"What the {view.sensor_name} measured beyond the prediction without {view.effect.name}, "
        f"against {along_what or f'the {name} of the {view.part}'}: the dots (averages of the "
        "data) should lie on the solid line, which is what the effect predicts, and not on zero."
        f"{_weigh(view)}"
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
    acceleration = np.gradient(view.motion.speed, view.period)
    return _against(view, acceleration, "acceleration", "acceleration", unit)


def _over_record(view: View) -> Picture:
    along = view.time - view.time[0]
    return _against(view, along, "record", "time", "s", "the time since the recording's first tick")


def _loop(view: View) -> Picture:
    """Force against displacement in the stroke to and fro that the effect changes most."""
    change = (view.counts > COUNTS) * (view.after - view.before) ** 2
    part = _stretch(view, change, _cycle(view))
    signals = {"measured": view.measured, "before": view.before, "after": view.after}
    length = "rad" if view.angular else "m"
    if view.kind == "force":
        x, y = (f"displacement of the {view.part}", length), (view.sensor_name, view.unit)
        curves = [
            Curve(role, view.motion.position[part], signal[part])
            for role, signal in signals.items()
        ]
    else:
        force = "Nm" if view.angular else "N"
        x, y = (view.sensor_name, view.unit), (f"force at the {view.part}", force)
        curves = [
            Curve(role, signal[part], view.motion.force[part]) for role, signal in signals.items()
        ]
    caption = (
        f"Force against displacement, {view.time[part][0]:.2f} to {view.time[part][-1]:.2f} s: the "
        f"loop with {view.effect.name} should lie on the measured one, the one without it should "
        f"not.{_weigh(view)}"
    )
    return _picture(view, "loop", x, y, curves, caption)


def _phase(view: View) -> Picture:
    """Phase of what was measured, and of the prediction with the effect, behind the prediction
    without it."""
    from scipy.signal import csd, welch  # Late: they are of the report, and take their time.

    length = min(len(view.before), max(64, round(2.0 / view.period)))
    there = view.counts > COUNTS
    signals = {
        "measured": view.measured[there],
        "after": view.after[there],
    }
    base = view.before[there] - np.mean(view.before[there])
    length = min(length, len(base))
    frequency, power = welch(base, 1.0 / view.period, nperseg=length)
    kept = (
        (frequency > 0.0)
        & (frequency <= RESPONDS)
        & (np.sqrt(power) >= SEEN * math.sqrt(float(np.max(power)) + 1e-300))
    )
    curves = [Curve("before", frequency[kept], np.zeros(int(np.count_nonzero(kept))))]
    for role in ("after", "measured"):
        _, cross = csd(base, signals[role], 1.0 / view.period, nperseg=length)
        angle = np.unwrap(np.angle(cross[kept])) if kept.any() else np.zeros(0)
        curves.append(Curve(role, frequency[kept], angle, points=role == "measured"))
    caption = (
        f"By how much the {view.sensor_name} lags the prediction without {view.effect.name}, "
        "frequency by frequency: the dots are the data and should lie on the solid line, which is "
        "the prediction with the effect (a delay is a straight line)."
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


def _line(view: View) -> Picture:
    """Measured, and predicted with the effect, against predicted without it."""
    there = view.counts > COUNTS
    x, y, z = view.before[there], view.measured[there], view.after[there]
    every = max(1, math.ceil(len(x) / POINTS))
    x, y, z = x[::every], y[::every], z[::every]
    order = np.argsort(x)
    ends = np.array([x.min(), x.max()])
    curves = [
        Curve("measured", x, y, points=True),
        Curve("before", ends, ends),
        Curve("after", x[order], z[order], points=True),
    ]
    caption = (
        f"The {view.sensor_name} as measured against the prediction without {view.effect.name}: "
        "were that right, the points would lie on the dashed diagonal; with the effect the "
        f"prediction lies where the data do.{_weigh(view)}"
    )
    return _picture(
        view,
        "line",
        (f"{view.sensor_name} predicted without it", view.unit),
        (f"{view.sensor_name} measured", view.unit),
        curves,
        caption,
    )


def _spectrum(view: View) -> Picture:
    """Amplitude spectra of what the predictions leave of the sensor as it was recorded."""
    from scipy.signal import welch

    there = view.counts > COUNTS
    left = (view.raw - view.after)[there]
    length = min(len(left), max(64, round(2.0 / view.period)))
    frequency, power = welch(left - np.mean(left), 1.0 / view.period, nperseg=length)
    kept = frequency > 0.0
    level = math.sqrt(2.0 * view.period)
    curves = [Curve("measured", frequency[kept], np.sqrt(power[kept]))]
    told = _told_amplitude(view.effect)
    if told is not None:
        ends = np.array([frequency[kept][0], frequency[kept][-1]])
        before, after = told
        curves += [
            Curve("before", ends, np.full(2, before * level)),
            Curve("after", ends, np.full(2, after * level)),
        ]
    caption = (
        f"Spectrum of what is left of the {view.sensor_name}: noise is its level, hum the line at "
        "the mains frequency"
        + ("; the level should lie on the solid line." if told is not None else ".")
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


def _told_amplitude(effect: Finding) -> tuple[float, float] | None:
    """rms of white noise before and after, in the sensor's unit, where the effect is one."""
    if effect.name.kind == "noise":
        (estimate,) = effect.parameters.values()
        return estimate.nominal, estimate.value
    if effect.name.kind == "quantisation":
        (estimate,) = effect.parameters.values()
        return estimate.nominal / math.sqrt(12.0), estimate.value / math.sqrt(12.0)
    return None


def _by_time(view: View) -> Picture:
    """Measured and predicted in the second in which the prediction without it is worst."""
    part = _stretch(view, (view.counts > COUNTS) * (view.measured - view.before) ** 2, LOOKED_AT)
    curves = [
        Curve("measured", view.time[part], view.measured[part]),
        Curve("before", view.time[part], view.before[part]),
        Curve("after", view.time[part], view.after[part]),
    ]
    caption = (
        f"The {view.sensor_name} in the second in which the prediction without "
        f"{view.effect.name} is furthest off: with the effect it should follow the measured "
        f"line.{_weigh(view)}"
    )
    if np.array_equal(view.before, view.after):
        caption = (
            f"The {view.sensor_name} in its worst second. {view.effect.name} was read off the "
            "commands, which the prediction follows as they were recorded: it changes no line here."
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
"""A form's name → what makes the picture."""

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
"""A kind of effect → the form of its picture; every kind has one."""


def without_effect(nominal: Plant, corrected: Plant, effect: Finding) -> Plant:
    """The corrected plant with one effect's parameters as they were.

    Parameters
    ----------
    nominal, corrected
        Before and after the diagnosis.
    effect
        That is taken out; one that is no parameter of the plant changes nothing.

    Returns
    -------
    Plant
        With everything else that was found.
    """
    group = GROUPS.get(effect.name.component, effect.name.component)
    own = getattr(nominal, group, None)
    fields: tuple[str, ...] = getattr(own, "_fields", ())
    back = {name: float(getattr(own, name)) for name in effect.parameters if name in fields}
    return with_parameters(corrected, group, back) if back else corrected


def picture(evidence: Evidence, corrected: Plant, effect: Finding) -> Picture:
    """The picture of one effect, of the recording and sensor that it explains most of.

    Parameters
    ----------
    evidence
        Recordings to show it in.
    corrected
        The plant with all that was found.
    effect
        The finding.

    Returns
    -------
    Picture
        Numbers only.
    """
    less = without_effect(evidence.plant, corrected, effect)
    before, after = evidence.predict(less), evidence.predict(corrected)
    gains = [
        np.sum(lines.fade * ((lines.measured - b) ** 2 - (lines.measured - a) ** 2), axis=1)
        / (lines.noise**2)
        for lines, b, a in zip(evidence.lines, before, after, strict=True)
    ]
    names = evidence.names
    if effect.name.component in names and PICTURES[effect.name.kind] == "spectrum":
        # Noise is its own sensor's, and no prediction tells.
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
    component = evidence.machine.components.get(effect.name.component)
    turning = {replay.joint.name for replay in evidence.machine.replays if replay.joint.turns}
    angular = component is not None and (component.turns or component.joint in turning)
    ticks = lines.measured.shape[1]
    measured = lines.measured[row]
    raw = recording.column(*meaning.channel)[:: model.every]
    return View(
        effect=effect,
        recording=recording.path.name,
        sensor=meaning.name,
        kind=meaning.kind,
        unit=meaning.unit,
        angular=angular,
        time=recording.time[0] + lines.period * np.arange(ticks),
        raw=raw[:ticks],
        measured=measured,
        before=before,
        after=after,
        motion=model.motion(effect.name.component, evidence.plant),
        counts=lines.fade[row],
        period=lines.period,
    )
