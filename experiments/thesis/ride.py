"""Chapter 7: what a suspension gives the body and the wheel, over many roads; shared by the studies
of both structures."""

from __future__ import annotations

import numpy as np

from controllers import Skyhook
from controllers.skyhook import semi_active_damping
from experiments.thesis.entry import Entry, band, factor
from experiments.thesis.study import Drawing, Result, sheet
from experiments.thesis.trial import (
    BODY,
    SHOWN,
    Trial,
    body_acceleration,
    curves,
    errors,
    over_seeds,
)
from rigtwin.numerics.arrays import Array
from rigtwin.render.plot import ASKED, SENSED
from rigtwin.render.style import COLOURS
from rigtwin.signals.noise import rms
from rigtwin.simulation.structure_motion import states, wing

SHOWN_SEED = 0
OFFSET = "the same 0.06 m (58 %) in every table: an offset of the zero"
LIMIT_CYCLE = (
    "mostly the limit cycle by friction, whose size depends on the "
    "force loop's gains; the thesis does not give them"
)
TAXIING = 10.0
"""s after which the drop has decayed and the road alone moves the car."""
COLOUR = {"passive": COLOURS["other"], "semi-active": SENSED, "active": ASKED}


def states_of(test: Trial) -> Array:
    """The controller's packed state at every tick, shape (ticks, SIZE)."""
    demands = test.simulation.commands[:, :3]
    return states(
        test.configuration.controller,
        test.configuration.timing.period,
        test.simulation.measurements,
        demands,
    )


def damping(test: Trial) -> Array:
    """Coefficient of the semi-active damper at every tick, Ns/m."""
    settings, found = test.configuration.controller, states_of(test)
    # The tick uses the structure's velocity of the tick before.
    sprung = np.concatenate([[0.0], found[:-1, 6]])
    return np.array(
        [
            semi_active_damping(settings, s, v)
            for s, v in zip(sprung.tolist(), found[:, 2].tolist(), strict=True)
        ]
    )


def ride_measures(test: Trial) -> dict[str, Array | float]:
    """rms body acceleration (m/s²) of twin and ideal, travel and tyre deflection (m) about their
    means, switches of the damper a second, and the errors of appendix B."""
    period = test.configuration.timing.period
    late = slice(round(TAXIING / period), None)
    tyre, should_tyre = (
        wheel - test.simulation.commands[:, 0] for wheel in (test.wheel, test.ideal.wheel)
    )
    found: dict[str, Array | float] = dict(errors(test))
    found |= {
        "acceleration": body_acceleration(test.plate, period),
        "everything": rms(np.diff(test.plate, 2) / period**2),
        "ideal acceleration": body_acceleration(test.ideal.structure, period),
        "ideal everything": rms(test.ideal.acceleration(period)),
        "taxiing": body_acceleration(test.plate[late], period),
        "travel rms": float(np.std(test.travel)),
        "tyre rms": float(np.std(tyre)),
        "ideal travel rms": float(np.std(test.ideal.structure - test.ideal.wheel)),
        "ideal tyre rms": float(np.std(should_tyre)),
    }
    if test.configuration.controller.skyhook == Skyhook.SEMI_ACTIVE:
        coefficient = damping(test)
        at_least = coefficient <= test.configuration.controller.damping_min
        found["switches"] = float(np.sum(np.diff(at_least.astype(int)) != 0) / test.time[-1])
        found["damping"] = coefficient[::SHOWN]
    return found


def job_result(test: Trial, seed: int) -> Result:
    """What a job keeps of a test; of the shown seed its curves too."""
    found = ride_measures(test)
    if seed == SHOWN_SEED:
        found |= curves(test)
        found["asked damper"] = _damper(test)[::SHOWN]
        if test.ideal.wing is not None:
            found |= {
                "wing": 1e3 * _wing(test)[::SHOWN],
                "ideal wing": 1e3 * (test.ideal.wing - test.ideal.wing[:, :1])[::SHOWN],
            }
    elif "damping" in found:
        del found["damping"]
    return found


def _wing(test: Trial) -> Array:
    return wing(test.configuration.controller, test.configuration.timing.period, states_of(test))


def _damper(test: Trial) -> Array:
    """The part of the demanded force that is not the spring's, N."""
    settings, found = test.configuration.controller, states_of(test)
    return (
        test.simulation.commands[:, 2]
        - settings.preload
        + settings.suspension_stiffness * found[:, 1]
    )


def reduction(
    results: dict[str, Result], better: str, base: str, value: str = "acceleration"
) -> Array:
    """In %, of each seed."""
    return 100 * (1 - over_seeds(results, better, value) / over_seeds(results, base, value))


def interval(values: Array, unit: str) -> str:
    low, middle, high = np.percentile(values, [5, 50, 95])
    return f"{middle:.3g}{unit} ({low:.3g} to {high:.3g})"


def remark(results: dict[str, Result], name: str) -> str:
    """The body's acceleration by both measures, and the ideal's."""
    body, everything, should = (
        over_seeds(results, name, key) for key in ("acceleration", "everything", "ideal everything")
    )
    return (
        f"{name}: body acceleration {interval(body, ' m/s²')}, with "
        f"everything in it {interval(everything, '')}; "
        f"ideal {interval(should, '')}"
    )


def reduction_entry(
    where: str,
    results: dict[str, Result],
    better: str,
    base: str,
    printed: str,
    within: float,
    note: str = "",
) -> Entry:
    """A printed reduction of the body's acceleration, in %, beside the interval over the seeds."""
    return band(
        where,
        f"{better} against {base}",
        printed,
        reduction(results, better, base),
        "%",
        within,
        note,
    )


def tracking_entries(
    table: str,
    results: dict[str, Result],
    name: str,
    printed: tuple[str, str, str, str],
    within: float,
) -> list[Entry]:
    """A table of appendix B: force N and %, position m and %."""
    force, position = (
        over_seeds(results, name, "force_total"),
        over_seeds(results, name, "position_total"),
    )
    force_share = 100 * force / over_seeds(results, name, "ideal_force")
    position_share = 100 * position / over_seeds(results, name, "ideal_position")
    return [
        factor(table, "force e1 + e2", printed[0], force, "N", within, LIMIT_CYCLE),
        factor(table, "force e1 + e2", printed[1], force_share, "%", within, LIMIT_CYCLE),
        factor(table, "position e1 + e2", printed[2], position, "m", within, OFFSET),
        factor(table, "position e1 + e2", printed[3], position_share, "%", within, OFFSET),
    ]


def histories(
    name: str, covers: str, caption: str, runs: dict[str, Result], until: float = 20.0
) -> Drawing:
    """Sprung mass, travel and tyre of several runs, label → result."""
    figure, axes = sheet(3, 1, height=2.2)
    for label, result in runs.items():
        time = np.asarray(result["time"])
        shown = time <= until
        tyre = np.asarray(result["wheel"]) - np.asarray(result["ground"])
        for row, values in zip(axes, (result["plate"], result["travel"], tyre), strict=True):
            row[0].plot(
                time[shown],
                np.asarray(values)[shown],
                linewidth=0.9,
                label=label,
                color=COLOUR.get(label),
            )
    for row, label in zip(axes, ("sprung mass, mm", "travel, mm", "tyre, mm"), strict=True):
        row[0].set(ylabel=label)
    axes[0][0].legend(fontsize=8, ncols=4, loc="lower right")
    axes[2][0].set(xlabel="time, s")
    return Drawing(name, covers, caption, figure)


MEASURED = (
    f"acceleration of the plate up to {BODY:g} Hz: the thesis does not say how it was measured"
)
