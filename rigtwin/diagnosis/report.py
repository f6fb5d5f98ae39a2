"""The diagnosis as one HTML file to look at: no network, readable on a telephone and on paper; and
as a browser prints it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from rigtwin import __version__
from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.attribute import library
from rigtwin.diagnosis.finding import Answer, Finding
from rigtwin.diagnosis.text import against_nominal
from rigtwin.diagnosis.units import say, spell
from rigtwin.diagnosis.units import write as write_size
from rigtwin.diagnosis.words import name_part
from rigtwin.files import write_whole
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
    levels += [
        (name.replace("_", " "), level.before, level.after) for name, level in gap.replays.items()
    ]
    largest = max(max(before, after, 1.0) for _, before, after in levels)

    def width(value: float) -> float:
        return 100.0 * value / largest

    return [Bar(name, b, a, width(b), width(a), width(1.0)) for name, b, a in levels]


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
        spell=spell,
        say=say,
        against_nominal=against_nominal,
        write=write_size,
        recordings=[Path(each).name for each in answer.recordings],
        title=diagnosis.described.title,
        components=list(diagnosis.evidence.machine.components)
        if diagnosis.evidence is not None
        else [],
        tried=len(library(diagnosis.evidence)) if diagnosis.evidence is not None else 0,
        version=__version__,
    )


def title_of(effect: Finding) -> str:
    """An effect in words, with its component."""
    return f"{effect.title[0].upper()}{effect.title[1:]}, {name_part(effect.name.component)}"


def _code(text: str) -> Markup:
    """Marks what stands between backquotes."""
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if number % 2 else escape(part)
        for number, part in enumerate(text.split("`"))
    )


def write(path: Path, diagnosis: Diagnosis) -> Path:
    """Writes the page. Raises RigtwinError if it cannot."""
    WRITERS.get(path.suffix.lower(), write_whole)(path, html(diagnosis))
    return path
