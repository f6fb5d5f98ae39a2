"""Statements of §5.3 to §5.6: critical lag of the quarter car, and the mode that crosses first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.thesis.entry import Entry, statement
from experiments.thesis.loci import ARBITRARY, locus, of_damping_ratio, of_tyre_stiffness
from rigtwin.studies.stability.critical import Critical, critical_lag
from rigtwin.studies.stability.locus import WHEEL, Locus, Setting, mode
from rigtwin.studies.stability.loop import LOOPS
from rigtwin.studies.stability.vehicle import QuarterCar

SUSPENSION_LAG = 0.2
"""Critical lag of suspension MIL, s (Table 5.6)."""
SMALL_LAG = 0.0333
"""Lag at which the influence of the wheel on stability is judged, s.

It is below b/k, so the suspension alone is stable.
"""
RANDOM_CARS = 60
"""Number of random vehicles that test a general statement."""
BEYOND = np.logspace(0.01, 3.0, 12)
"""Multiples of the critical lag at which further unstable modes are searched."""
AROUND = np.array(ARBITRARY._replace(tyre_damping=10.0))
"""Median of the random vehicles' parameters."""


def statements() -> list[Entry]:
    """Return the entries of the statements of §5.3 to §5.6."""
    # A fixed seed, as the statement is about these vehicles and must not change from run to run.
    random = np.random.default_rng(0)
    # Log-normal factors with σ = 1: most parameters stay within a factor of 7 of the median.
    cars = [
        QuarterCar(*map(float, np.exp(random.normal(0.0, 1.0, 6)) * AROUND))
        for _ in range(RANDOM_CARS)
    ]
    # Eq. 5.57, τ_c = b/k, is derived without tyre damping.
    undamped = [car._replace(tyre_damping=0.0) for car in cars]
    # Largest |τ_c k/b − 1|, which vanishes if the equation holds.
    deviation = max(
        abs(
            _time(critical_lag(LOOPS["suspension"](car)))
            * car.suspension_stiffness
            / car.suspension_damping
            - 1.0
        )
        for car in undamped
    )
    damped = _time(critical_lag(LOOPS["suspension"](ARBITRARY._replace(tyre_damping=10.0))))
    sample = f"of {RANDOM_CARS} vehicles drawn at random"
    where = "Equation 5.57"
    quantity = "critical lag of suspension MIL"
    claim = "b/k whatever the tyre"
    note = "as Table 5.6, case 4: it holds without tyre damping alone"
    words = f"{damped:.4f} s, b/k = {SUSPENSION_LAG:g} s"
    entries = [
        statement(
            where,
            quantity,
            claim,
            deviation < 1e-9,
            f"within {deviation:.1g} {sample}, no tyre damping",
        ),
        statement(
            where,
            f"{quantity}, tyre damping 10",
            claim,
            abs(damped - SUSPENSION_LAG) < 1e-6,
            words,
            note,
        ),
    ]
    for name, drawn in (("no tyre damping", undamped), ("tyre damping", cars)):
        for model, where in (("structure", "§5.3.6"), ("combined", "§5.6")):
            count = sum(_first_mode(model, car) == WHEEL for car in drawn)
            note = "it holds without tyre damping alone" if count else ""
            words = f"the wheel hop first in {count} {sample}"
            claim = "the body hop becomes unstable first"
            entries.append(statement(where, f"{model} MIL, {name}", claim, count == 0, words, note))
        entries.append(_only_body(name, drawn))
    return [*entries, *_tendencies(), *_contradictions()]


def _only_body(name: str, drawn: Sequence[QuarterCar]) -> Entry:
    """Judge `only the body hop poles can become unstable regardless of system parameters`."""
    unstable = [_wheel_too(car) for car in drawn]
    ratios = np.array(
        [car.unsprung.natural_frequency / car.sprung.natural_frequency for car in drawn]
    )
    words = (
        f"with enough lag the wheel hop too in {sum(unstable)} "
        f"of {len(drawn)} vehicles drawn at random"
    )
    if any(unstable):
        with_it, without = (
            float(np.median(ratios[np.array(unstable) == each])) for each in (True, False)
        )
        words += (
            f"; median unsprung over sprung natural frequency {with_it:.2f} "
            f"in those, {without:.2f} in the others"
        )
    says = "only the body hop can become unstable"
    note = "false for slow wheels, heavy or on soft tyres" if any(unstable) else ""
    return statement("§5.3.6", f"structure MIL, {name}", says, not any(unstable), words, note)


