"""Report of a diagnosis: one HTML file that needs no network, or its print as PDF or PNG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from rigtwin import __version__
from rigtwin.components import KINDS
from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.answer import Answer
from rigtwin.diagnosis.confounded_text import describe_confounded
from rigtwin.diagnosis.explain import candidates
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.overlay import Overlay
from rigtwin.diagnosis.report_bars import bars
from rigtwin.diagnosis.text import against_nominal, list_rivals
from rigtwin.diagnosis.units import find_unit, shorten, spell
from rigtwin.diagnosis.units import write as write_size
from rigtwin.diagnosis.words import name_part
from rigtwin.files import atomic_write
from rigtwin.render.browser import write_pdf, write_png

if TYPE_CHECKING:
    from rigtwin.diagnosis.result import Diagnosis


WRITERS = {".pdf": write_pdf, ".png": write_png}
"""Ending of a file's name → function that writes it. Every other ending is HTML."""


WORSE = 1.5
"""The report warns of a recording whose error exceeds the sensor's median error by this factor."""
TOLERABLE = 10.0
"""Error below which the report never warns, in percent of the signal's standard deviation."""
NEGLIGIBLE = 0.02
"""Ratio of standard deviations, predicted to measured, below which a twin predicts almost
nothing."""
CONFIDENCE = "the probability that this effect is present, among all hypotheses that were tried"


def headlines(overlays: Sequence[Overlay], corrected: bool) -> list[str]:
    """Return sentences on the error before and after the correction, and on a poor recording.

    Parameters
    ----------
    overlays
        Overlays of all recordings and sensors.
    corrected
        Whether an effect was named, so that there is a corrected twin.

    Returns
    -------
    list of str
        Sentences for the top of the report.
    """
    if not overlays:
        return []
    sentences = []
    if all(float(np.std(each.nominal)) < NEGLIGIBLE * each.swing for each in overlays):
        sentences.append(
            "The nominal twin predicts almost nothing of these signals: the named effects identify "
            "the machine rather than correct a model of it."
        )
    if not corrected:
        return sentences
    held_out = [each for each in overlays if each.held_out]
    # The error on fitted data is optimistic, so only held-out recordings count if there are any.
    counted = held_out or list(overlays)
    after = [each.after_percent for each in counted]
    before = [each.before_percent for each in counted]
    data = "recordings that were not fitted" if held_out else "the recordings"
    sentences.append(
        f"Rms of measured minus predicted on {data}, in percent of the signal's standard "
        f"deviation: {_between(before)} before, {_between(after)} after."
    )
    beyond = [_beyond_noise(each) for each in counted]
    worst = int(np.argmax(beyond))
    # The same sensor in the other recordings is the reference, as sensors differ in their share of
    # noise.
    same_sensor = [
        error
        for each, error in zip(counted, beyond, strict=True)
        if each.sensor == counted[worst].sensor
    ]
    if beyond[worst] > max(WORSE * float(np.median(same_sensor)), TOLERABLE):
        sentences.append(
            f"In {counted[worst].recording} the residual of the "
            f"{name_part(counted[worst].sensor)} is {spell(after[worst], 3)} % of the signal: do "
            "not rely on the corrected twin in such tests."
        )
    return sentences


def _beyond_noise(overlay: Overlay) -> float:
    """Rms residual beyond the sensor's noise, in percent of the signal's standard deviation."""
    return 100.0 * math.sqrt(max(overlay.after**2 - overlay.noise**2, 0.0)) / overlay.swing


def _between(values: Sequence[float]) -> str:
    """Write the range of some percentages."""
    low, high = (spell(end, 3) for end in (min(values), max(values)))
    return f"{low} %" if low == high else f"{low} to {high} %"


