"""§5.3 to §5.7: stability of the quarter car with suspension MIL, structure MIL, and both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from experiments.thesis.entry import Entry, digits, statement
from experiments.thesis.loci import (
    ARBITRARY,
    LocusVariation,
    locus,
    of_damping_ratio,
    of_natural_frequency,
    of_tyre_stiffness,
    of_wheel_mass,
)
from experiments.thesis.quarter_car_statements import (
    SMALL_LAG,
    SUSPENSION_LAG,
    statements,
    structure_lag,
)
from experiments.thesis.study import Conclusion, Result, ThesisStudy, span
from rigtwin.studies.stability.locus import BODY, WHEEL, Locus, mode
from rigtwin.studies.stability.models import MODELS, poles
from rigtwin.studies.stability.vehicle import QuarterCar

STRUCTURE_LAG = 0.06895
"""Lag of Tables 5.7 to 5.12, s. It is the critical lag of the first column of each table."""


class TableColumn(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    changes : mapping
        Parameters that differ from `ARBITRARY`.
    body, wheel : str
        Printed real parts of body hop and wheel hop, 1/s. A printed 0 is written with the digits
        of the other columns.
    note : str
        Reason for a difference.
    """

    changes: Mapping[str, float]
    body: str
    wheel: str | None = None
    note: str = ""


DAMPED = "−0.0276 and −0.0724: damping of the tyre stabilises suspension MIL as well"
TABLE_5_6 = (
    TableColumn({}, "0.0000", "0.0000"),
    TableColumn({"tyre_stiffness": 600.0}, "0.0000", "0.0000"),
    TableColumn({"unsprung_mass": 60.0}, "0.0000", "0.0000"),
    TableColumn({"tyre_damping": 10.0}, "0.0000", "0.0000", DAMPED),
)
STRUCTURE_TABLES = {
    "Table 5.7": (
        TableColumn({}, "0.0000"),
        TableColumn({"suspension_stiffness": 600.0}, "0.0242"),
        TableColumn({"suspension_stiffness": 400.0}, "-0.0394"),
    ),
    "Table 5.8": (
        TableColumn({}, "0.0000"),
        TableColumn({"suspension_damping": 200.0}, "-0.0487"),
        TableColumn({"suspension_damping": 50.0}, "0.0432"),
        TableColumn({"suspension_damping": 1000.0}, "0.0256"),
    ),
    "Table 5.9": (
        TableColumn({}, "0.0000"),
        TableColumn({"sprung_mass": 60.0}, "-0.0057"),
        TableColumn({"sprung_mass": 40.0}, "0.0087"),
    ),
    "Table 5.10": (
        TableColumn({}, "0.0000"),
        TableColumn({"tyre_stiffness": 600.0}, "-0.0148"),
        TableColumn({"tyre_stiffness": 400.0}, "0.0112"),
    ),
    "Table 5.11": (
        TableColumn({}, "0.0000"),
        TableColumn({"unsprung_mass": 60.0}, "0.0043"),
        TableColumn({"unsprung_mass": 40.0}, "-0.0061"),
    ),
    "Table 5.12": (
        TableColumn({}, "0.0000"),
        TableColumn({"tyre_damping": 10.0}, "-0.0299"),
        TableColumn({"tyre_damping": 100.0}, "-0.2926"),
    ),
}
TABLE_5_13 = {
    "single-mass": "arra--",
    "suspension": "arraaa",
    "structure": "arrrra",
    "combined": "arrrra",
}
"""Model → printed stability at the ends of three sweeps: `a` stable, `r` unstable, `-` no value.

The letters stand for low and high sprung natural frequency, damping ratio and unsprung natural
frequency, in this order.
"""
COLUMNS_5_13 = tuple(
    f"{end} {what}"
    for what in ("sprung natural frequency", "damping ratio", "unsprung natural frequency")
    for end in ("low", "high")
)


