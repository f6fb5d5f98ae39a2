"""§6.2: stability of the vehicles of Table 6.1 on the rig with its four lags."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from control import StateSpace
from scipy.linalg import expm

from controllers import Settings
from experiments.thesis.entry import Entry, digits, statement
from experiments.thesis.study import Conclusion, Drawing, Result, ThesisStudy, sheet, span
from experiments.vehicles import VEHICLES
from rigtwin.studies.stability.critical import Critical, critical_delay, critical_lag
from rigtwin.studies.stability.loop import LOOPS
from rigtwin.studies.stability.models import Lags, ideal_quarter_car, rig, rightmost
from rigtwin.studies.stability.vehicle import QuarterCar

LAG = 0.01
"""Time constant of each of the four filters, s (§6.2)."""
RIG = Lags(LAG, LAG, LAG, LAG)
LIGHT_WHEEL = 40.0
"""Unsprung mass with which the car of Table 6.1 behaves as §6.2 says, kg. 400 kg is printed."""
UNLOADED = 0.1
"""Share of the body's weight that the spring does not carry when the body is released."""
PRINTED_RATIOS = {
    "boeing-707": "0.0094",
    "truck": "0.0484",
    "car": "0.0650",
    "motorcycle": "0.0987",
}
CAR_NOTE = "the unsprung mass of 400 kg is a misprint of 40 kg, with which it is unstable"
SHOWN = (
    ("boeing-707", "6.15", "6.16", 0.45),
    ("truck", "6.17", "6.18", 0.5),
    ("car, 40 kg wheel", "6.19", "6.20", 6.0),
    ("car", "6.19, as printed", "6.20, as printed", 3.0),
    ("motorcycle", "6.21", "6.22", 3.0),
)
"""Vehicle, figures of its body and of its wheel, and time shown, s."""


def vehicles() -> dict[str, QuarterCar]:
    """Return the vehicles of Table 6.1 and the car with the corrected unsprung mass.

    The tyres have no damping.
    """
    cars = {
        name: QuarterCar(tyre_damping=0.0, **vehicle._asdict())
        for name, vehicle in VEHICLES.items()
    }
    return cars | {"car, 40 kg wheel": cars["car"]._replace(unsprung_mass=LIGHT_WHEEL)}


def growth(car: QuarterCar) -> complex:
    """Return the rightmost pole on the rig: growth rate, 1/s, and frequency, rad/s."""
    return rightmost(rig(car, RIG))


def drop(system: StateSpace, car: QuarterCar, time: np.ndarray) -> dict[str, np.ndarray]:
    """Simulate the release of the body with a tenth of its weight unsupported.

    Parameters
    ----------
    system : StateSpace
        Linear rig or ideal quarter car.
    car : QuarterCar
        Vehicle of the system.
    time : ndarray
        Times, s, in equal steps from 0, shape (n,).

    Returns
    -------
    dict
        Positions of `body` and `wheel` relative to their rest, m, shape (n,).
    """
    # Without input the exact step is x[n + 1] = exp(A T) x[n]: no integration error, even though
    # the motion grows without bound.
    step = expm(np.asarray(system.A) * (time[1] - time[0]))
    states = np.empty((len(time), len(system.state_labels)))
    states[0] = _start(system, car)
    for before, after in pairwise(range(len(time))):
        states[after] = step @ states[before]
    return {part: states[:, system.state_labels.index(part)] for part in ("body", "wheel")}


def _start(system: StateSpace, car: QuarterCar) -> np.ndarray:
    """Return the initial state, relative to the rest after the drop, with every filter settled."""
    force = UNLOADED * car.sprung_mass * Settings().gravity
    # Before the release both springs lack the unsupported force F, and are longer by F/k.
    travel, wheel = force / car.suspension_stiffness, force / car.tyre_stiffness
    start = {
        "force": force,
        "travel": travel,
        "plate": travel + wheel,
        "body": travel + wheel,
        "wheel": wheel,
    }
    return np.array([start.get(label, 0.0) for label in system.state_labels])


def _entries(cars: Mapping[str, QuarterCar]) -> list[Entry]:
    """Return all entries of Table 6.1 and §6.2."""
    entries = []
    for name, printed in PRINTED_RATIOS.items():
        car = cars[name]
        ratio = car.suspension_damping / car.suspension_stiffness
        entries.append(digits("Table 6.1", f"b_s/k_s of the {name}", printed, ratio, "s"))
    truck = cars["truck"].sprung.damping_ratio
    note = "the text's assumption does not follow from the table: it is half critical"
    entries.append(
        statement(
            "Table 6.1",
            "damping of the truck",
            "critical",
            abs(truck - 1.0) < 0.05,
            f"ζ = {truck:.3f}",
            note,
        )
    )
    for name, body, wheel, _ in SHOWN:
        pole, note = growth(cars[name]), CAR_NOTE if name == "car" else ""
        for figure in (body, wheel):
            where = f"Figure {figure.partition(',')[0]}"
            words = f"{pole.real:+.3f} ± {pole.imag:.2f}j 1/s"
            entries.append(
                statement(
                    where, f"{name}, four lags of 10 ms", "unstable", pole.real > 0.0, words, note
                )
            )
    # Real part of the rightmost pole: the rate at which the fastest mode grows.
    rates = {name: growth(car).real for name, car in cars.items()}
    slow = (rates["car, 40 kg wheel"], rates["motorcycle"])
    words = ", ".join(f"{name} {rate:+.3g} 1/s" for name, rate in rates.items())
    fastest = rates["boeing-707"] > rates["truck"] > max(slow) and min(slow) > 0.0
    entries.append(
        statement(
            "§6.2",
            "growth",
            "fastest for the aircraft, then the truck, then the others",
            fastest,
            words,
        )
    )
    return [*entries, *_all_dampings(cars)]


