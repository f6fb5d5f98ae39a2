"""Thesis §3.5: the landing gear of a Boeing 707 scaled down to the rig.

The study covers Tables 3.1 to 3.3, the gas spring, and a landing simulated in full size and at the
scale of the rig.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from controllers.quantity import Quantity, fields
from experiments.thesis.entry import Entry, digits, number, statement
from experiments.thesis.landing import Landing, touch_down
from experiments.thesis.study import Conclusion, Drawing, Result, ThesisStudy, sheet
from experiments.vehicles import VEHICLES, configuration
from rigtwin.components import Cylinder, Motor
from rigtwin.components.gas_spring import (
    GasSpring,
    design,
    equilibrium,
    find_charge,
    spring_force,
    stiffness,
)
from rigtwin.numerics.arrays import Array
from rigtwin.studies.similitude import (
    Scaling,
    largest_change,
    pi_groups,
    scale_values,
    scaling,
    slow_down,
)

BOEING = Landing()
UNITS = {
    name: meaning.unit for name, meaning in fields(Landing).items() if isinstance(meaning, Quantity)
}
UNITS |= {"stroke": "m", "time": "s"}
RIG_STROKE = 0.18
"""Stroke of the rig, m (Table 3.2)."""
PRINTED = (200.0, 0.589)
"""Printed sprung mass of the rig, kg, and stroke of the landing gear, m (Table 3.2, §3.5)."""
RECONSTRUCTED = (500.0, 0.559)
"""Values that Table 3.3 and the stiffness of the gas spring require; 0.559 m are 22 in."""
BORE, ROD = 0.050, 0.032
"""Bore and rod of a standard cylinder, m, assumed.

Its annulus gives the printed area, volume and pressure.
"""
INSTANTS = np.linspace(0.0, 3.0, 1501)
"""Times of the landing in full size, s."""


def similar(mass: float, stroke: float, time: float = 1.0) -> Scaling:
    """Return the scale factors, rig over aircraft.

    mass: sprung mass of the rig, kg; stroke: stroke of the landing gear, m; time: scale of time.
    """
    return scaling(
        UNITS,
        {"sprung_mass": mass / BOEING.sprung_mass, "stroke": RIG_STROKE / stroke, "time": time},
    )


def at_scale(landing: Landing, scale: Scaling) -> Landing:
    """Return the parameters of the scaled system."""
    return Landing(**scale_values(landing._asdict(), UNITS, scale))


def mapped_back(landing: Landing, scale: Scaling, instants: Array) -> Array:
    """Simulate a scaled landing and map it back to full size, shape (3, n).

    The simulation runs at the size and pace of the rig. instants: times in full size, s.
    """
    factors = np.array([scale.factor(unit) for unit in ("m", "m/s", "N")])
    return touch_down(landing, instants * scale.time) / factors[:, None]


def difference(original: Array, mapped: Array) -> float:
    """Return the largest difference of two landings, relative to the peak of each signal."""
    return float(
        np.max(np.abs(mapped - original) / np.max(np.abs(original), axis=1, keepdims=True))
    )


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


def _springs() -> dict[str, tuple[GasSpring, float]]:
    """Return two gas springs with their strokes, m, by a description.

    The first is as printed: its exponent follows from four times the static load at full
    compression. The second has the exponent 1.4 that the printed stiffness requires.
    """
    # F_full = F_0 (L/(L − x))^γ with F_full four times the load gives γ.
    load, length = BOEING.sprung_mass * BOEING.gravity, BOEING.gas_length
    _, printed = PRINTED
    exponent = math.log(4.0 * load / BOEING.gas_force) / math.log(length / (length - printed))
    as_printed = f"0.589 m and four times the static load (exponent {exponent:.3f})"
    return {
        as_printed: (GasSpring(BOEING.gas_force, length, exponent), printed),
        "0.559 m and exponent 1.4": (BOEING.spring, RECONSTRUCTED[1]),
    }


WRONG_STROKE = "0.589 m and four times are not what this was computed with"


def _equation_3() -> list[Entry]:
    """Return the entries of the gas spring, Eq. 3.3."""
    where, load = "Equation 3.3", BOEING.sprung_mass * BOEING.gravity
    _, stroke = RECONSTRUCTED
    pressed = spring_force(BOEING.spring, stroke) / load
    beyond = "sized for three times: its length, 24.7 MN/m and 76 % ask for that"
    soft, hard = (
        1e-6 * stiffness(BOEING.spring, x) for x in (equilibrium(BOEING.spring, load), stroke)
    )
    rated = 1e-6 * VEHICLES["boeing-707"].suspension_stiffness
    return [
        *_spring_design(where, load),
        *(
            entry
            for words, (spring, travel) in _springs().items()
            for entry in _spring_stiffness(where, load, words, spring, travel)
        ),
        digits(
            where,
            "force fully compressed over static load, exponent 1.4",
            "4",
            pressed,
            "1",
            beyond,
        ),
        statement(
            where,
            "rated stiffness",
            "11.25 MN/m lies between equilibrium and full compression",
            soft < rated < hard,
            f"{soft:.2f} < {rated:.2f} < {hard:.2f}",
        ),
    ]


def _spring_design(where: str, load: float) -> list[Entry]:
    """Return the entries of the spring's charge, length and stroke; load: static load, N."""
    lengths = [
        design(load / 4.0, factor * load, stroke, BOEING.exponent).length
        for factor, stroke in ((4.0, PRINTED[1]), (3.0, RECONSTRUCTED[1]))
    ]
    return [
        digits(
            where, "force fully extended, a quarter of the static load", "167285", load / 4.0, "N"
        ),
        digits(
            where,
            "length for 0.589 m, exponent 1.4, four times the static load",
            "0.673",
            lengths[0],
            "m",
            WRONG_STROKE,
        ),
        digits(
            where,
            "length for 0.559 m, exponent 1.4, three times the static load",
            "0.673",
            lengths[1],
            "m",
        ),
        digits(
            where,
            "stroke at which an exponent of 1.4 has 24.7 MN/m",
            "0.589",
            _reaches(BOEING.spring, 24.7e6),
            "m",
            "0.559 m (22 in) is right: length, stiffness and equilibrium here, "
            "velocity and gas force in Table 3.3 all need it",
        ),
    ]


