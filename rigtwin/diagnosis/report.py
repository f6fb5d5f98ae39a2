"""The diagnosis as one HTML file to look at: no network, readable on a telephone and on paper; and
as a browser prints it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from rigtwin import __version__
from rigtwin.components import KINDS
from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.explain import candidates
from rigtwin.diagnosis.finding import Answer, Finding
from rigtwin.diagnosis.overlay import Overlay
from rigtwin.diagnosis.text import against_nominal, largest_left
from rigtwin.diagnosis.units import say, spell
from rigtwin.diagnosis.units import write as write_size
from rigtwin.diagnosis.words import name_part
from rigtwin.files import atomic_write
from rigtwin.render.browser import write_pdf, write_png

if TYPE_CHECKING:
    from rigtwin.diagnosis.result import Diagnosis


WRITERS = {".pdf": write_pdf, ".png": write_png}
"""By the ending of the file's name; HTML otherwise."""


@dataclass(frozen=True)
class Bar:
    """A gap before and after in noise floors, and the widths of its bars in percent."""

    name: str
    before: float
    after: float
    before_width: float
    after_width: float
    floor_width: float


def bars(answer: Answer) -> list[Bar]:
    """All sensors together, then each component's replay; widths on a scale common to all."""
    if answer.gap is None:
        return []
    gap = answer.gap
    levels = [("all sensors", gap.before, gap.after)]
    replays = [
        (name.replace("_", " "), level.before, level.after) for name, level in gap.replays.items()
    ]
    levels = [*levels, *replays] if len(replays) > 1 else replays or levels
    largest = max(max(before, after, 1.0) for _, before, after in levels)

    def width(value: float) -> float:
        return 100.0 * value / largest

    return [Bar(name, b, a, width(b), width(a), width(1.0)) for name, b, a in levels]


WORSE = 1.5
"""Times a sensor's typical error of the recordings from which the worst of them is told at the
top,"""
TOLERABLE = 10.0
"""if it is more than so many percent of the signal."""
NEXT_TO_NOTHING = 0.02
"""Share of the signals' swing below which a twin predicts nothing."""
CONFIDENCE = "the probability that it is this effect, among all hypotheses that were tried"


def headlines(overlays: Sequence[Overlay], corrected: bool) -> list[str]:
    """How good the twin is before and after in percent of the signals, and where it is not.

    Parameters
    ----------
    overlays
        Of a diagnosis.
    corrected
        Whether anything was found.

    Returns
    -------
    list of str
        Sentences.
    """
    if not overlays:
        return []
    said = []
    if all(float(np.std(each.nominal)) < NEXT_TO_NOTHING * each.swing for each in overlays):
        said.append(
            "The nominal twin predicts next to nothing of these signals: what was found identifies "
            "the machine, rather than correcting a model of it."
        )
    if not corrected:
        return said
    held = [each for each in overlays if each.held_out]
    counted = held or list(overlays)
    after = [each.after_percent for each in counted]
    before = [each.before_percent for each in counted]
    data = "recordings that were not fitted" if held else "the recordings"
    said.append(
        f"Rms of measured less predicted on {data}, in percent of the signal's standard "
        f"deviation: {_between(before)} before, {_between(after)} after."
    )
    beyond = [_beyond_noise(each) for each in counted]
    worst = int(np.argmax(beyond))
    alike = [
        b for each, b in zip(counted, beyond, strict=True) if each.sensor == counted[worst].sensor
    ]
    if beyond[worst] > max(WORSE * float(np.median(alike)), TOLERABLE):
        said.append(
            f"In {counted[worst].recording} {spell(after[worst], 3)} % is left of the "
            f"{counted[worst].sensor.replace('_', ' ')}: do not rely on the corrected twin in such "
            "tests."
        )
    return said


def _beyond_noise(overlay: Overlay) -> float:
    """What is left of a sensor, its noise taken off, in percent of its standard deviation."""
    return 100.0 * math.sqrt(max(overlay.after**2 - overlay.noise**2, 0.0)) / overlay.swing


def _between(values: Sequence[float]) -> str:
    """The least and the greatest of some figures."""
    low, high = (spell(end, 3) for end in (min(values), max(values)))
    return f"{low} %" if low == high else f"{low} to {high} %"


def html(diagnosis: Diagnosis) -> str:
    """The page."""
    environment = Environment(
        loader=PackageLoader("rigtwin.diagnosis"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["code"] = _code
    # Bokeh is slow to import, and a diagnosis without a report does without it.
    from rigtwin.diagnosis import figures

    answer = diagnosis.answer
    overlays = diagnosis.overlays()
    corrected = bool(answer.effects)
    drawings = figures.draw(diagnosis.pictures(), overlays, corrected)
    guilty = {effect.name.component for effect in answer.effects} | {
        place.component for place in answer.where
    }
    return environment.get_template("report.html").render(
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
        headlines=headlines(overlays, corrected),
        tested=list(dict.fromkeys(each.recording for each in overlays if each.held_out)),
        confidence=CONFIDENCE,
        weight="weight among those tried",
        spell=spell,
        say=say,
        against_nominal=against_nominal,
        write=write_size,
        largest={
            unit: max(max(each.before, each.noise) for each in overlays if each.unit == unit)
            for unit in {each.unit for each in overlays}
        },
        largest_left=largest_left(answer),
        recordings=[Path(each).name for each in answer.recordings],
        title=diagnosis.described.title,
        components=list(diagnosis.evidence.machine.components)
        if diagnosis.evidence is not None
        else [],
        tried=len(candidates(diagnosis.evidence)) if diagnosis.evidence is not None else 0,
        version=__version__,
    )


def title_of(effect: Finding) -> str:
    """An effect in words, with its component."""
    return f"{effect.title[0].upper()}{effect.title[1:]}, {name_part(effect.name.component)}"


def share_of(effect: Finding) -> str:
    """An effect's share of the gap in percent."""
    return "under 1 %" if 0.0 < effect.share < 0.01 else f"{100.0 * effect.share:.0f} %"


def meaning_of(effect: Finding) -> str:
    """What an effect does, in words; by its sign, where that makes a difference."""
    kind = next((each for each in KINDS if each.name == effect.name.kind), None)
    if kind is None:
        return ""
    estimate = effect.parameters.get(kind.parameters[0])
    below = estimate is not None and estimate.value < 0.0
    return kind.negative if below and kind.negative else kind.meaning


def _code(text: str) -> Markup:
    """Marks what stands between backquotes."""
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if number % 2 else escape(part)
        for number, part in enumerate(text.split("`"))
    )


def write(path: Path, diagnosis: Diagnosis) -> Path:
    """Writes the page. Raises RigtwinError if it cannot."""
    WRITERS.get(path.suffix.lower(), atomic_write)(path, html(diagnosis))
    return path