def html(diagnosis: Diagnosis) -> str:
    """Return the HTML page of a diagnosis.

    Parameters
    ----------
    diagnosis
        Diagnosis of any verdict.

    Returns
    -------
    str
        Page with styles, scripts and data inside.
    """
    # Bokeh takes a second to import, and a diagnosis without a report does not need it.
    from rigtwin.diagnosis import figures

    answer = diagnosis.answer
    overlays = diagnosis.overlays()
    corrected = bool(answer.effects)
    drawings = figures.draw(diagnosis.pictures(), overlays, corrected)
    # The drawing of the machine marks the components of effects and of located residuals.
    guilty = {effect.name.component for effect in answer.effects} | {
        place.component for place in answer.where
    }
    return (
        _environment()
        .get_template("report.html")
        .render(
            diagnosis=answer,
            guilty=guilty,
            bars=bars(answer),
            drawings=drawings,
            overlays=overlays,
            corrected=corrected,
            advice=advise(answer),
            title_of=title_of,
            meaning_of=meaning_of,
            share_of=share_of,
            list_rivals=list_rivals,
            dependences=[describe_confounded(entry) for entry in answer.confounded],
            headlines=headlines(overlays, corrected),
            tested=list(dict.fromkeys(each.recording for each in overlays if each.held_out)),
            confidence=CONFIDENCE,
            weight="weight among the hypotheses tried",
            spell=spell,
            sensor_units=_sensor_units(overlays),
            step_units=_step_units(answer),
            against_nominal=against_nominal,
            write=write_size,
            recordings=[Path(name).name for name in answer.recordings],
            title=diagnosis.described.title,
            components=list(diagnosis.evidence.machine.components)
            if diagnosis.evidence is not None
            else [],
            tried=len(candidates(diagnosis.evidence)) if diagnosis.evidence is not None else 0,
            version=__version__,
        )
    )


def _environment() -> Environment:
    """Environment of the template; a misspelt variable raises rather than leaving a gap."""
    environment = Environment(
        loader=PackageLoader("rigtwin.diagnosis"),
        # Names of files and channels come from outside and could otherwise inject HTML.
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["code"] = _code
    return environment


def _step_units(answer: Answer) -> dict[str, tuple[float, str]]:
    """Factor from SI, and display unit, of each signal's residual; the same in all steps."""
    return {
        name: shorten(unit, *(step.residual[name] for step in answer.steps))
        for name, unit in answer.units.items()
    }


def _sensor_units(overlays: Sequence[Overlay]) -> dict[str, tuple[float, str]]:
    """Factor from SI, and display unit, of each sensor's errors; the same in all rows."""
    largest: dict[str, float] = {}
    for row in overlays:
        largest[row.sensor] = max(largest.get(row.sensor, 0.0), row.before, row.after)
    return {row.sensor: find_unit(row.unit, largest[row.sensor]) for row in overlays}


def title_of(effect: Finding) -> str:
    """Return an effect and its component in words, as a title."""
    return f"{effect.title[0].upper()}{effect.title[1:]}, {name_part(effect.name.component)}"


def share_of(effect: Finding) -> str:
    """Return an effect's share of the gap in percent."""
    return "under 1 %" if 0.0 < effect.share < 0.01 else f"{100.0 * effect.share:.0f} %"


def meaning_of(effect: Finding) -> str:
    """Return what an effect does, in words.

    Some kinds have a different meaning for a negative value: a negative lag is a lead.
    """
    kinds = [kind for kind in KINDS if kind.name == effect.name.kind]
    if not kinds:
        return ""
    # Some names are shared: the viscous friction of a guide, and one that follows a channel.
    kind = next((kind for kind in kinds if kind.title == effect.title), kinds[0])
    estimate = effect.parameters.get(kind.parameters[0])
    below = estimate is not None and estimate.value < 0.0
    return kind.negative if below and kind.negative else kind.meaning


def _code(text: str) -> Markup:
    """Mark the text between backquotes as code, and escape the rest."""
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if number % 2 else escape(part)
        for number, part in enumerate(text.split("`"))
    )


def write(path: Path, diagnosis: Diagnosis) -> Path:
    """Write the report.

    Parameters
    ----------
    path
        File to be written; its ending chooses HTML, PDF or PNG.
    diagnosis
        Diagnosis of any verdict.

    Returns
    -------
    Path
        Path of the written file.

    Raises
    ------
    RigtwinError
        If the file cannot be written, or no browser is installed to print it.
    """
    WRITERS.get(path.suffix.lower(), atomic_write)(path, html(diagnosis))
    return path