def _spring_stiffness(
    where: str, load: float, words: str, spring: GasSpring, travel: float
) -> list[Entry]:
    """Return the entries of a spring's stiffness and equilibrium; travel: its stroke, m."""
    at_rest = equilibrium(spring, load)
    differs = WRONG_STROKE if travel == PRINTED[1] else ""
    small = (
        "the stroke is not in it; 3.79 MN/m is reached "
        f"{1e3 * (_reaches(spring, 3.79e6) - at_rest):.1f} mm further on"
    )
    return [
        digits(
            where,
            f"stiffness at equilibrium, {words}",
            "3.79",
            1e-6 * stiffness(spring, at_rest),
            "MN/m",
            small,
        ),
        digits(
            where,
            f"stiffness fully compressed, {words}",
            "24.7",
            1e-6 * stiffness(spring, travel),
            "MN/m",
            differs,
        ),
        digits(
            where,
            f"equilibrium over stroke, {words}",
            "76",
            100.0 * at_rest / travel,
            "%",
            differs,
        ),
    ]


def _reaches(spring: GasSpring, wanted: float) -> float:
    """Return the compression at which a gas spring has a stiffness, m; wanted: N/m.

    The stiffness k = γ F L^γ / (L − x)^(γ + 1) is solved for x.
    """
    constant = spring.exponent * spring.force * spring.length**spring.exponent
    return spring.length - (constant / wanted) ** (1.0 / (spring.exponent + 1.0))


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
    wheel, damper, fast = (
        number("8.36") / BOEING.unsprung_mass,
        number("772") / BOEING.damping,
        number("0.966"),
    )
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


