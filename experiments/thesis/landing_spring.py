"""The gas spring of the landing gear, its cylinder, and the actuators beside it (thesis §3.5)."""

from __future__ import annotations

import math

from experiments.thesis.entry import Entry, digits, number, statement
from experiments.thesis.landing import Landing
from experiments.thesis.scaled_landing import (
    BOEING,
    BORE,
    PRINTED,
    RECONSTRUCTED,
    RIG_STROKE,
    ROD,
    at_scale,
    similar,
)
from experiments.vehicles import VEHICLES
from rigtwin.components import Cylinder, Motor
from rigtwin.components.gas_spring import (
    GasSpring,
    design,
    equilibrium,
    find_charge,
    spring_force,
    stiffness,
)


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


def equation_3() -> list[Entry]:
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
            where, f"equilibrium over stroke, {words}", "76", 100.0 * at_rest / travel, "%", differs
        ),
    ]


def _reaches(spring: GasSpring, wanted: float) -> float:
    """Return the compression at which a gas spring has a stiffness, m; wanted: N/m.

    The stiffness k = γ F L^γ / (L − x)^(γ + 1) is solved for x.
    """
    # Differentiating F = F_0 (L/(L − x))^γ gives k = γ F_0 L^γ (L − x)^−(γ+1).
    constant = spring.exponent * spring.force * spring.length**spring.exponent
    return spring.length - (constant / wanted) ** (1.0 / (spring.exponent + 1.0))


def cylinder() -> list[Entry]:
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
        f"by the thesis' own rule cylinder : gas = stroke : length, 1 : {ratio:.3f}; printed 1 : "
        f"{334 / 209:.3f}, near 1.4 · 0.673/0.589 = {odd:.3f}, as if multiplied by the exponent"
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
