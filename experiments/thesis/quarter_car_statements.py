"""§5.3 to §5.6: what the text says of the quarter car's critical lag and of the mode that crosses
first."""

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
"""s, critical for suspension MIL (Table 5.6)."""
SMALL_LAG = 0.0333
"""s, at which the wheel's part in stability is judged: below b/k, where the suspension alone is
stable."""
RANDOM_CARS = 60
BEYOND = np.logspace(0.01, 3.0, 12)
"""Of the critical lag, where it is asked what else becomes unstable."""
AROUND = np.array(ARBITRARY._replace(tyre_damping=10.0))
"""What vehicles drawn at random are spread about."""


def statements() -> list[Entry]:
    """What the text of §5.3 to §5.6 says."""
    random = np.random.default_rng(0)
    cars = [
        QuarterCar(*map(float, np.exp(random.normal(0.0, 1.0, 6)) * AROUND))
        for _ in range(RANDOM_CARS)
    ]
    undamped = [car._replace(tyre_damping=0.0) for car in cars]
    off = max(
        abs(
            _time(critical_lag(LOOPS["suspension"](car)))
            * car.suspension_stiffness
            / car.suspension_damping
            - 1.0
        )
        for car in undamped
    )
    damped = _time(critical_lag(LOOPS["suspension"](ARBITRARY._replace(tyre_damping=10.0))))
    at = f"of {RANDOM_CARS} vehicles drawn at random"
    where, what, says = "Equation 5.57", "critical lag of suspension MIL", "b/k whatever the tyre"
    note = "as Table 5.6, case 4: it holds without tyre damping alone"
    words = f"{damped:.4f} s, b/k = {SUSPENSION_LAG:g} s"
    entries = [
        statement(where, what, says, off < 1e-9, f"within {off:.1g} {at}, no tyre damping"),
        statement(
            where,
            f"{what}, tyre damping 10",
            says,
            abs(damped - SUSPENSION_LAG) < 1e-6,
            words,
            note,
        ),
    ]
    for name, drawn in (("no tyre damping", undamped), ("tyre damping", cars)):
        for model, where in (("structure", "§5.3.6"), ("combined", "§5.6")):
            count = sum(_first_mode(model, car) == WHEEL for car in drawn)
            note = "it holds without tyre damping alone" if count else ""
            words = f"the wheel hop first in {count} {at}"
            says = "the body hop becomes unstable first"
            entries.append(statement(where, f"{model} MIL, {name}", says, count == 0, words, note))
        entries.append(_only_body(name, drawn))
    return [*entries, *_tendencies(), *_contradictions()]


def _only_body(name: str, drawn: Sequence[QuarterCar]) -> Entry:
    """§5.3.6: `only the body hop poles can become unstable regardless of system parameters`."""
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
    says, note = (
        "only the body hop can become unstable",
        "false for slow wheels, heavy or on soft tyres" if any(unstable) else "",
    )
    return statement("§5.3.6", f"structure MIL, {name}", says, not any(unstable), words, note)


def _tendencies() -> list[Entry]:
    """§5.3.6, from the tables: which way each parameter moves the critical lag of the structure."""
    words = {
        "suspension_stiffness": ("high: unstable", False),
        "sprung_mass": ("low: unstable", True),
        "tyre_stiffness": ("high: stable", True),
        "unsprung_mass": ("low: stable", False),
    }
    entries = []
    for name, (says, rises) in words.items():
        less, more = (
            structure_lag(**{name: factor * getattr(ARBITRARY, name)})
            for factor in (1.0 / 1.2, 1.2)
        )
        found = (
            f"critical lag {1e3 * less:.2f} ms with a sixth less of "
            f"it, {1e3 * more:.2f} ms with a fifth more"
        )
        what = f"structure MIL, {name.replace('_', ' ')}"
        entries.append(statement("§5.3.6", what, says, (less < more) == rises, found))
    low, own, high = (
        structure_lag(suspension_damping=damping) for damping in (50.0, 200.0, 1000.0)
    )
    found = (
        f"critical lag {1e3 * low:.2f}, {1e3 * own:.2f}, "
        f"{1e3 * high:.2f} ms at 50, 200 and 1000 Ns/m"
    )
    bad = "unstable if too low or too high"
    entries.append(
        statement("§5.3.6", "structure MIL, suspension damping", bad, own > max(low, high), found)
    )
    none, some = (structure_lag(tyre_damping=damping) for damping in (0.0, 10.0))
    found = f"critical lag {1e3 * none:.2f} and {1e3 * some:.2f} ms at 0 and 10 Ns/m"
    entries.append(
        statement("§5.3.6", "structure MIL, tyre damping", "stabilises", some > none, found)
    )
    return entries


def structure_lag(**changes: float) -> float:
    """Critical, s, of the structure MIL with other values of the vehicle."""
    return _time(critical_lag(LOOPS["structure"](ARBITRARY._replace(**changes))))


def _contradictions() -> list[Entry]:
    """Sentences that the tables and appendix A contradict."""
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


def _modes(found: Locus, end: int) -> str:
    """The unstable ones at the first or the last value of a sweep."""
    return " and ".join(found.unstable_modes(float(found.values[end]))) or "none"


def _first_mode(model: str, car: QuarterCar) -> str | None:
    """Which mode crosses first as the lag grows."""
    found = critical_lag(LOOPS[model](car))
    return mode(car, 1j * found.frequency) if found else None


def _wheel_too(car: QuarterCar) -> bool:
    """Whether the structure's lag can make the wheel hop unstable, alone or beside the body hop."""
    critical = _time(critical_lag(LOOPS["structure"](car)))
    found = Locus("structure", critical * BEYOND, lambda lag: Setting(car, lag))
    return any(WHEEL in found.unstable_modes(float(lag)) for lag in found.values)


def _time(found: Critical | None) -> float:
    return found.time if found else float("inf")