def _cylinder() -> list[Entry]:
    """Return the entries of the gas spring's cylinder and of the actuators' capability."""
    rig = at_scale(BOEING, similar(*RECONSTRUCTED))
    return [*_charge(rig.spring), *_capability(rig)]


def _charge(spring: GasSpring) -> list[Entry]:
    """Return the entries of area, volume and pressure of the cylinder and its accumulator."""
    # The spring's gas acts on the annulus around the rod.
    where, area = "§3.5", math.pi / 4.0 * (BORE**2 - ROD**2)
    charge, plain = (find_charge(spring, a, RIG_STROKE) for a in (area, number("0.0012")))
    bar = 1e-5
    source = (
        "annulus of a 50 mm bore with a 32 mm rod; an area of "
        "0.00116 m² gives all three printed figures"
    )
    litres = "a thousand times too large: litres, not m³"
    ratio = charge.gas / charge.cylinder
    odd = BOEING.exponent * BOEING.gas_length / PRINTED[1]
    gas = (
        "by the thesis' own rule cylinder : gas = stroke : length, "
        f"1 : {ratio:.3f}; printed 1 : {334 / 209:.3f}, "
        f"near 1.4 · 0.673/0.589 = {odd:.3f}, as if multiplied by the exponent"
    )
    return [
        digits(where, "cylinder's area", "0.0012", area, "m²", source),
        digits(
            where, "cylinder's volume, in m³ as printed", "209e-3", charge.cylinder, "m³", litres
        ),
        digits(where, "cylinder's volume, in litres", "209e-3", 1e3 * charge.cylinder, "l"),
        digits(where, "initial pressure", "3.41", bar * charge.pressure, "bar"),
        digits(
            where,
            "initial pressure, area as printed",
            "3.41",
            bar * plain.pressure,
            "bar",
            "0.0012 m² is rounded",
        ),
        digits(where, "accumulator's volume, in m³ as printed", "334e-3", charge.gas, "m³", litres),
        digits(where, "accumulator's volume, in litres", "334e-3", 1e3 * charge.gas, "l", gas),
    ]


def _capability(rig: Landing) -> list[Entry]:
    """Return the entries that compare the scaled landing with the limits of the actuators."""
    where, motor, limit = "§3.5", Motor(), Cylinder().speed_limit
    damper = rig.damping * rig.velocity
    return [
        digits(where, "stroke of the electric actuator", "0.21", motor.stroke, "m", "the twin's"),
        digits(
            where, "force of the electric actuator", "1860", motor.force_limit, "N", "the twin's"
        ),
        digits(
            where, "maximum velocity of the hydraulic actuator", "0.3", limit, "m/s", "the twin's"
        ),
        statement(
            where,
            "damping force against the actuator",
            "well within its capability",
            damper < motor.force_limit,
            f"{damper:.0f} N of {motor.force_limit:g} N",
            f"the gas spring's {spring_force(rig.spring, RIG_STROKE):.0f} "
            "N fully compressed are not; it has to be hardware",
        ),
        statement(
            where,
            "velocity",
            "greater than 0.3 m/s",
            rig.velocity > limit,
            f"{rig.velocity:.3f} m/s",
        ),
        statement(
            where,
            "gravity without a scale of time",
            "is altered",
            # Without a scale of time, accelerations scale like the stroke; gravity does not.
            not math.isclose(rig.gravity, BOEING.gravity, rel_tol=1e-3),
            f"{rig.gravity:.2f} m/s² on the rig",
        ),
    ]


