"""§5.1: formulas of the single mass, and Figures 5.4 and 5.6."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from control import StateSpace
from matplotlib.colors import LogNorm
from scipy.optimize import root_scalar

from experiments.thesis.entry import Entry, digits, statement
from experiments.thesis.study import Drawing, sheet
from rigtwin.studies.stability.critical import critical_lag
from rigtwin.studies.stability.loop import single_mass
from rigtwin.studies.stability.models import single_mass_structure, single_mass_suspension
from rigtwin.studies.stability.vehicle import SingleMass

MASS = SingleMass(50.0, 500.0, 100.0)
"""Single mass of §5.1.4: mass, kg, stiffness, N/m, damping, Ns/m."""
SOFT = SingleMass(50.0, 41.4, 1.0)
"""Single mass of Table 5.2."""
FILTER = 0.01
"""Time constant of both lags of (5.31), s."""


def formulas() -> list[Entry]:
    """Return the entries of critical lags, Cardano's formula and the two lags of §5.1.6."""
    random = np.random.default_rng(0)
    # Log-normal factors with σ = 2: the formulas must hold far from the printed values.
    masses = [SingleMass(*map(float, np.exp(random.normal(0.0, 2.0, 3)) * MASS)) for _ in range(20)]
    criticals = [critical_lag(single_mass(mass)) for mass in masses]
    # τ_c k/b − 1, and ω_c/√(k/m) − 1: both vanish if (5.28) holds.
    time_errors = [
        each.time * mass.stiffness / mass.damping - 1.0 if each else math.inf
        for each, mass in zip(criticals, masses, strict=True)
    ]
    frequency_errors = [
        each.frequency / mass.natural_frequency - 1.0 if each else math.inf
        for each, mass in zip(criticals, masses, strict=True)
    ]
    worst, worst_frequency = max(map(abs, time_errors)), max(map(abs, frequency_errors))
    sample = "of 20 masses drawn at random"
    return [
        statement(
            "Equation 5.28",
            "critical lag",
            "τ_c = b/k",
            worst < 1e-9,
            f"within {worst:.1g} of b/k {sample}",
        ),
        statement(
            "§5.1.5",
            "at the critical lag",
            "as undamped",
            worst_frequency < 1e-9,
            f"at √(k/m) within {worst_frequency:.1g} {sample}",
        ),
        _region_entry(),
        _equivalence(),
        *_cardano(),
        *_double_lag(),
    ]


def _region_entry() -> Entry:
    """Return the entry of Figure 5.4: how the critical lag depends on each parameter."""
    nominal = _critical(MASS)
    doubled = {
        name: _critical(MASS._replace(**{name: 2.0 * getattr(MASS, name)})) for name in MASS._fields
    }
    holds = (
        doubled["damping"] > nominal > doubled["stiffness"]
        and abs(doubled["mass"] / nominal - 1.0) < 1e-9
    )
    words = ", ".join(f"{time:.4g} s with twice the {name}" for name, time in doubled.items())
    claim = "larger with damping, smaller with stiffness, no matter the mass"
    return statement("Figure 5.4", "critical lag", claim, holds, f"{nominal:.4g} s; {words}")


def _equivalence() -> Entry:
    """Return the entry of (5.17): suspension MIL and structure MIL are the same system.

    From the ground's motion to its output, a lag on the force equals a lag on the position.
    """
    lag, frequencies = 0.1, np.logspace(-1.0, 3.0, 50)
    s = 1j * frequencies
    spring = MASS.damping * s + MASS.stiffness
    # (5.17): (b s + k) / (m τ s³ + m s² + b s + k).
    printed = spring / (MASS.mass * lag * s**3 + MASS.mass * s**2 + spring)
    force = _response(single_mass_suspension(MASS, lag), "position", s)
    plate = _response(single_mass_structure(MASS, lag), "plate", s)
    # The models' input is the ground's force k u + b u̇; times (b s + k) it becomes the ground's
    # motion.
    deviation = max(float(np.max(np.abs(each * spring / printed - 1.0))) for each in (force, plate))
    note = "with the ground's share of the force filtered too, which (5.13) leaves out"
    return statement(
        "Equation 5.17",
        "suspension and structure MIL",
        "identical",
        deviation < 1e-9,
        f"both within {deviation:.1g} of (5.17)",
        note,
    )


