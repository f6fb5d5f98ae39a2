"""Pictures that show each effect in the data: the kind of picture, and its numbers.

An effect is shown alone: `before` is the prediction with every named effect except this one,
`after` the prediction with it too. The step from one to the other is the effect; the data show
whether they make the same step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigtwin.components.effect import GROUPS
from rigtwin.components.plant import Plant, parameter_of, select, with_parameters
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.localisation import is_angular
from rigtwin.diagnosis.picture import (
    Picture,
    View,
)
from rigtwin.diagnosis.picture_forms import FORMS
from rigtwin.numerics.arrays import Array

PICTURES: dict[str, str] = {
    "coulomb": "velocity",
    "viscous": "velocity",
    "stribeck": "velocity",
    "asymmetry": "velocity",
    "viscous_asymmetry": "velocity",
    "load_friction": "velocity",
    "rounding": "velocity",
    "growth": "velocity",
    "drag": "velocity",
    "damping": "velocity",
    "damping_gain": "velocity",
    "cogging": "pitch",
    "position_force": "position",
    "end_stops": "position",
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
    "slack": "loop",
    "cubic_stiffness": "loop",
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
    "curvature": "line",
    "offset": "line",
    "drift": "record",
    "eccentricity": "position",
    "saturation": "line",
    "deadband": "line",
    "deadband_asymmetry": "line",
    "position_gain": "time",
    "gains": "time",
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