def _all_dampings(cars: Mapping[str, QuarterCar]) -> list[Entry]:
    """Judge §6.2: `The system was actually unstable for all damping values`."""
    entries = []
    for name, car in cars.items():
        # Six decades about the printed damping.
        dampings = car.suspension_damping * np.logspace(-3.0, 3.0, 601)
        real = np.array(
            [growth(car._replace(suspension_damping=float(damping))).real for damping in dampings]
        )
        stable = dampings[real < 0.0]
        words = f"at best {real.min():+.3g} 1/s, at {dampings[real.argmin()]:.4g} Ns/m"
        if len(stable):
            words += f"; stable from {stable[0]:.4g} to {stable[-1]:.4g} Ns/m"
        note = CAR_NOTE if name == "car" else ""
        entries.append(
            statement(
                "§6.2", f"{name}, any suspension damping", "unstable", not len(stable), words, note
            )
        )
    return entries


def _drawing(cars: Mapping[str, QuarterCar]) -> Drawing:
    """Draw the released vehicles on the rig and in the ideal system (Fig. 6.15 to 6.22)."""
    figure, axes = sheet(len(SHOWN), 2, width=11.0, height=2.3)
    for row, (name, body, wheel, seconds) in zip(axes, SHOWN, strict=True):
        car, time = cars[name], np.linspace(0.0, seconds, 3000)
        rate = growth(car).real
        moved, ideal = drop(rig(car, RIG), car, time), drop(ideal_quarter_car(car), car, time)
        for axis, numbered, part in zip(row, (body, wheel), ("body", "wheel"), strict=True):
            axis.plot(time, 1e3 * moved[part], linewidth=0.9, label="on the rig")
            axis.plot(time, 1e3 * ideal[part], color="0.6", linewidth=0.9, zorder=1, label="ideal")
            # The fastest growing mode dominates soon; its envelope is e^(σ t).
            height = 1e3 * _share(car, part) * np.exp(rate * time)
            axis.plot(
                time,
                height,
                "--",
                color="#d1603d",
                linewidth=0.8,
                label="envelope of the rightmost mode",
            )
            axis.plot(time, -height, "--", color="#d1603d", linewidth=0.8)
            axis.set_title(f"Figure {numbered}: {name}, {part}, {rate:+.3g} 1/s", fontsize=9)
            axis.set_xlabel("time, s", fontsize=8)
            axis.set_ylabel("position, mm", fontsize=8)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    caption = "The body let go with a tenth of its weight unsupported."
    return Drawing("vehicles-drop", "Figure 6.15 to 6.22", caption, figure)


def _share(car: QuarterCar, part: str) -> float:
    """Return the initial amplitude of the rightmost mode in a drop, m."""
    system = rig(car, RIG)
    values, vectors = np.linalg.eig(np.asarray(system.A))
    # The initial state as a sum of modes: V w = x(0).
    weights = np.linalg.solve(vectors, _start(system, car))
    row, column = system.state_labels.index(part), int(np.argmax(values.real))
    # The pair of conjugate modes adds up to twice the modulus of one.
    return float(2.0 * abs(vectors[row, column] * weights[column]))


def _format_critical(critical: Critical | None) -> str:
    """Format a critical lag or delay with its frequency."""
    return f"{1e3 * critical.time:.2f} ms ({critical.frequency:.1f} rad/s)" if critical else "none"


def _remarks(cars: Mapping[str, QuarterCar]) -> list[str]:
    """Return the critical lag and delay of every vehicle, one line each."""
    return [
        f"{name}: four equal lags are critical at "
        f"{_format_critical(critical_lag(LOOPS['rig'](car)))}, four equal pure delays at "
        f"{_format_critical(critical_delay(LOOPS['rig'](car)))}."
        for name, car in cars.items()
    ]


def conclude(results: Mapping[str, Result]) -> Conclusion:
    """Return the entries, the drawing and the remarks of §6.2."""
    cars = vehicles()
    return Conclusion(_entries(cars), (_drawing(cars),), _remarks(cars))


STUDY = ThesisStudy(
    "vehicles-stability",
    "the vehicles of Table 6.1 on the rig with four lags of 10 ms",
    "6",
    ("Table 6.1", *span("Figure", "6.", 15, 22)),
    conclude,
)
