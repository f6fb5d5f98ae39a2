"""Results folder of a study: settings to run, a recording of the best, tables, pictures, a page."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from rigtwin import __version__
from rigtwin.description.configuration import Configuration
from rigtwin.description.physics import TwinTest
from rigtwin.errors import RigtwinError
from rigtwin.render.plot import save
from rigtwin.studies.tuning import text
from rigtwin.studies.tuning.evaluation import SettingsComparison
from rigtwin.studies.tuning.pictures import draw
from rigtwin.studies.tuning.result import TuningResult
from rigtwin.studies.tuning.run import LIMITS
from rigtwin.studies.tuning.scenario import APART
from rigtwin.studies.tuning.study import Study

RUNS, SETTINGS, BEST, PAGE = "runs.sqlite", "tuned.toml", "best.mcap", "index.html"
CAPTIONS = {
    "front": "Each point is a candidate; no candidate is better than the front in both objectives.",
    "held-out": "Change in the same scenario; points are medians, bars their 95 % intervals.",
    "search": "Candidates in the order in which the search tried them.",
    "parameters": "The first objective of every candidate over each parameter.",
}


def default_folder(study: Study) -> Path:
    """Return the folder for a study's results if the user names none."""
    return Path("tuning") / study.name


def write(folder: Path, result: TuningResult, twin: Configuration) -> list[Path]:
    """Write all results of a study.

    Parameters
    ----------
    folder : Path
        Folder to write to; it is created. Files of an earlier study are deleted.
    result : TuningResult
        Results of the study.
    twin : Configuration
        Configuration of the rig that the best settings are recorded on.

    Returns
    -------
    list of Path
        Paths of the files written.

    Raises
    ------
    RigtwinError
        If a file cannot be written.
    """
    figures = draw(result)
    pages = {
        SETTINGS: text.toml(result),
        "candidates.csv": _candidates(result),
        "held-out.csv": _held_out(result),
        PAGE: _page(result, figures),
    }
    if len(result.study.goals.minimise) == 2:
        for point in range(len(result.front)):
            pages[f"tuned-{point + 1}.toml"] = text.toml(result, point)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Files of an earlier study with more points would pass for results of this one.
        for old in (*folder.glob("tuned*.toml"), *(folder / f"{name}.png" for name in CAPTIONS)):
            old.unlink(missing_ok=True)
        for name, content in pages.items():
            # Written beside its place and renamed: a reader never sees half a page.
            temporary = folder / f".{name}.new"
            temporary.write_text(content, encoding="utf-8")
            temporary.replace(folder / name)
    except OSError as error:
        raise RigtwinError(f"cannot write into {folder}: {error.strerror}") from None
    for name, figure in figures.items():
        # The page contains the figures as SVG; the PNG files are for documents.
        save(figure, folder / f"{name}.png")
    _record(folder / BEST, result, twin)
    names = (*pages, *(f"{name}.png" for name in figures), BEST)
    return [folder / name for name in names]


def _record(path: Path, result: TuningResult, twin: Configuration) -> None:
    """Record a test with the tuned settings on the first held-out road."""
    experiment, machine = result.study.experiment, result.study.machine
    configuration = twin._replace(controller=result.settings)
    # Seed APART is the first held-out road, which no run of the search has used.
    demands = experiment.demands(configuration, APART)
    test = TwinTest(experiment.name, configuration, demands, APART)
    machine.physics.record(path, machine, test)


def _csv(rows: list[list[object]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def _candidates(result: TuningResult) -> str:
    """Return the table of candidates: values, scores over the search's scenarios, and `allowed`."""
    study = result.study
    keys = [parameter.key for parameter in study.parameters]
    names = [measure.name for measure in study.goals.measures]
    rows: list[list[object]] = [[*keys, *names, LIMITS, "trips", "allowed"]]
    for candidate in result.candidates:
        score = candidate.score
        figures = [score.figures[name] for name in names]
        allowed = int(candidate.allowed)
        rows.append([*candidate.values, *figures, score.limits, score.trips, allowed])
    return _csv(rows)


def _held_out(result: TuningResult) -> str:
    """Return the table of comparisons, one line per measure."""
    spreads = [f"{when}_{what}" for when in ("before", "after") for what in ("median", "5%", "95%")]
    names = ["rig", "settings", "against", "measure", "unit", *spreads]
    rows: list[list[object]] = [[*names, "change", "low", "high", "change_in", "no_worse", "runs"]]
    for comparison in (*result.comparisons, *result.front_comparisons):
        rows += _rows(comparison)
    return _csv(rows)


def _rows(comparison: SettingsComparison) -> list[list[object]]:
    rows: list[list[object]] = []
    for change in comparison.changes:
        row: list[object] = [comparison.rig, comparison.settings, comparison.against]
        row += [change.measure.name, change.measure.unit]
        for spread in (change.before, change.after):
            row += [spread.median, spread.low, spread.high]
        unit = "%" if change.relative else change.measure.unit
        row += [change.median, change.low, change.high, unit, change.better, comparison.runs]
        rows.append(row)
    return rows


def _svg(figure: Figure) -> str:
    """Return a figure as SVG that does not change from run to run."""
    stream = io.StringIO()
    # A fixed salt and no date keep the text identical for identical results.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rigtwin"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()[stream.getvalue().index("<svg") :]


def _page(result: TuningResult, figures: dict[str, Figure]) -> str:
    """Return the page as one HTML file without network access or scripts."""
    environment = Environment(
        loader=PackageLoader("rigtwin.studies.tuning"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("tuning.html").render(
        result=result,
        study=result.study,
        text=text,
        pictures=[(CAPTIONS[name], _svg(figure)) for name, figure in figures.items()],
        settings=text.toml(result),
        version=__version__,
    )