def _tendencies() -> list[Entry]:
    """Return entries of §5.3.6: how every parameter moves the critical lag of structure MIL."""
    words = {
        "suspension_stiffness": ("high: unstable", False),
        "sprung_mass": ("low: unstable", True),
        "tyre_stiffness": ("high: stable", True),
        "unsprung_mass": ("low: stable", False),
    }
    entries = []
    for name, (claim, rises) in words.items():
        # A fifth up and a sixth down are the same factor of 1.2, as in the tables.
        less, more = (
            structure_lag(**{name: factor * getattr(ARBITRARY, name)})
            for factor in (1.0 / 1.2, 1.2)
        )
        finding = (
            f"critical lag {1e3 * less:.2f} ms with a sixth less of "
            f"it, {1e3 * more:.2f} ms with a fifth more"
        )
        quantity = f"structure MIL, {name.replace('_', ' ')}"
        entries.append(statement("§5.3.6", quantity, claim, (less < more) == rises, finding))
    low, middle, high = (
        structure_lag(suspension_damping=damping) for damping in (50.0, 200.0, 1000.0)
    )
    finding = (
        f"critical lag {1e3 * low:.2f}, {1e3 * middle:.2f}, "
        f"{1e3 * high:.2f} ms at 50, 200 and 1000 Ns/m"
    )
    claim = "unstable if too low or too high"
    entries.append(
        statement(
            "§5.3.6", "structure MIL, suspension damping", claim, middle > max(low, high), finding
        )
    )
    undamped, damped = (structure_lag(tyre_damping=damping) for damping in (0.0, 10.0))
    finding = f"critical lag {1e3 * undamped:.2f} and {1e3 * damped:.2f} ms at 0 and 10 Ns/m"
    entries.append(
        statement("§5.3.6", "structure MIL, tyre damping", "stabilises", damped > undamped, finding)
    )
    return entries


def structure_lag(**changes: float) -> float:
    """Return the critical lag of structure MIL, s, with some parameters of the vehicle changed."""
    return _time(critical_lag(LOOPS["structure"](ARBITRARY._replace(**changes))))


def _contradictions() -> list[Entry]:
    """Return entries of sentences that the tables and appendix A contradict."""
    soft = locus("structure", of_tyre_stiffness(SMALL_LAG))
    ratio = locus("suspension", of_damping_ratio(SUSPENSION_LAG))
    both = locus("combined", of_damping_ratio(SUSPENSION_LAG))
    return [
        statement(
            "§5.3.6",
            "structure MIL, unsprung natural frequency",
            "should be low",
            not soft.unstable_modes(float(soft.values[0])),
            f"unstable with a soft tyre: {_modes(soft, 0)}; with a stiff one: {_modes(soft, -1)}",
            "it should be high, as the sentence before, §5.7 and Table 5.13 say",
        ),
        statement(
            "§5.4",
            "suspension MIL, damping ratio",
            "unstable if high, vertical asymptotes if low",
            bool(ratio.unstable_modes(float(ratio.values[0]))),
            f"unstable at a high ratio: {_modes(ratio, 0)}; at a low one: {_modes(ratio, -1)}",
            "the words are exchanged: §A1.3, §5.7 and Table 5.13 have it right",
        ),
        statement(
            "§5.6",
            "combined MIL, wheel hop",
            "a stable asymptote at low damping ratios",
            WHEEL not in both.unstable_modes(float(both.values[-1])),
            f"unstable at a high ratio: {_modes(both, 0)}; at a low one: {_modes(both, -1)}",
            "unstable at both ends, as §A3.3 and Table 5.13 say",
        ),
    ]


def _modes(sweep: Locus, end: int) -> str:
    """Return the unstable modes at the first or the last value of a sweep, as text."""
    return " and ".join(sweep.unstable_modes(float(sweep.values[end]))) or "none"


def _first_mode(model: str, car: QuarterCar) -> str | None:
    """Return the mode that crosses first as the lag grows; None if the system stays stable."""
    critical = critical_lag(LOOPS[model](car))
    return mode(car, 1j * critical.frequency) if critical else None


def _wheel_too(car: QuarterCar) -> bool:
    """Return whether a lag of the structure can make the wheel hop unstable, alone or not."""
    critical = _time(critical_lag(LOOPS["structure"](car)))
    # Behind the critical lag one mode is unstable already; the question is whether the wheel hop
    # follows.
    sweep = Locus("structure", critical * BEYOND, lambda lag: Setting(car, lag))
    return any(WHEEL in sweep.unstable_modes(float(lag)) for lag in sweep.values)


def _time(critical: Critical | None) -> float:
    """Return a critical lag, s; infinite if the system is stable at every lag."""
    return critical.time if critical else float("inf")
