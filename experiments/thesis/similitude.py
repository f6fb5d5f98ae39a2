"""Thesis §3.5: the landing gear of a Boeing 707 scaled down to the rig.

The study covers Tables 3.1 to 3.3, the gas spring, and a landing simulated in full size and at the
scale of the rig.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from experiments.thesis.entry import Entry, digits, number, statement
from experiments.thesis.landing_spring import cylinder, equation_3
from experiments.thesis.scaled_landing import (
    BOEING,
    PRINTED,
    RECONSTRUCTED,
    RIG_STROKE,
    UNITS,
    at_scale,
    landings,
    similar,
)
from experiments.thesis.study import Conclusion, Result, ThesisStudy
from experiments.vehicles import VEHICLES, configuration
from rigtwin.studies.similitude import largest_change, pi_groups, scale_values, scaling

UNITS |= {"stroke": "m", "time": "s"}


def _table_1() -> list[Entry]:
    """Return the entries of Table 3.1: the vehicle that the twin runs."""
    vehicle, tyre = VEHICLES["boeing-707"], configuration(VEHICLES["boeing-707"]).plant.tyre
    note = "Table 6.1's, as the twin runs it"
    return [
        digits("Table 3.1", "sprung mass", "68210", vehicle.sprung_mass, "kg", note),
        digits("Table 3.1", "unsprung mass", "1140", vehicle.unsprung_mass, "kg", note),
        digits(
            "Table 3.1",
            "suspension stiffness",
            "11250000",
            vehicle.suspension_stiffness,
            "N/m",
            note,
        ),
        digits(
            "Table 3.1", "suspension damping", "105400", vehicle.suspension_damping, "Ns/m", note
        ),
        digits("Table 3.1", "tyre stiffness", "8461000", tyre.stiffness, "N/m", note),
        digits("Table 3.1", "tyre damping", "0", tyre.damping, "Ns/m", note),
    ]


VARIABLES = {
    "m_u": "kg",
    "m_s": "kg",
    "x_u": "m",
    "x_s": "m",
    "u": "m",
    "L": "m",
    "P_iA_g": "N",
    "b_s": "Ns/m",
    "b_t": "Ns/m",
    "k_t": "N/m",
    "g": "m/s^2",
    "t": "s",
}
"""Unit of every variable of Eq. 3.6, by its symbol."""


def _equation_6() -> list[Entry]:
    """Return the entries of the dimensionless groups (Eq. 3.6) and the scale factors (Eq. 3.8)."""
    # Repeating variables stand for mass, length and time, as in the thesis.
    groups = pi_groups(VARIABLES, ("m_s", "x_s", "t"))
    # The groups in the order of the variables, as the thesis lists them.
    ours = ", ".join(str(group) for group in groups)
    printed = (
        {"m_u": 1, "m_s": -1},
        {"x_u": 1, "x_s": -1},
        {"u": 1, "x_s": -1},
        {"L": 1, "x_s": -1},
        {"P_iA_g": 1, "t": 2, "x_s": -1, "m_s": -1},
        {"b_s": 1, "t": 1, "m_s": -1},
        {"b_t": 1, "t": 1, "m_s": -1},
        {"k_t": 1, "t": 2, "m_s": -1},
        {"g": 1, "t": 2, "x_s": -1},
    )
    identical = [dict(group.exponents) for group in groups] == [dict(group) for group in printed]
    note = (
        "numbered to π8 because there are two π4; the exponent "
        "γ, a group of its own, is not counted"
    )
    change = _change_of_groups()
    return [
        statement(
            "Equation 3.6",
            "groups of 12 variables",
            "n − m dimensionless groups, listed",
            identical,
            ours,
            note,
        ),
        statement(
            "Equation 3.8",
            "nine relations of factors",
            "keep every group",
            change < 1e-12,
            f"to {change:.0e}, time scale too",
        ),
    ]


def _change_of_groups() -> float:
    """Return the largest violation of Eq. 3.8, and of the groups, by arbitrary scale factors."""
    # Arbitrary, unrelated factors: relations that hold only for round numbers would fail.
    scale = scaling(VARIABLES, {"m_s": 0.0123, "x_s": 0.345, "t": 6.78})
    # Eq. 3.8: both sides of every relation are products of scale factors.
    relations = (
        "m_s = m_u",
        "x_s = x_u",
        "x_s = u",
        "x_s = L",
        "m_s x_s = P_iA_g t t",
        "m_s = b_s t",
        "m_s = b_t t",
        "m_s = k_t t t",
        "x_s = g t t",
    )
    sides = [
        [
            math.prod(scale.factor(VARIABLES[name]) for name in side.split())
            for side in relation.split(" = ")
        ]
        for relation in relations
    ]
    violation = max(abs(first / second - 1.0) for first, second in sides)
    # Any scale factors that satisfy these relations keep the groups, and no others do.
    before = dict.fromkeys(VARIABLES, 1.0)
    return max(violation, largest_change(VARIABLES, before, scale_values(before, VARIABLES, scale)))


def _table_2() -> list[Entry]:
    """Return the entries of Table 3.2, worked back from the scaled values of Table 3.3."""
    where, (_, stroke) = "Table 3.2", RECONSTRUCTED
    # Ratios of Table 3.3 to Table 3.1: the scale factors of mass, damping, and the speed.
    wheel = number("8.36") / BOEING.unsprung_mass
    damper = number("772") / BOEING.damping
    fast = number("0.966")
    because = "wheel mass and damping of Table 3.3 both ask for 500 kg; 500 is right"
    back = "worked back from Table 3.3"
    return [
        digits(
            where,
            "rig suspension stroke, of 0.559 m",
            "0.18",
            fast / BOEING.velocity * stroke,
            "m",
            back,
        ),
        digits(
            where,
            "rig suspension stroke, of 0.589 m",
            "0.18",
            fast / BOEING.velocity * PRINTED[1],
            "m",
            "0.559 m is right",
        ),
        digits(
            where,
            "rig sprung mass, by the wheel mass",
            "200",
            wheel * BOEING.sprung_mass,
            "kg",
            because,
        ),
        digits(
            where,
            "rig sprung mass, by the damping",
            "200",
            damper * BOEING.sprung_mass,
            "kg",
            because,
        ),
        digits(where, "time scaling factor, mass over damping", "1", wheel / damper, "1", back),
        digits(where, "landing velocity, of 0.559 m", "3", fast / RIG_STROKE * stroke, "m/s", back),
    ]


def _table_3() -> list[Entry]:
    """Return the entries of Table 3.3, from the printed and the reconstructed mass and stroke."""
    entries = []
    for mass, stroke in (PRINTED, RECONSTRUCTED):
        rig = at_scale(BOEING, similar(mass, stroke))
        words = f"{mass:g} kg and {stroke:g} m"
        printed = (mass, stroke) == PRINTED
        note = (
            "Table 3.3 was not computed from Table 3.2; it needs 500 kg and 0.559 m"
            if printed
            else ""
        )
        product = rig.damping * rig.velocity
        # The thesis multiplies its own rounded figures.
        rounded = product if printed else round(rig.damping) * round(rig.velocity, 3)
        cut, multiplied = (
            (note, note)
            if printed
            else ("772.6, cut off and not rounded", f"773 × 0.966; unrounded {product:.1f}")
        )
        entries += [
            digits(
                "Table 3.3", f"gas spring force constant, {words}", "395", rig.gas_force, "N", note
            ),
            digits("Table 3.3", f"damping coefficient, {words}", "772", rig.damping, "Ns/m", cut),
            digits("Table 3.3", f"maximum velocity, {words}", "0.966", rig.velocity, "m/s", note),
            digits("Table 3.3", f"maximum damping force, {words}", "747", rounded, "N", multiplied),
            digits("Table 3.3", f"wheel mass, {words}", "8.36", rig.unsprung_mass, "kg", note),
        ]
    return entries


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, the drawing and the remarks of §3.5."""
    entries, drawing, remarks = landings()
    tables = [*_table_1(), *equation_3(), *_equation_6(), *_table_2(), *_table_3(), *cylinder()]
    return Conclusion((*tables, *entries), (drawing,), tuple(remarks))


STUDY = ThesisStudy(
    "similitude",
    "Dynamic similitude: a Boeing 707's landing gear at the rig's scale",
    "3",
    ("Table 3.1", "Table 3.2", "Table 3.3", "Equation 3.3", "Equation 3.6", "Equation 3.8"),
    conclude,
)
