"""§5.3 to §5.7: the stability of the quarter car with suspension MIL, vehicle structure MIL and
both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from experiments.thesis.entry import Entry, digits, statement
from experiments.thesis.loci import (
    ARBITRARY,
    Variation,
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
from experiments.thesis.study import Conclusion, Result, Study, span
from rigtwin.studies.stability.locus import BODY, WHEEL, Locus, mode
from rigtwin.studies.stability.models import MODELS, poles
from rigtwin.studies.stability.vehicle import QuarterCar

STRUCTURE_LAG = 0.06895
"""s, of Tables 5.7 to 5.12: critical for the first column of each."""


class Column(NamedTuple):
    """A column of a table: what it changes, and the real parts printed, 1/s. Where the table prints
    0, the digits of its other columns are written."""

    changes: Mapping[str, float]
    body: str
    wheel: str | None = None
    note: str = ""


DAMPED = "−0.0276 and −0.0724: damping of the tyre stabilises suspension MIL as well"
TABLE_5_6 = (
    Column({}, "0.0000", "0.0000"),
    Column({"tyre_stiffness": 600.0}, "0.0000", "0.0000"),
    Column({"unsprung_mass": 60.0}, "0.0000", "0.0000"),
    Column({"tyre_damping": 10.0}, "0.0000", "0.0000", DAMPED),
)
STRUCTURE_TABLES = {
    "Table 5.7": (
        Column({}, "0.0000"),
        Column({"suspension_stiffness": 600.0}, "0.0242"),
        Column({"suspension_stiffness": 400.0}, "-0.0394"),
    ),
    "Table 5.8": (
        Column({}, "0.0000"),
        Column({"suspension_damping": 200.0}, "-0.0487"),
        Column({"suspension_damping": 50.0}, "0.0432"),
        Column({"suspension_damping": 1000.0}, "0.0256"),
    ),
    "Table 5.9": (
        Column({}, "0.0000"),
        Column({"sprung_mass": 60.0}, "-0.0057"),
        Column({"sprung_mass": 40.0}, "0.0087"),
    ),
    "Table 5.10": (
        Column({}, "0.0000"),
        Column({"tyre_stiffness": 600.0}, "-0.0148"),
        Column({"tyre_stiffness": 400.0}, "0.0112"),
    ),
    "Table 5.11": (
        Column({}, "0.0000"),
        Column({"unsprung_mass": 60.0}, "0.0043"),
        Column({"unsprung_mass": 40.0}, "-0.0061"),
    ),
    "Table 5.12": (
        Column({}, "0.0000"),
        Column({"tyre_damping": 10.0}, "-0.0299"),
        Column({"tyre_damping": 100.0}, "-0.2926"),
    ),
}
TABLE_5_13 = {
    "single-mass": "arra--",
    "suspension": "arraaa",
    "structure": "arrrra",
    "combined": "arrrra",
}
"""Model → stable (a) or unstable (r) at low and high sprung natural frequency, damping ratio,
unsprung natural frequency."""
COLUMNS_5_13 = tuple(
    f"{end} {what}"
    for what in ("sprung natural frequency", "damping ratio", "unsprung natural frequency")
    for end in ("low", "high")
)


def _real_part(model: str, car: QuarterCar, lag: float, wanted: str) -> float:
    """Of the slowest oscillating pole of that mode, 1/s."""
    found = poles(MODELS[model](car, lag)).tolist()
    return max(pole.real for pole in found if pole.imag > 0.0 and mode(car, pole) == wanted)


def _tables() -> list[Entry]:
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
            what = (
                ", ".join(
                    f"{name.replace('_', ' ')} {value:g}" for name, value in column.changes.items()
                )
                or "as chosen"
            )
            entries.append(
                digits(
                    table, f"column {number}, {what}, body hop, real part", column.body, ours, "1/s"
                )
            )
    critical = structure_lag()
    entries.append(
        digits("Table 5.7", "critical lag of the first column", "0.06895", critical, "s")
    )
    return entries


def _table_5_13() -> list[Entry]:
    """Ticks and crosses, each at an end of a sweep; of the unsprung frequency by the tyre and by
    the wheel's mass."""
    entries = []
    for model, printed in TABLE_5_13.items():
        for column, name, cell in zip(range(6), COLUMNS_5_13, printed, strict=True):
            if cell == "-":
                continue
            found = [not each.unstable_modes(value) for each, value in _ends(model, column)]
            words = " and ".join(
                "stable" if stable else "unstable" for stable in dict.fromkeys(found)
            )
            says = "stable" if cell == "a" else "unstable"
            entries.append(
                statement(
                    "Table 5.13",
                    f"{model} MIL, {name}",
                    says,
                    all(each == (cell == "a") for each in found),
                    words,
                )
            )
    return entries


def _ends(model: str, column: int) -> list[tuple[Locus, float]]:
    """The sweeps that a column of Table 5.13 sums up, and the end of each that it speaks of."""
    frequency, ratio = (
        of_natural_frequency(1.0, SUSPENSION_LAG, 1e5),
        of_damping_ratio(SUSPENSION_LAG),
    )
    tyre, wheel = of_tyre_stiffness(SMALL_LAG), of_wheel_mass(SMALL_LAG)
    # The damping ratio falls, and the unsprung frequency falls with the wheel's mass, as the swept
    # value rises.
    chosen: tuple[tuple[tuple[Variation, bool], ...], ...] = (
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
    """Tables 5.6 to 5.13 and the text around them."""
    return Conclusion([*_tables(), *_table_5_13(), *statements()], (), REMARKS)


REMARKS = (
    "(5.37) prints b_s u for k_t u and (5.38) k_t for k_s; the matrix (5.43) has both right.",
    "(5.55) and (5.56) are lost; they are derived anew from (5.49) to (5.54).",
)
STUDY = Study(
    "quarter-car-stability",
    "stability of the quarter car with lags",
    "5",
    (*span("Table", "5.", 6, 13), "Equation 5.57"),
    conclude,
)