def _real_part(model: str, car: QuarterCar, lag: float, mode_name: str) -> float:
    """Return the largest real part of the oscillating poles of a mode, 1/s."""
    car_poles = poles(MODELS[model](car, lag)).tolist()
    # Of each pair the pole above the real axis; the filters' real poles have no mode.
    return max(pole.real for pole in car_poles if pole.imag > 0.0 and mode(car, pole) == mode_name)


def _tables() -> list[Entry]:
    """Return the entries of Tables 5.6 to 5.12: real parts at the critical lag."""
    entries = []
    for number, column in enumerate(TABLE_5_6, 1):
        car = ARBITRARY._replace(**column.changes)
        for name, printed in ((BODY, column.body), (WHEEL, column.wheel or "")):
            ours = _real_part("suspension", car, SUSPENSION_LAG, name)
            entries.append(
                digits(
                    "Table 5.6",
                    f"case {number}, {name}, real part",
                    printed,
                    ours,
                    "1/s",
                    column.note,
                )
            )
    for table, columns in STRUCTURE_TABLES.items():
        for number, column in enumerate(columns, 1):
            ours = _real_part(
                "structure", ARBITRARY._replace(**column.changes), STRUCTURE_LAG, BODY
            )
            changes = (
                ", ".join(
                    f"{name.replace('_', ' ')} {value:g}" for name, value in column.changes.items()
                )
                or "as chosen"
            )
            entries.append(
                digits(
                    table,
                    f"column {number}, {changes}, body hop, real part",
                    column.body,
                    ours,
                    "1/s",
                )
            )
    critical = structure_lag()
    entries.append(
        digits("Table 5.7", "critical lag of the first column", "0.06895", critical, "s")
    )
    return entries


def _table_5_13() -> list[Entry]:
    """Return the entries of Table 5.13: stability at the ends of the sweeps."""
    entries = []
    for model, printed in TABLE_5_13.items():
        for column, name, cell in zip(range(6), COLUMNS_5_13, printed, strict=True):
            if cell == "-":
                continue
            # Tyre stiffness and wheel mass both sweep the unsprung frequency, and must agree.
            stabilities = [not each.unstable_modes(value) for each, value in _ends(model, column)]
            words = " and ".join(
                "stable" if stable else "unstable" for stable in dict.fromkeys(stabilities)
            )
            says = "stable" if cell == "a" else "unstable"
            entries.append(
                statement(
                    "Table 5.13",
                    f"{model} MIL, {name}",
                    says,
                    all(each == (cell == "a") for each in stabilities),
                    words,
                )
            )
    return entries


def _ends(model: str, column: int) -> list[tuple[Locus, float]]:
    """Return the sweeps that a column of Table 5.13 summarises, with the value at its end."""
    frequency = of_natural_frequency(1.0, SUSPENSION_LAG, 1e5)
    ratio = of_damping_ratio(SUSPENSION_LAG)
    tyre, wheel = of_tyre_stiffness(SMALL_LAG), of_wheel_mass(SMALL_LAG)
    # True selects the end of a sweep. The damping ratio falls as its swept value rises, and so does
    # the unsprung frequency with the mass of the wheel.
    chosen: tuple[tuple[tuple[LocusVariation, bool], ...], ...] = (
        ((frequency, False),),
        ((frequency, True),),
        ((ratio, True),),
        ((ratio, False),),
        ((tyre, False), (wheel, True)),
        ((tyre, True), (wheel, False)),
    )
    return [
        (locus(model, variation), variation.end if last else variation.start)
        for variation, last in chosen[column]
    ]


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries of Tables 5.6 to 5.13 and of the text around them."""
    return Conclusion([*_tables(), *_table_5_13(), *statements()], (), REMARKS)


REMARKS = (
    "(5.37) prints b_s u for k_t u and (5.38) k_t for k_s; the matrix (5.43) has both right.",
    "(5.55) and (5.56) are lost; they are derived anew from (5.49) to (5.54).",
)
STUDY = ThesisStudy(
    "quarter-car-stability",
    "stability of the quarter car with lags",
    "5",
    (*span("Table", "5.", 6, 13), "Equation 5.57"),
    conclude,
)