def _landings() -> tuple[list[Entry], Drawing, list[str]]:
    """Return the entries, the drawing and the remarks of the simulated landing."""
    real = similar(*RECONSTRUCTED)
    # The pseudo-dynamic test slows time until the sinking speed is within the cylinder's limit.
    slow = slow_down(real, BOEING.velocity, Cylinder().speed_limit)
    full = touch_down(BOEING, INSTANTS)
    pairs = [(scale, at_scale(BOEING, scale)) for scale in (real, slow)]
    backs = [mapped_back(landing, scale, INSTANTS) for scale, landing in pairs]
    # The values of Table 3.3 with the sprung mass of Table 3.2: not a similar system.
    mixed = pairs[0][1]._replace(sprung_mass=PRINTED[0])
    wrong = mapped_back(mixed, real, INSTANTS)
    deviations = [difference(full, back) for back in backs]
    off = difference(full, wrong)
    fastest = [
        float(np.max(np.abs(back[1]))) * scale.factor("m/s")
        for (scale, _), back in zip(pairs, backs, strict=True)
    ]
    limit = Cylinder().speed_limit
    entries = [
        statement(
            "§3.5",
            f"simulated landing mapped back, {words}",
            "can be scaled back to the original system",
            worst < 1e-6,
            f"largest difference {worst:.0e} of the peak; sprung "
            f"mass up to {speed:.3f} m/s on the rig",
        )
        for words, worst, speed in zip(
            ("real time", f"{slow.time:.2f} times slower"), deviations, fastest, strict=True
        )
    ]
    entries.append(
        statement(
            "§3.5",
            "pseudo-dynamic time scale",
            "lowers the velocity requirement",
            fastest[1] <= limit * (1.0 + 1e-9) < fastest[0],
            f"{slow.time:.2f} times slower for {limit:g} m/s",
        )
    )
    return (
        entries,
        _drawing(full, backs, wrong, [scale for scale, _ in pairs], off),
        _remarks(real, slow, off),
    )


def _rest() -> float:
    """Return the compression of the aircraft's spring at rest, m."""
    return equilibrium(BOEING.spring, BOEING.sprung_mass * BOEING.gravity)


def _remarks(real: Scaling, slow: Scaling, off: float) -> list[str]:
    """Return the remarks on Tables 3.2 and 3.3 and on the pseudo-dynamic test."""
    area = math.pi / 4.0 * (BORE**2 - ROD**2)
    # Forces scale with 1/t² of the time scale, and the gas pressure with them.
    pressures = [
        1e-5 * find_charge(at_scale(BOEING, each).spring, area, RIG_STROKE).pressure
        for each in (real, slow)
    ]
    # The gas spring as hardware keeps its force, so the force's scale is prescribed instead of
    # the mass's.
    force_preserving = scaling(
        UNITS, {"gas_force": real.factor("N"), "stroke": real.length, "time": slow.time}
    )
    # Without lift the full weight acts from touch-down on, as in the printed equation.
    no_lift = float(np.max(touch_down(BOEING._replace(lift=0.0), INSTANTS)[0]))
    inside = float(np.max(touch_down(BOEING, INSTANTS)[0]))
    return [
        "Tables 3.2 and 3.3: 500 kg and 0.559 m are right, not 200 kg and "
        "0.589 m. Table 3.3's figures with a sprung mass of "
        "200 kg are no similar system: that landing, mapped back, "
        f"is off by {100.0 * off:.0f} % of the peak.",
        "Gas spring: length, 24.7 MN/m and 76 % follow from 0.559 m, "
        "exponent 1.4 and three times the static load fully "
        "compressed; the text says 0.589 m and four times. No stroke gives "
        "the 3.79 MN/m at equilibrium: the closed form is "
        f"{1e-6 * stiffness(BOEING.spring, _rest()):.2f} MN/m.",
        f"Pseudo-dynamic: {BOEING.velocity:g} m/s are "
        f"{real.factor('m/s') * BOEING.velocity:.3f} m/s on the rig; a time scale "
        f"of {slow.time:.3f} brings them to {Cylinder().speed_limit:g} "
        "m/s. Forces fall by its square: the gas charge from "
        f"{pressures[0]:.2f} to {pressures[1]:.2f} bar. To keep the gas "
        "spring, scale its force in place of the mass: the "
        f"numerical sprung mass is then {force_preserving.mass * BOEING.sprung_mass:.0f} kg "
        "and the wheel "
        f"{force_preserving.mass * BOEING.unsprung_mass:.0f} kg. A real gas spring that "
        "is compressed slower gives off more heat, so its "
        "exponent falls: time cannot be stretched freely where the gas is hardware.",
        "Eq. 3.4 and 3.5 as printed lack the exponent γ, take the tyre's "
        "deflection between the masses and leave out the "
        "wheel's weight; the landing is simulated with all three put right.",
        "With full weight from touch-down on, as in Eq. 3.4, the "
        f"strut is compressed by {no_lift:.3f} m, of "
        f"{RECONSTRUCTED[1]:g} m; with lift that fades over "
        f"{BOEING.lift_time:g} s by {inside:.3f} m.",
    ]