def _response(system: StateSpace, output: str, s: np.ndarray) -> np.ndarray:
    """Return the frequency response of one output of a system to its only input."""
    return np.asarray(system(s, squeeze=False))[system.output_labels.index(output), 0]


def _cardano() -> list[Entry]:
    """Return the entries of Cardano's root (5.18), with (5.21) to (5.24), of the cubic (5.17)."""
    tau = 0.1
    m, k, b = MASS
    # (5.17) divided by m τ: s³ + s²/τ + b s/(m τ) + k/(m τ), coefficients rising.
    cubic = np.polynomial.Polynomial([k / (tau * m), b / (tau * m), 1.0 / tau, 1.0])

    def remainder(a: float, b_: float) -> float:
        # s = ∛(A + √(A² + B³)) + ∛(A − √(A² + B³)) − 1/(3τ), real cube roots.
        root = np.emath.sqrt(a**2 + b_**3)
        s = (
            complex(a + root) ** (1.0 / 3.0)
            if a + root > 0
            else -(complex(-(a + root)) ** (1.0 / 3.0))
        )
        t = (
            complex(a - root) ** (1.0 / 3.0)
            if a - root > 0
            else -(complex(-(a - root)) ** (1.0 / 3.0))
        )
        return abs(cubic(s + t - 1.0 / (3.0 * tau)))

    printed = remainder(
        1 / (27 * tau**3) - b / (6 * m * tau**2) - k / (2 * m * tau),
        1 / (9 * tau**2) + b / (3 * m * tau),
    )
    corrected = remainder(
        -1 / (27 * tau**3) + b / (6 * m * tau**2) - k / (2 * m * tau),
        -1 / (9 * tau**2) + b / (3 * m * tau),
    )
    note = (
        "A = −1/(27τ³) + b/(6mτ²) − k/(2mτ) and B = −1/(9τ²) "
        "+ b/(3mτ): three signs are lost in print"
    )
    return [
        statement(
            "Equation 5.18",
            "with (5.23) and (5.24) as printed",
            "a root of (5.17)",
            printed < 1e-6,
            f"leaves {printed:.3g}",
            note,
        ),
        statement(
            "Equation 5.18",
            "with the signs put right",
            "a root of (5.17)",
            corrected < 1e-6,
            f"leaves {corrected:.2g}",
        ),
    ]


def _double_lag() -> list[Entry]:
    """Return the entries of §5.1.6: two lags of 10 ms, and the single lag that replaces them."""

    def phase(frequency: float) -> float:
        return math.degrees(-2.0 * math.atan(frequency * FILTER))

    # 2 atan(ω T) = 45°, solved numerically to check the printed 41.4 rad/s.
    at_45_degrees = _root(lambda frequency: phase(frequency) + 45.0)
    frequencies = np.linspace(0.1, 0.999, 200) * at_45_degrees
    # Both filters lag by 45° at the same frequency; below it they differ slightly.
    lead = [
        phase(frequency) - math.degrees(-math.atan(frequency / at_45_degrees))
        for frequency in frequencies
    ]

    def excess(stiffness: float, lags: int, lag: float) -> float:
        critical = critical_lag(single_mass(SOFT._replace(stiffness=stiffness), lags))
        return (critical.time if critical else math.inf) - lag

    # The stiffness at which the lag is critical, with the damping of 1 Ns/m: numerically k/b.
    first = _root(lambda k: excess(k, 1, 1.0 / at_45_degrees))
    second = _root(lambda k: excess(k, 2, FILTER))
    safe = f"up to 45° the second order filter is ahead by {min(lead):.2g} to {max(lead):.2g}°"
    return [
        digits("§5.1.6", "frequency of 45° lag", "41.4", at_45_degrees, "rad/s"),
        digits(
            "§5.1.6",
            "k/b, first order, marginal",
            "41.6",
            first,
            "1/s",
            "41.4 in (5.32) and Table 5.2, which is right",
        ),
        digits(
            "§5.1.6",
            "k/b, second order, marginal",
            "49.5",
            second,
            "1/s",
            "(2 − τ b/m)/(4τ) = 49.995",
        ),
        statement(
            "Figure 5.6",
            "first order filter",
            "slightly larger lag up to 45°: safe",
            min(lead) > 0.0,
            safe,
        ),
    ]


