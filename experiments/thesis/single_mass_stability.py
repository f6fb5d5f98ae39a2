"""§5.1 and §5.2: stability of a single mass with a lag in the suspension or in the structure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from experiments.thesis.entry import Entry, digits
from experiments.thesis.loci import ARBITRARY, damping
from experiments.thesis.loci_drawing import drawing
from experiments.thesis.single_mass_formulas import FILTER, MASS, SOFT, bode, formulas, region
from experiments.thesis.single_mass_loci import CASES
from experiments.thesis.study import Conclusion, Result, ThesisStudy, span
from rigtwin.studies.stability.models import poles, single_mass_structure, single_mass_suspension
from rigtwin.studies.stability.vehicle import SingleMass

TABLE_5_1 = {
    0.01: (
        ("-100", "-98.06", "-0.9677 + 3.043i", "-0.9677 - 3.043i"),
        ("-98.06", "-0.9677 + 3.043i", "-0.9677 - 3.043i"),
    ),
    0.1: (
        ("-10", "-9.012", "-0.4940 + 3.294i", "-0.4940 - 3.294i"),
        ("-9.012", "-0.4940 + 3.294i", "-0.4940 - 3.294i"),
    ),
    0.2: (
        ("-5", "-5", "0.0000 + 3.162i", "0.0000 - 3.162i"),
        ("-5", "0.0000 + 3.162i", "0.0000 - 3.162i"),
    ),
    0.5: (
        ("-4", "-2.946", "0.4732 + 2.562i", "0.4732 - 2.562i"),
        ("-2.946", "0.4732 + 2.562i", "0.4732 - 2.562i"),
    ),
}
"""Lag, s → poles of the structure model and of the suspension model.

A real part that the table leaves out is written to the digits of its column.
"""
TABLE_5_2 = (
    ("0.00 + 0.91i", "0.00 - 0.91i", "-41.4"),
    ("-1.7e-5 + 0.91i", "-1.7e-5 - 0.91i", "-101", "-98.9"),
)
"""Poles with the first-order and with the second-order filter; 0 is written out to two digits."""


def _pole_entries(
    where: str, system: str, printed: Sequence[str], computed: np.ndarray, notes: Mapping[str, str]
) -> list[Entry]:
    """Return entries for the printed poles, each with its computed counterpart."""
    # Python writes the imaginary unit as j.
    values = np.array([complex(text.replace(" ", "").replace("i", "j")) for text in printed])
    # The square root favours exact pairs, so a single misprint does not disturb the other pairs.
    rows, columns = linear_sum_assignment(np.sqrt(np.abs(values[:, None] - computed[None, :])))
    entries = []
    for row, column in zip(rows, columns, strict=True):
        text, ours = printed[int(row)], complex(computed[column])
        real, _, imaginary = text.partition(" ")
        name, note = f"{system}, pole {row + 1}", notes.get(text, "")
        entries.append(digits(where, f"{name}, real part", real, ours.real, "1/s", note))
        if imaginary:
            frequency = imaginary.replace(" ", "").rstrip("i").lstrip("+")
            entries.append(digits(where, f"{name}, frequency", frequency, ours.imag, "rad/s"))
    return entries


def _tables() -> list[Entry]:
    """Return the entries of Tables 5.1 to 5.5 and of §5.2.3."""
    entries = []
    doubled = {"-4": "the fourth pole of (5.16) is −1/τ, as in the other rows: −2, not −4"}
    for lag, (structure, suspension) in TABLE_5_1.items():
        for name, printed, system in (
            ("structure", structure, single_mass_structure(MASS, lag)),
            ("suspension", suspension, single_mass_suspension(MASS, lag)),
        ):
            entries += _pole_entries(
                "Table 5.1", f"τ = {lag:g} s, MIL {name}", printed, poles(system), doubled
            )
    slip = {text: "−1.7e-3, a slip of the exponent" for text in TABLE_5_2[1][:2]}
    for name, printed, lags in (
        ("first", TABLE_5_2[0], (1.0 / 41.4,)),
        ("second", TABLE_5_2[1], (FILTER, FILTER)),
    ):
        computed = poles(single_mass_suspension(SOFT, *lags))
        entries += _pole_entries("Table 5.2", f"{name} order filter", printed, computed, slip)
    for number, ratio, printed in ((1, 1.0, "316.2"), (2, 0.5, "158.1")):
        ours = damping(ratio, ARBITRARY.suspension_stiffness)
        entries.append(
            digits("Table 5.3", f"b of case {number}, ζ = {ratio:g}", printed, ours, "Ns/m")
        )
    entries.append(
        digits(
            "Table 5.4",
            "natural frequency at the end",
            "44.72",
            math.sqrt(1e5 / MASS.mass),
            "rad/s",
        )
    )
    # Table 5.5 varies k = m with b = 100 Ns/m: ω = 1 rad/s and ζ = b/(2 k).
    ends = [SingleMass(both, both, 100.0) for both in (1.0, 1e5)]
    for case in (1, 2, 3):
        entries.append(
            digits(
                "Table 5.5",
                f"natural frequency of case {case}",
                "1",
                ends[0].natural_frequency,
                "rad/s",
            )
        )
    note = "the printed range ends at 0.0005; 0.005 is k = m = 10 000, where b/k = 0.01 s"
    entries.append(
        digits(
            "§5.2.3", "lowest damping ratio of Table 5.5", "0.005", ends[1].damping_ratio, "1", note
        )
    )
    return entries


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, drawings and remarks of the single mass."""
    entries, drawings = [*_tables(), *formulas()], [region(), bode()]
    for table, cases_of in CASES.items():
        cases = cases_of()
        for case in cases:
            entries += case.entries()
        names = dict.fromkeys(f"Figure {panel.name}" for case in cases for panel in case.panels)
        caption = (
            f"Table {table}. Grey: the ideal mass. Coloured: with the lag, "
            "dark at the start of the sweep, light at its end."
        )
        drawings.append(drawing(f"single-mass-loci-{table}", ", ".join(names), caption, cases))
    return Conclusion(entries, drawings, REMARKS)


REMARKS = (
    "(5.7) and (5.16) print −k and −b where +k and +b stand on that "
    "side, and (5.16) +1/τ for −1/τ of the lagged velocity.",
    "Table 5.1: the structure's state-space model has one pole more, at −1/τ, which no output "
    "sees; the table misprints it for τ = 0.5 s.",
)
STUDY = ThesisStudy(
    "single-mass-stability",
    "stability of the single mass with a lag",
    "5",
    (
        *span("Table", "5.", 1, 5),
        "Figure 5.4",
        *span("Figure", "5.", 6, 20),
        "Equation 5.17",
        "Equation 5.18",
        "Equation 5.28",
    ),
    conclude,
)
