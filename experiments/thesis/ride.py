"""Chapter 7: ride comfort and road holding of a suspension, over many roads.

The studies of both structures, point mass and beams, share this module.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from controllers import Skyhook
from controllers.skyhook import semi_active_damping
from experiments.thesis.entry import Entry, band, factor
from experiments.thesis.study import Drawing, Result, sheet
from experiments.thesis.trial import (
    BODY,
    SHOWN,
    ThesisTrial,
    body_acceleration,
    curves,
    errors,
    over_seeds,
)
from rigtwin.numerics.arrays import Array
from rigtwin.render.panels import ASKED, SENSED
from rigtwin.render.style import COLOURS
from rigtwin.signals.noise import rms
from rigtwin.simulation.structure_motion import states, wing

SHOWN_SEED = 0
OFFSET = "0.06 m (58 %) in every table: a zero offset"
LIMIT_CYCLE = (
    "mostly the limit cycle by friction, which depends on the force loop's gains; the thesis does "
    "not give them"
)
TAXIING = 10.0
"""Time after which the drop has decayed and the road alone moves the car, s."""
COLOUR = {"passive": COLOURS["other"], "semi-active": SENSED, "active": ASKED}


def states_of(test: ThesisTrial) -> Array:
    """Return the packed state of the controller at every tick, shape (ticks, SIZE)."""
    demands = test.simulation.commands[:, :3]
    return states(
        test.configuration.controller,
        test.configuration.timing.period,
        test.simulation.measurements,
        demands,
    )


def damping(test: ThesisTrial) -> Array:
    """Return the coefficient of the semi-active damper at every tick, Ns/m, shape (ticks,)."""
    settings, packed = test.configuration.controller, states_of(test)
    # The controller uses the structure's velocity of the tick before.
    sprung = np.concatenate([[0.0], packed[:-1, 6]])
    return np.array(
        [
            semi_active_damping(settings, s, v)
            for s, v in zip(sprung.tolist(), packed[:, 2].tolist(), strict=True)
        ]
    )


def ride_measures(test: ThesisTrial) -> dict[str, Array | float]:
    """Return the measures of ride and road holding of a test.

    They are the rms acceleration of the body, m/s², of twin and ideal; the rms of travel and tyre
    deflection about their means, m; the switches of a semi-active damper per second; and the
    tracking errors of appendix B.
    """
    period = test.configuration.timing.period
    late = slice(round(TAXIING / period), None)
    # Tyre deflection is wheel minus ground; its rms measures road holding.
    tyre, should_tyre = (
        wheel - test.simulation.commands[:, 0] for wheel in (test.wheel, test.ideal.wheel)
    )
    result: dict[str, Array | float] = dict(errors(test))
    result |= {
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
        # A switch is a change between the lowest coefficient and a higher one.
        # Equality within rounding is safe here, because the damper is clipped to its minimum
        # exactly.
        at_least = coefficient <= test.configuration.controller.damping_min
        result["switches"] = float(np.sum(np.diff(at_least.astype(int)) != 0) / test.time[-1])
        result["damping"] = coefficient[::SHOWN]
    return result


def job_result(test: ThesisTrial, seed: int) -> Result:
    """Return the stored result of a test, with its curves for the drawn seed."""
    result = ride_measures(test)
    # Curves are large, and drawn for one seed alone.
    if seed == SHOWN_SEED:
        result |= curves(test)
        result["asked damper"] = _damper(test)[::SHOWN]
        if test.ideal.wing is not None:
            settings, period = test.configuration.controller, test.configuration.timing.period
            result |= {
                "wing": 1e3 * wing(settings, period, states_of(test))[::SHOWN],
                "ideal wing": 1e3 * (test.ideal.wing - test.ideal.wing[:, :1])[::SHOWN],
            }
    # The history of the damper is drawn for one seed only; the others need not store it.
    elif "damping" in result:
        del result["damping"]
    return result


def _damper(test: ThesisTrial) -> Array:
    """Return the demanded force without preload and spring, N, shape (ticks,)."""
    settings, packed = test.configuration.controller, states_of(test)
    # Demand = preload − k · travel + damper force, solved for the damper.
    return (
        test.simulation.commands[:, 2]
        - settings.preload
        + settings.suspension_stiffness * packed[:, 1]
    )


def reduction(
    results: Mapping[str, Result], better: str, base: str, value: str = "acceleration"
) -> Array:
    """Return the reduction of a value against a base test, %, shape (seeds,)."""
    return 100 * (1 - over_seeds(results, better, value) / over_seeds(results, base, value))


def interval(values: Array, unit: str) -> str:
    """Format the median and the 5 to 95 % interval of some values."""
    low, middle, high = np.percentile(values, [5, 50, 95])
    return f"{middle:.3g}{unit} ({low:.3g} to {high:.3g})"


def remark(results: Mapping[str, Result], name: str) -> str:
    """Return a remark on the acceleration of the body, by both measures, and of the ideal."""
    body, unfiltered, ideal = (
        over_seeds(results, name, key) for key in ("acceleration", "everything", "ideal everything")
    )
    return (
        f"{name}: body acceleration {interval(body, ' m/s²')}, with everything in it "
        f"{interval(unfiltered, '')}; ideal {interval(ideal, '')}"
    )


def reduction_entry(
    where: str,
    results: Mapping[str, Result],
    better: str,
    base: str,
    printed: str,
    within: float,
    note: str = "",
) -> Entry:
    """Return the entry of a printed reduction of the body's acceleration, %."""
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
    results: Mapping[str, Result],
    name: str,
    printed: tuple[str, str, str, str],
    within: float,
) -> list[Entry]:
    """Return the entries of a table of appendix B: force error in N and %, position in m and %."""
    force = over_seeds(results, name, "force_total")
    position = over_seeds(results, name, "position_total")
    force_share = 100 * force / over_seeds(results, name, "ideal_force")
    position_share = 100 * position / over_seeds(results, name, "ideal_position")
    return [
        factor(table, "force e1 + e2", printed[0], force, "N", within, LIMIT_CYCLE),
        factor(table, "force e1 + e2", printed[1], force_share, "%", within, LIMIT_CYCLE),
        factor(table, "position e1 + e2", printed[2], position, "m", within, OFFSET),
        factor(table, "position e1 + e2", printed[3], position_share, "%", within, OFFSET),
    ]


def histories(
    name: str, covers: str, caption: str, runs: Mapping[str, Result], until: float = 20.0
) -> Drawing:
    """Draw sprung mass, travel and tyre deflection of several tests; until: last time shown, s."""
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