SIGNALS = (
    ("strut compression", "m", 1.0),
    ("velocity of the sprung mass", "m/s", 1.0),
    ("strut force", "kN", 1e-3),
)
STYLES = (("rig, real time", "#2a6fa8", "--"), ("rig, pseudo-dynamic", "#d1603d", ":"))


def _drawing(
    full: Array, backs: list[Array], wrong: Array, scales: list[Scaling], off: float
) -> Drawing:
    """Draw the landing in full size, mapped back from the rig, and on the rig."""
    figure, axes = sheet(2, len(SIGNALS), 13.0, 3.4)
    worst = max(difference(full, back) for back in backs)
    for column, (name, unit, size) in enumerate(SIGNALS):
        above, below = axes[0][column], axes[1][column]
        above.set_title(f"{name}, {unit}: mapped back", fontsize=9)
        above.plot(INSTANTS, size * full[column], color="#c3c8d0", linewidth=6.0, label="full size")
        below.set_title(f"{name}, {unit if size == 1.0 else 'N'}: on the rig", fontsize=9)
        for (label, colour, dashes), back, scale in zip(STYLES, backs, scales, strict=True):
            above.plot(
                INSTANTS, size * back[column], dashes, color=colour, linewidth=2.0, label=label
            )
            on_rig = scale.factor(("m", "m/s", "N")[column]) * back[column]
            below.plot(
                INSTANTS * scale.time,
                on_rig,
                color=colour,
                label=f"{label}, time scale {scale.time:.2f}",
            )
        above.plot(
            INSTANTS,
            size * wrong[column],
            color="#6b7280",
            linewidth=0.8,
            label="Table 3.3 with 200 kg",
        )
        above.set_xlabel("s of full size", fontsize=8)
        below.set_xlabel("s on the rig", fontsize=8)
    for sign in (-1.0, 1.0):
        axes[1][1].axhline(
            sign * Cylinder().speed_limit, color="black", linewidth=0.8, linestyle="--"
        )
    axes[1][1].text(
        9.6,
        1.1 * Cylinder().speed_limit,
        "hydraulic actuator ± 0.3 m/s",
        fontsize=7,
        ha="right",
        va="bottom",
    )
    axes[0][1].legend(fontsize=7, loc="lower right")
    axes[1][2].legend(fontsize=7)
    caption = (
        "A Boeing 707 lands at 3 m/s: full size, and the rig of "
        "500 kg and 0.18 m of stroke in real time and "
        f"{scales[1].time:.2f} times slower. Mapped back by the scale factors "
        f"they differ by {worst:.0e} of the peak at most; "
        f"Table 3.3's figures with Table 3.2's 200 kg by {100.0 * off:.0f} %."
    )
    return Drawing(
        "similitude", "landing in full size and at the rig's scale, §3.5", caption, figure
    )


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, the drawing and the remarks of §3.5."""
    entries, drawing, remarks = _landings()
    tables = [*_table_1(), *_equation_3(), *_equation_6(), *_table_2(), *_table_3(), *_cylinder()]
    return Conclusion((*tables, *entries), (drawing,), tuple(remarks))


STUDY = ThesisStudy(
    "similitude",
    "Dynamic similitude: a Boeing 707's landing gear at the rig's scale",
    "3",
    ("Table 3.1", "Table 3.2", "Table 3.3", "Equation 3.3", "Equation 3.6", "Equation 3.8"),
    conclude,
)
