"""Appendix A: root loci of the quarter car with suspension MIL, vehicle structure MIL, and both.

Every table of the appendix sweeps one parameter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from experiments.thesis import appendix_a1, appendix_a2, appendix_a3
from experiments.thesis.appendix_a import FILTER_LAG, PRINTED_LAG, TYRES, WHEELS
from experiments.thesis.entry import Entry, digits, statement
from experiments.thesis.loci import ARBITRARY, LocusVariation, damping, of_damping_ratio
from experiments.thesis.loci_drawing import drawing
from experiments.thesis.study import Conclusion, Result, ThesisStudy, span
from rigtwin.studies.stability.critical import critical_lag
from rigtwin.studies.stability.loop import LOOPS

CAPTION = (
    "Grey: the ideal quarter car. Coloured: with the lag, from dark at the start of the sweep to "
    "light at its end. Crosses: where poles cross the imaginary axis."
)
VARIED = {
    "1": "the lag",
    "2": "the sprung mass's natural frequency",
    "3": "its damping ratio",
    "4": "the tyre's stiffness",
    "5": "the wheel's mass",
}
MODELS = {"A1": "suspension", "A2": "structure", "A3": "combined"}
CASES = {**appendix_a1.CASES, **appendix_a2.CASES, **appendix_a3.CASES}
"""Functions that return the cases of a table, by its name."""


def _tables() -> list[Entry]:
    """Return entries for the printed parameters that follow from other parameters."""
    entries = []
    for appendix, model in MODELS.items():
        for number, ratio, printed in ((1, 1.0, "316.2"), (2, 0.5, "158.1")):
            # Eq. 5.34: b = 2 ζ √(k m).
            ours = damping(ratio, ARBITRARY.suspension_stiffness)
            entries.append(
                digits(
                    f"Table {appendix}.1",
                    f"b_s of case {number}, ζ = {ratio:g}",
                    printed,
                    ours,
                    "Ns/m",
                )
            )
        # ω = √(k/m) at the end of the sweep of k_s.
        end = math.sqrt(1e5 / ARBITRARY.sprung_mass)
        entries.append(
            digits(
                f"Table {appendix}.2",
                "natural frequency at the end, cases 1 to 3",
                "44.72",
                end,
                "rad/s",
            )
        )
        entries.append(_ratio(f"Table {appendix}.3"))
        for table, variation in (("4", TYRES[PRINTED_LAG]), ("5", WHEELS[PRINTED_LAG])):
            # A lag above the critical one of every value contradicts the printed statements.
            # A stable value of the sweep must have a critical lag above the printed one.
            largest = _largest_critical(model, variation)
            entries.append(
                statement(
                    f"Table {appendix}.{table}",
                    "lag of case 1",
                    f"{PRINTED_LAG:g} s, and stable for some values of the sweep",
                    largest > PRINTED_LAG,
                    f"the critical lag is at most {largest:.3g} s in the sweep",
                    "a misprint of 0.0333 s, for which the statements hold",
                )
            )
    return entries


def _ratio(table: str) -> Entry:
    """Return the entry of the sweep of k_s = m_s: it must change the damping ratio alone."""
    variation = of_damping_ratio(FILTER_LAG)
    ends = [variation.at(value).car.sprung for value in (variation.start, variation.end)]
    frequencies = [mass.natural_frequency for mass in ends]
    ratios = [mass.damping_ratio for mass in ends]
    words = f"{frequencies[0]:g} to {frequencies[1]:g} rad/s, ζ from {ratios[0]:g} to {ratios[1]:g}"
    varies = frequencies[0] == frequencies[1] and ratios[0] > ratios[1]
    return statement(
        table, "k_s = m_s, 1 to 100 000", "varies the damping ratio alone", varies, words
    )


def _largest_critical(model: str, variation: LocusVariation) -> float:
    """Return the largest critical lag over a sweep, s."""
    values = np.logspace(math.log10(variation.start), math.log10(variation.end), 36)
    critical_lags = [critical_lag(LOOPS[model](variation.at(float(value)).car)) for value in values]
    return max(each.time if each else math.inf for each in critical_lags)


def entries() -> list[Entry]:
    """Return an entry for every printed parameter and statement."""
    return [
        *_tables(),
        *(entry for cases_of in CASES.values() for case in cases_of() for entry in case.entries()),
    ]


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Sweep every case, judge its statements and draw its figures."""
    drawings = []
    for table, cases_of in CASES.items():
        cases = cases_of()
        appendix, _, varied = table.partition(".")
        # A figure drawn with two lags is named once: the suffix after the comma is cut off.
        names = dict.fromkeys(
            f"Figure {panel.name.partition(',')[0]}" for case in cases for panel in case.panels
        )
        caption = f"Table {table}, {MODELS[appendix]} MIL: {VARIED[varied]} varied. {CAPTION}"
        drawings.append(drawing(f"root-loci-{table}", ", ".join(names), caption, cases))
    return Conclusion(entries(), drawings, REMARKS)


REMARKS = (
    "Body hop and wheel hop are told apart as in §5.3.1, by whether "
    "the masses move the same way or against each other.",
    "Tables A1.4, A1.5, A2.4, A2.5, A3.4 and A3.5 print τ = 0.333 s for case 1. The loop is then "
    "unstable for every value of the sweep, and most of what the sections say is false; with "
    "0.0333 s it is true. Both are drawn.",
    "Table A1.3 prints b_u for b_t, Table A3.4 is captioned Table "
    "A1.3, and §A2.2 calls cases 4 to 6 cases 3 to 5.",
)
STUDY = ThesisStudy(
    "root-loci",
    "root loci of the quarter car with lags",
    "A",
    (
        *(f"Table {table}" for table in CASES),
        *span("Figure", "A1.", 1, 22),
        *span("Figure", "A2.", 1, 18),
        *span("Figure", "A3.", 1, 17),
    ),
    conclude,
)
