"""§7.1 and appendices B1, B2 (Tables 7.1 to 7.3): skyhook under a point mass, over many roads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from experiments import find
from experiments.thesis import ride
from experiments.thesis.entry import Entry, band, digits, statement
from experiments.thesis.ride import MEASURED, SHOWN_SEED
from experiments.thesis.study import (
    Conclusion,
    Drawing,
    Job,
    Result,
    ThesisStudy,
    sheet,
    span,
    trace,
)
from experiments.thesis.trial import over_seeds, seeded, trial, vehicle
from rigtwin.render.panels import ASKED, SENSED
from rigtwin.render.style import COLOURS

WITHIN = 1.5  # factor within which a computed value agrees with a printed one
# Skyhook damping, Ns/m, of the active tests of Table 7.2.
GAINS = {"active 100": 100.0, "active": 200.0, "active 500": 500.0}
TABLE_7_2 = {"active 100": "0.1039", "active": "0.0819", "active 500": "0.0588"}
TABLE_7_3 = {"passive": "0.2264", "semi-active": "0.0874", "active": "0.0819"}
"""Acceleration of the sprung mass of Tables 7.2 and 7.3, m/s² rms."""


def _run(name: str, seed: int) -> Result:
    """Return the measures of one test; `active 100` is the active test with 100 Ns/m."""
    if name in GAINS:
        gain = GAINS[name]
        return ride.job_result(
            trial(
                "active",
                seed,
                lambda c: c._replace(controller=c.controller._replace(skyhook_damping=gain)),
            ),
            seed,
        )
    return ride.job_result(trial(name, seed), seed)


def jobs(seeds: int) -> Mapping[str, Job]:
    """Return the jobs of the study."""
    return seeded({name: partial(_run, name) for name in ("passive", "semi-active", *GAINS)}, seeds)


def _entries(results: Mapping[str, Result]) -> list[Entry]:
    """Return all entries of §7.1 and of appendices B1 and B2."""
    configuration = find("semi-active").configuration
    settings = configuration.controller
    entries = [
        *vehicle("Table 7.1", configuration),
        digits("Table 7.1", "skyhook damping", "200", settings.skyhook_damping, "Ns/m"),
        digits("Table 7.1", "highest damping", "500", settings.damping_max, "Ns/m"),
        digits("Table 7.1", "lowest damping", "10", settings.damping_min, "Ns/m"),
    ]
    for table, printed in (("Table 7.2", TABLE_7_2), ("Table 7.3", TABLE_7_3)):
        for name, text in printed.items():
            entries.append(
                band(
                    table,
                    name,
                    text,
                    over_seeds(results, name, "acceleration"),
                    "m/s²",
                    WITHIN,
                    MEASURED,
                )
            )
    entries += [
        ride.reduction_entry("§7.1.1", results, "semi-active", "passive", "61.4", WITHIN),
        ride.reduction_entry("§7.1.2", results, "active", "passive", "63.8", WITHIN),
        digits("§7.1.1", "61.4 % from Table 7.3 itself", "61.4", 100 * (1 - 0.0874 / 0.2264), "%"),
        digits("§7.1.2", "63.8 % from Table 7.3 itself", "63.8", 100 * (1 - 0.0819 / 0.2264), "%"),
        *ride.tracking_entries(
            "Table B1.1", results, "semi-active", ("7.50", "286", "0.0593", "58"), 1.5
        ),
        *ride.tracking_entries(
            "Table B2.1", results, "active", ("8.47", "425", "0.0595", "58"), 1.5
        ),
    ]
    return entries + _statements(results)


def _statements(results: Mapping[str, Result]) -> list[Entry]:
    """Return the entries of what §7.1 says about its figures."""

    def all_of(name: str, value: str) -> np.ndarray:
        return over_seeds(results, name, value)

    # Seeds are paired: all gains drive over the same roads.
    falls = np.all(np.diff([all_of(name, "acceleration") for name in GAINS], axis=0) < 0, axis=0)
    text = f"in {int(np.sum(falls))} of {len(falls)} seeds"
    more_in_ideal = all_of("active 500", "ideal tyre rms") > all_of("active 100", "ideal tyre rms")
    more_on_twin = all_of("active 500", "tyre rms") > all_of("active 100", "tyre rms")
    twin, ideal = int(np.sum(more_on_twin)), int(np.sum(more_in_ideal))
    words = f"twin: in {twin} of {len(more_on_twin)} seeds, ideal: in {ideal}"
    travel_differences = np.abs(
        all_of("semi-active", "travel rms") / all_of("active", "travel rms") - 1
    )
    travels_less = all_of("semi-active", "travel rms") < all_of("passive", "travel rms")
    # A switch at every reversal of the body would be about 4 a second on this road.
    switches = all_of("semi-active", "switches")
    return [
        statement(
            "Table 7.2", "more skyhook damping", "less body acceleration", bool(np.all(falls)), text
        ),
        statement(
            "§7.1.2",
            "more skyhook damping",
            "more tyre vibration",
            bool(np.mean(more_on_twin) > 0.5),
            words,
            "over the whole test, drop included, it is not so in the ideal system either",
        ),
        statement(
            "Figure 7.8",
            "travel, semi-active and active",
            "nearly identical",
            bool(np.median(travel_differences) < 0.1),
            f"rms differs by {100 * np.median(travel_differences):.1f} %",
        ),
        statement(
            "Figure 7.8",
            "travel, semi-active",
            "less than passive",
            bool(np.all(travels_less)),
            f"in {int(np.sum(travels_less))} of {len(travels_less)} seeds",
        ),
        statement(
            "Figure 7.2",
            "damper",
            "switches at high frequency",
            bool(np.median(switches) > 5),
            f"{ride.interval(switches, ' switches a second')}; the road alone would need about 4",
        ),
    ]


def _forces(results: Mapping[str, Result]) -> Drawing:
    """Draw the demanded damping forces and the coefficient of the semi-active damper."""
    figure, axes = sheet(3, 1, height=2.2)
    for name, axis in (("semi-active", axes[0][0]), ("active", axes[2][0])):
        for label, colour in (
            ("passive", COLOURS["other"]),
            (name, SENSED if name == "semi-active" else ASKED),
        ):
            result = results[f"{label}/{SHOWN_SEED}"]
            trace(axis, result, "asked damper", color=colour, linewidth=0.8, label=label)
        axis.set(ylabel="damping force, N", xlim=(0, 15))
        axis.legend(fontsize=8)
    result = results[f"semi-active/{SHOWN_SEED}"]
    trace(axes[1][0], result, "damping", color=SENSED, linewidth=0.6)
    axes[1][0].set(ylabel="damper, Ns/m", xlim=(0, 15))
    axes[2][0].set(xlabel="time, s")
    return Drawing(
        "figure-7.1",
        "Figure 7.1 to 7.3",
        "Demanded damping forces and the semi-active coefficient.",
        figure,
    )


def _box(results: Mapping[str, Result]) -> Drawing:
    """Draw the accelerations over the seeds as boxes, beside the ideal and the thesis."""
    figure, axes = sheet(1, 2, height=3.2)
    for axis, printed in ((axes[0][0], TABLE_7_3), (axes[0][1], TABLE_7_2)):
        for number, (name, text) in enumerate(printed.items()):
            values = over_seeds(results, name, "acceleration")
            ideal = over_seeds(results, name, "ideal acceleration")
            axis.boxplot([values], positions=[number], whis=(5, 95), widths=0.35)
            axis.plot(
                number - 0.3,
                np.median(ideal),
                "_",
                color=COLOURS["other"],
                markersize=14,
                label="ideal" if number == 0 else None,
            )
            axis.plot(
                number + 0.3,
                float(text),
                "*",
                color=ASKED,
                markersize=9,
                label="thesis" if number == 0 else None,
            )
        axis.set(
            xticks=range(len(printed)),
            xticklabels=printed,
            ylabel="rms body acceleration, m/s²",
            ylim=(0, None),
        )
        axis.legend(fontsize=8)
    return Drawing(
        "table-7.3",
        "Table 7.2 and 7.3",
        "Boxes: the twin over all seeds, whiskers 5 and 95 %.",
        figure,
    )


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, drawings and remarks of §7.1."""
    shown = {name: results[f"{name}/{SHOWN_SEED}"] for name in ("passive", "semi-active", "active")}
    gains = {f"{gain:g} Ns/m": results[f"{name}/{SHOWN_SEED}"] for name, gain in GAINS.items()}
    drawings = [
        _forces(results),
        ride.histories("figure-7.4", "Figure 7.4 to 7.6", "Active skyhook, three gains.", gains),
        ride.histories(
            "figure-7.7",
            "Figure 7.7 to 7.9, B1.1 to B2.6",
            "Passive, semi-active and active skyhook.",
            shown,
        ),
        _box(results),
    ]
    remarks = [ride.remark(results, name) for name in ("passive", "semi-active", *GAINS)]
    remarks.append(
        f"{MEASURED}; below the twin's limit cycle by friction, at "
        "3.4 Hz and above, whose tail is still in it"
    )
    return Conclusion(_entries(results), drawings, remarks)


STUDY = ThesisStudy(
    "skyhook",
    "Skyhook under a point mass",
    "7 B",
    (
        *("Table 7.1", "Table 7.2", "Table 7.3", "Table B1.1", "Table B2.1"),
        *span("Figure", "7.", 1, 9),
        *span("Figure", "B1.", 1, 8),
        *span("Figure", "B2.", 1, 8),
    ),
    conclude,
    jobs,
)