def _root(function: Callable[[float], float]) -> float:
    """Return the root of a function between 10 and 100."""
    return float(root_scalar(function, bracket=(10.0, 100.0), method="brentq", xtol=1e-9).root)


def region() -> Drawing:
    """Draw Figure 5.4: the critical lag over stiffness and damping."""
    figure, axes = sheet(1, 1, width=7.0, height=5.0)
    stiffness, dampings = np.linspace(100.0, 2000.0, 24), np.linspace(10.0, 400.0, 24)
    lags = np.array([[_critical(SingleMass(MASS.mass, k, b)) for k in stiffness] for b in dampings])
    levels = [0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6]
    shades = axes[0][0].contourf(
        stiffness, dampings, lags, levels=[0.005, *levels, 4.0], cmap="viridis", norm=LogNorm()
    )
    lines = axes[0][0].contour(
        stiffness, dampings, lags, levels=levels, colors="white", linewidths=0.8
    )
    axes[0][0].clabel(lines, fmt="%g s", fontsize=8)
    figure.colorbar(shades, ax=axes[0][0], label="critical lag τ_c, s: stable below it")
    axes[0][0].set_xlabel("suspension stiffness k, N/m")
    axes[0][0].set_ylabel("suspension damping b, Ns/m")
    axes[0][0].set_title("Figure 5.4: stability region of the single mass", fontsize=10)
    return Drawing(
        "single-mass-region",
        "Figure 5.4",
        "The critical lag over stiffness and damping; it is b/k.",
        figure,
    )


def _critical(mass: SingleMass) -> float:
    """Return the critical lag of a mass, s; infinite if every lag is stable."""
    critical = critical_lag(single_mass(mass))
    return critical.time if critical else math.inf


def bode() -> Drawing:
    """Draw Figure 5.6: the Bode plot of both filters."""
    figure, axes = sheet(2, 1, width=8.0, height=2.8)
    frequencies = np.logspace(0.0, 4.0, 400)
    # 2 atan(ω T) = 45° at ω = tan(22.5°)/T = (√2 − 1)/T.
    at_45_degrees = (math.sqrt(2.0) - 1.0) / FILTER
    for name, coefficients in (
        ("second order (5.31)", [FILTER**2, 2.0 * FILTER, 1.0]),
        ("first order (5.32)", [1.0 / at_45_degrees, 1.0]),
    ):
        response = 1.0 / np.polyval(coefficients, 1j * frequencies)
        axes[0][0].semilogx(frequencies, 20.0 * np.log10(np.abs(response)), label=name)
        axes[1][0].semilogx(frequencies, np.degrees(np.unwrap(np.angle(response))), label=name)
    axes[1][0].plot(
        at_45_degrees,
        -45.0,
        "o",
        color="black",
        markerfacecolor="white",
        label=f"45° at {at_45_degrees:.1f} rad/s",
    )
    axes[0][0].set_ylabel("magnitude, dB")
    axes[1][0].set_ylabel("phase, degrees")
    axes[1][0].set_xlabel("frequency, rad/s")
    axes[0][0].set_title(
        "Figure 5.6: two lags of 10 ms and the one that stands for them", fontsize=10
    )
    for row in axes:
        row[0].legend(fontsize=8)
    return Drawing("single-mass-filters", "Figure 5.6", "Bode plot of (5.31) and (5.32).", figure)
