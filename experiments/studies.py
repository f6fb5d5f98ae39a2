"""Studies of the thesis beside its own figures: functions of (seeds, where to draw, progress) that return a text."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments import find
from experiments.experiment import Progress
from experiments.identification import identification
from rigtwin.arrays import Array
from rigtwin.errors import RigtwinError
from rigtwin.metrics import Ideal, Tracking, ideal, tracking
from rigtwin.plot import ASKED, COLOURS, SENSED, checked_ending, save
from rigtwin.recording import Recording, load
from rigtwin.runner import record

TABLE_3_5 = {
    "position_e1": (0.00772, 0.00448, "m"),
    "position_e2": (0.000777, 0.000671, "m"),
    "position_total": (0.00850, 0.00515, "m"),
    "force_e1": (2.70, 2.68, "N"),
    "force_e2": (9.53, 8.79, "N"),
    "force_total": (12.2, 11.5, "N"),
}
"""Thesis Table 3.5: without and with ground input. The thesis adds the rms of e1 and e2; ours is the rms of e1 + e2."""

TABLE_6_3_FORCE = 12.4
"""N; thesis Table 6.3, rms of e1 + e2 of the suspension force in the drop test."""


def run_once(name: str, seed: int) -> Recording:
    """One run of an experiment on the twin, kept in memory."""
    experiment = find(name)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.mcap"
        outcome = record(path, name, experiment.configuration, experiment.demands(experiment.configuration, seed), seed)
        if outcome.tripped:
            raise RigtwinError(f"{name} with seed {seed}: {outcome.reason}")
        return load(path)


def table_3_5(seeds: int, out: Path | None, progress: Progress) -> str:
    """Table 3.5, no ground input: medians over noise seeds, untuned."""
    configuration = find("single-mass").configuration
    runs: list[Tracking] = []
    for seed in range(seeds):
        runs.append(tracking(run_once("single-mass", seed), configuration))
        progress(1)
    lines = [
        f"Table 3.5, no ground input, 45 s: median of {seeds} seeds",
        "error            thesis    ours      lowest    highest   ours/thesis",
    ]
    for name, (thesis, _, unit) in TABLE_3_5.items():
        values = np.array([getattr(run, name) for run in runs])
        middle = float(np.median(values))
        row = f"{name:15s}  {thesis:<8.4g}  {middle:<8.4g}  {values.min():<8.4g}  {values.max():<8.4g}  {middle / thesis:.2f}"
        lines.append(f"{row}  {unit}")
    return "\n".join(lines)


def _wheel(recording: Recording) -> Array:
    return recording.column("/truth", "structure") - recording.column("/truth", "suspension")


def _moving(wheel: Array, period: float) -> float:
    """Share of the time in which a wheel moves faster than 0.1 mm/s."""
    return float(np.mean(np.abs(np.gradient(wheel, period)) > 1e-4))


def chapter_6(seeds: int, out: Path | None, progress: Progress) -> str:
    """The drop test of §6.3.1 and the road test of §6.3.3: limit cycle at rest, stick-slip staircase of the carriage,
    missing wheel hop. Draws them."""
    path = out or Path("chapter-6.png")
    checked_ending(path)
    drop, road = find("drop").configuration, find("road10").configuration
    errors = []
    for seed in range(seeds):
        errors.append(tracking(run_once("drop", seed), drop).force_total)
        progress(1)
    dropped, driven = run_once("drop", 0), run_once("road10", 0)
    should_drop = ideal(drop, dropped.column("/command", "ground"))
    should_drive = ideal(road, driven.column("/command", "ground"))
    _draw_chapter_6(dropped, should_drop, driven, should_drive, path)
    rest = dropped.time > 10.0
    after = (dropped.time > 2.0) & (dropped.time < 8.0)
    hop = [1e6 * float(np.std(wheel[after])) for wheel in (_wheel(dropped), should_drop.wheel)]
    moving = [100 * _moving(wheel, driven.period) for wheel in (_wheel(driven), should_drive.wheel)]
    return (
        f"Table 6.3, rms force e1 + e2 of the drop test: thesis {TABLE_6_3_FORCE} N, "
        f"ours {np.median(errors):.1f} N (median of {seeds} seeds)\n"
        f"limit cycle at rest: load cell swings {np.ptp(dropped.column('/truth', 'load_cell')[rest]):.1f} N peak to peak "
        f"after 10 s; ideal {np.ptp(should_drop.force[rest]):.1f} N\n"
        f"missing wheel hop: from 2 to 8 s after the drop the wheel moves {hop[0]:.1f} um rms; ideal {hop[1]:.1f} um\n"
        f"staircase: on the 10 Hz road the carriage moves {moving[0]:.0f} % of the time; ideal {moving[1]:.0f} %\n"
        f"drawn in {path}"
    )


def _draw_chapter_6(dropped: Recording, should_drop: Ideal, driven: Recording, should_drive: Ideal, out: Path) -> None:
    figure = Figure(figsize=(11, 9.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 2)
    ideal_colour, time = COLOURS["other"], dropped.time

    def panel(
        axis: Axes, title: str, span: tuple[float, float], x: Array, lines: Sequence[tuple[str, str, Array]], unit: str
    ) -> None:
        shown = (x >= span[0]) & (x <= span[1])
        for label, colour, values in lines:
            axis.plot(x[shown], values[shown], color=colour, linewidth=1.0, label=label)
        axis.set(title=title, xlabel="time, s", ylabel=unit)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, framealpha=0.85, edgecolor="none")
        axis.margins(x=0)

    load_cell, demanded = dropped.column("/truth", "load_cell"), dropped.column("/command", "force")
    force = [
        ("ideal", ideal_colour, should_drop.force),
        ("in the load cell", SENSED, load_cell),
        ("demanded", ASKED, demanded),
    ]
    panel(axes[0, 0], "drop: suspension force (Fig. 6.28)", (0, 6), time, force, "N")
    panel(axes[0, 1], "drop: limit cycle at rest", (15, 17), time, force, "N")
    wheel = [("ideal", ideal_colour, 1e3 * should_drop.wheel), ("twin", SENSED, 1e3 * _wheel(dropped))]
    panel(axes[1, 0], "drop: wheel, its hop missing (Fig. 6.29)", (0, 6), time, wheel, "mm")
    plate = [
        ("ideal", ideal_colour, 1e3 * should_drop.structure),
        ("twin", SENSED, 1e3 * dropped.column("/truth", "structure")),
    ]
    panel(axes[1, 1], "drop: plate (Fig. 6.24)", (0, 6), time, plate, "mm")
    ground = driven.column("/command", "ground")
    stairs = [("ideal", ideal_colour, 1e3 * should_drive.wheel), ("twin", SENSED, 1e3 * _wheel(driven))]
    panel(axes[2, 0], "10 Hz road: wheel, stick-slip staircase", (20, 24), driven.time, stairs, "mm")
    tyre = [
        ("ideal", ideal_colour, 1e3 * (should_drive.wheel - ground)),
        ("twin", SENSED, 1e3 * (_wheel(driven) - driven.column("/truth", "ground"))),
    ]
    panel(axes[2, 1], "10 Hz road: wheel against ground", (20, 24), driven.time, tyre, "mm")
    save(figure, out)


STUDIES: dict[str, Callable[[int, Path | None, Progress], str]] = {
    "table-3.5": table_3_5,
    "identification": identification,
    "chapter-6": chapter_6,
}
"""By name, as `rigtwin reproduce` takes them."""
