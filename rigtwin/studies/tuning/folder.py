"""A study's folder: settings to run, a recording of the best, tables, pictures, one page to look at."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from rigtwin import __version__
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration
from rigtwin.render.plot import save
from rigtwin.simulation.runner import record
from rigtwin.studies.tuning import text
from rigtwin.studies.tuning.outcome import Outcome
from rigtwin.studies.tuning.pictures import drawn
from rigtwin.studies.tuning.run import LIMITS
from rigtwin.studies.tuning.scenario import APART

RUNS, SETTINGS, BEST, PAGE = "runs.sqlite", "tuned.toml", "best.mcap", "index.html"


def write(folder: Path, outcome: Outcome, twin: Configuration) -> list[Path]:
    """Writes all of it; what was written. twin: the rig that the best is recorded on. Raises RigtwinError."""
    figures = drawn(outcome)
    pages: dict[str, str] = {
        SETTINGS: text.toml(outcome),
        "candidates.csv": _candidates(outcome),
        "held-out.csv": _held_out(outcome),
        PAGE: _page(outcome, figures),
    }
    if len(outcome.study.minimise) == 2:
        pages |= {f"tuned-{number + 1}.toml": text.toml(outcome, number) for number in range(len(outcome.front))}
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Of an earlier study nothing stays that this one does not write again.
        for old in (*folder.glob("tuned*.toml"), *(folder / f"{name}.png" for name in CAPTIONS)):
            old.unlink(missing_ok=True)
        for name, content in pages.items():
            temporary = folder / f".{name}.new"
            temporary.write_text(content, encoding="utf-8")
            temporary.replace(folder / name)
            written.append(folder / name)
    except OSError as error:
        raise RigtwinError(f"cannot write into {folder}: {error.strerror}") from None
    for name, figure in figures.items():
        save(figure, folder / f"{name}.png")
        written.append(folder / f"{name}.png")
    _record(folder / BEST, outcome, twin)
    return [*written, folder / BEST]


def _record(path: Path, outcome: Outcome, twin: Configuration) -> None:
    """The tuned settings on the first held-out road."""
    import experiments

    configuration = twin._replace(controller=outcome.settings)
    demands = experiments.find(outcome.study.experiment).demands(configuration, APART)
    record(path, outcome.study.experiment, configuration, demands, APART)


def _csv(rows: list[list[object]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def _candidates(outcome: Outcome) -> str:
    """Every candidate that was tried: its values, what it was worth over the search's scenarios, whether it was allowed."""
    study = outcome.study
    names = [measure.name for measure in study.measures]
    rows: list[list[object]] = [[*(each.key for each in study.parameters), *names, LIMITS, "trips", "allowed"]]
    for each in outcome.tried:
        worth = each.worth
        rows.append([*each.values, *(worth.figures[name] for name in names), worth.limits, worth.trips, int(each.allowed)])
    return _csv(rows)


def _held_out(outcome: Outcome) -> str:
    """Every comparison, a line a measure."""
    spreads = [f"{when}_{what}" for when in ("before", "after") for what in ("median", "5%", "95%")]
    rows: list[list[object]] = [
        ["rig", "settings", "against", "measure", "unit", *spreads, "change", "low", "high", "change_in", "no_worse", "runs"]
    ]
    for each in (*outcome.comparisons, *outcome.on_front):
        for change in each.changes:
            both = [value for of in (change.before, change.after) for value in (of.median, of.low, of.high)]
            unit = "%" if change.relative else change.measure.unit
            which = [each.rig, each.settings, each.against, change.measure.name, change.measure.unit]
            rows.append([*which, *both, change.median, change.low, change.high, unit, change.better, each.runs])
    return _csv(rows)


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rigtwin"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()[stream.getvalue().index("<svg") :]


CAPTIONS = {
    "front": "Each point is a candidate; none of the front is beaten in both.",
    "held-out": "Change against the settings named, in the same scenario; points are medians, bars their 95 % intervals.",
    "search": "What the search tried, in order.",
    "parameters": "The first objective of every candidate over each parameter.",
}


def _page(outcome: Outcome, figures: dict[str, Figure]) -> str:
    """One HTML file: no network, no script."""
    environment = Environment(
        loader=PackageLoader("rigtwin.studies.tuning"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("tuning.html").render(
        outcome=outcome,
        study=outcome.study,
        text=text,
        pictures=[(CAPTIONS[name], _svg(figure)) for name, figure in figures.items()],
        settings=text.toml(outcome),
        version=__version__,
    )
