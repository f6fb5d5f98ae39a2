"""A landing in full size and at the scale of the rig (thesis §3.5)."""

from __future__ import annotations

import math

import numpy as np

from controllers.quantity import Quantity, fields
from experiments.thesis.entry import Entry, statement
from experiments.thesis.landing import Landing, touch_down
from experiments.thesis.study import Drawing, sheet
from rigtwin.components import Cylinder
from rigtwin.components.gas_spring import equilibrium, find_charge, stiffness
from rigtwin.numerics.arrays import Array
from rigtwin.studies.similitude import Scaling, scale_values, scaling, slow_down

BOEING = Landing()
UNITS = {
    name: meaning.unit for name, meaning in fields(Landing).items() if isinstance(meaning, Quantity)
}
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
    # Position, velocity and force have scales of their own, and time another.
    factors = np.array([scale.factor(unit) for unit in ("m", "m/s", "N")])
    return touch_down(landing, instants * scale.time) / factors[:, None]


def difference(original: Array, mapped: Array) -> float:
    """Return the largest difference of two landings, relative to the peak of each signal."""
    return float(
        np.max(np.abs(mapped - original) / np.max(np.abs(original), axis=1, keepdims=True))
    )


def landings() -> tuple[list[Entry], Drawing, list[str]]:
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
    rest = equilibrium(BOEING.spring, BOEING.sprung_mass * BOEING.gravity)
    no_lift = float(np.max(touch_down(BOEING._replace(lift=0.0), INSTANTS)[0]))
    inside = float(np.max(touch_down(BOEING, INSTANTS)[0]))
    return [
        "Tables 3.2 and 3.3: 500 kg and 0.559 m are right, not 200 kg and 0.589 m. Table 3.3's "
        "figures with a sprung mass of 200 kg are no similar system: that landing, mapped back, "
        f"is off by {100.0 * off:.0f} % of the peak.",
        "Gas spring: length, 24.7 MN/m and 76 % follow from 0.559 m, exponent 1.4 and three "
        "times the static load fully compressed; the text says 0.589 m and four times. No stroke "
        "gives the 3.79 MN/m at equilibrium: the closed form is "
        f"{1e-6 * stiffness(BOEING.spring, rest):.2f} MN/m.",
        f"Pseudo-dynamic: {BOEING.velocity:g} m/s are {real.factor('m/s') * BOEING.velocity:.3f} "
        f"m/s on the rig; a time scale of {slow.time:.3f} brings them to "
        f"{Cylinder().speed_limit:g} m/s. Forces fall by its square: the gas charge from "
        f"{pressures[0]:.2f} to {pressures[1]:.2f} bar. To keep the gas spring, scale its force "
        "in place of the mass: the numerical sprung mass is then "
        f"{force_preserving.mass * BOEING.sprung_mass:.0f} kg and the wheel "
        f"{force_preserving.mass * BOEING.unsprung_mass:.0f} kg. A real gas spring that is "
        "compressed slower gives off more heat, so its exponent falls: time cannot be stretched "
        "freely where the gas is hardware.",
        "Eq. 3.4 and 3.5 as printed lack the exponent γ, take the tyre's "
        "deflection between the masses and leave out the "
        "wheel's weight; the landing is simulated with all three put right.",
        "With full weight from touch-down on, as in Eq. 3.4, the strut is compressed by "
        f"{no_lift:.3f} m, of {RECONSTRUCTED[1]:g} m; with lift that fades over "
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
        "A Boeing 707 lands at 3 m/s: full size, and the rig of 500 kg and 0.18 m of stroke in "
        f"real time and {scales[1].time:.2f} times slower. Mapped back by the scale factors they "
        f"differ by {worst:.0e} of the peak at most; Table 3.3's figures with Table 3.2's 200 kg "
        f"by {100.0 * off:.0f} %."
    )
    return Drawing("similitude", "Landing, §3.5", caption, figure)
