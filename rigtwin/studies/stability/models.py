"""The thesis' state-space models as python-control systems with named states (§5.1 to 5.3, §6.2).

μ is what the ground does: k u + b u̇ of the suspension for a single mass, k_t u + b_t u̇ of the
tyre for a quarter car, N.

Corrected here: (5.7) and (5.16) print −k and −b in the row of the mass, which would be a spring
that pushes away; (5.16) also +1/τ for −1/τ in the row of the lagged velocity. (5.13) feeds μ past
the force filter, (5.17) through it, as is done here. (5.37) prints b_s u for k_t u and (5.38) k_t
for k_s; the matrix (5.43) has both right. (5.55) and (5.56) are lost; they are (5.53) and (5.54) as
first-order rows, and the same with the suspension's force through a filter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from control import StateSpace

from rigtwin.studies.stability.vehicle import QuarterCar, SingleMass, checked_time, validate

GROUND = "mu"
Rows = Mapping[str, Mapping[str, float]]
"""State → the coefficients of its time derivative by state, or `mu`."""


class Lags(NamedTuple):
    """First-order lags of the rig, s (§6.2): of the force, of the plate, and of the filters of
    travel and of its velocity."""

    force: float
    plate: float
    travel: float
    velocity: float


def ideal_single_mass(mass: SingleMass) -> StateSpace:
    """(5.7)."""
    m, k, b = validate(mass)
    return _system(
        {
            "position": {"velocity": 1.0},
            "velocity": {"position": -k / m, "velocity": -b / m, GROUND: 1.0 / m},
        },
        "position",
    )


def single_mass_suspension(mass: SingleMass, *lags: float) -> StateSpace:
    """(5.13): the force comes through a first-order lag, s; through several in series for
    §5.1.6."""
    m, k, b = validate(mass)
    demanded = {"position": k, "velocity": b, GROUND: -1.0}
    rows: dict[str, dict[str, float]] = {}
    for number, lag in enumerate(lags):
        checked_time("lag", lag)
        state = "force" if number == len(lags) - 1 else f"force_{number + 1}"
        rows[state] = {state: -1.0 / lag} | {name: value / lag for name, value in demanded.items()}
        demanded = {state: 1.0}
    rows |= {
        "position": {"velocity": 1.0},
        "velocity": {name: -value / m for name, value in demanded.items()},
    }
    return _system(rows, "position")


def single_mass_structure(mass: SingleMass, lag: float) -> StateSpace:
    """(5.16): position and velocity of the mass come through a lag each, s. The plate is where the
    lagged position is."""
    m, k, b = validate(mass)
    return _system(
        {
            "plate": _lag_row("plate", "position", lag),
            "plate_velocity": _lag_row("plate_velocity", "velocity", lag),
            "position": {"velocity": 1.0},
            "velocity": {"plate": -k / m, "plate_velocity": -b / m, GROUND: 1.0 / m},
        },
        "position",
        "plate",
    )


def ideal_quarter_car(car: QuarterCar) -> StateSpace:
    """(5.43)."""
    return _quarter_car(car, {}, _force(car, "body", "body_velocity"))


def suspension(car: QuarterCar, lag: float) -> StateSpace:
    """(5.48): the suspension's force comes through a lag, s."""
    return _quarter_car(
        car,
        {"force": _filtered_force(car, "body", "body_velocity", lag)},
        {"force": 1.0},
    )


def structure(car: QuarterCar, lag: float) -> StateSpace:
    """(5.55), from (5.49) to (5.54): position and velocity of the sprung mass come through a lag
    each, s."""
    return _quarter_car(car, _plate(lag), _force(car, "plate", "plate_velocity"), "plate")


def combined(car: QuarterCar, force_lag: float, structure_lag: float) -> StateSpace:
    """(5.56): the force filter is fed the lagged position and velocity of the sprung mass. Lags in
    s."""
    force = _filtered_force(car, "plate", "plate_velocity", force_lag)
    return _quarter_car(car, {"force": force} | _plate(structure_lag), {"force": 1.0}, "plate")


def rig(car: QuarterCar, lags: Lags) -> StateSpace:
    """Figure 6.14: the plate follows the sprung mass, travel and its velocity are measured from the
    plate and filtered, and the force follows its demand."""
    for lag in lags:
        checked_time("lag", lag)
    plate = _lag_row("plate", "body", lags.plate)
    travel = {"plate": 1.0 / lags.travel, "wheel": -1.0 / lags.travel, "travel": -1.0 / lags.travel}
    velocity = {name: value / lags.velocity for name, value in plate.items()}
    velocity |= {"wheel_velocity": -1.0 / lags.velocity, "velocity": -1.0 / lags.velocity}
    demanded = {"travel": car.suspension_stiffness, "velocity": car.suspension_damping}
    force = {name: value / lags.force for name, value in demanded.items()} | {
        "force": -1.0 / lags.force,
    }
    return _quarter_car(
        car,
        {"force": force, "plate": plate, "travel": travel, "velocity": velocity},
        {"force": 1.0},
        "plate",
    )


MODELS: Mapping[str, Callable[[QuarterCar, float], StateSpace]] = {
    "single-mass": lambda car, lag: single_mass_suspension(car.sprung, lag),
    "suspension": suspension,
    "structure": structure,
    "combined": lambda car, lag: combined(car, lag, lag),
    "rig": lambda car, lag: rig(car, Lags(lag, lag, lag, lag)),
}
"""Model → its system with all lags equal, s; the names are those of
`rigtwin.studies.stability.loop.LOOPS`."""


def poles(system: StateSpace) -> np.ndarray:
    """The poles, 1/s, from the left to the right; of a pair the one with positive frequency
    first."""
    return in_order(np.asarray(system.poles()))


def rightmost(system: StateSpace) -> complex:
    """The pole with the largest real part, of a pair the one with positive frequency, 1/s."""
    return complex(max(poles(system).tolist(), key=lambda pole: (round(pole.real, 9), pole.imag)))


def in_order(found: np.ndarray) -> np.ndarray:
    """Poles from the left to the right, of a pair the one with positive frequency first."""
    # Rounded, or the two of a pair would be in the order of their last bits.
    return found[np.lexsort((-found.imag, np.round(found.real, 9)))]


def _lag_row(output: str, source: str, lag: float) -> dict[str, float]:
    """τ ẏ + y = x (5.11)."""
    return {output: -1.0 / checked_time("lag", lag), source: 1.0 / lag}


def _plate(lag: float) -> dict[str, dict[str, float]]:
    """(5.50) and (5.52)."""
    return {
        "plate": _lag_row("plate", "body", lag),
        "plate_velocity": _lag_row("plate_velocity", "body_velocity", lag),
    }


def _force(car: QuarterCar, position: str, velocity: str) -> dict[str, float]:
    """The suspension's force, which pulls the sprung mass down and the wheel up, N."""
    k, b = car.suspension_stiffness, car.suspension_damping
    return {position: k, velocity: b, "wheel": -k, "wheel_velocity": -b}


def _filtered_force(car: QuarterCar, position: str, velocity: str, lag: float) -> dict[str, float]:
    """(5.45)."""
    checked_time("lag", lag)
    return {name: value / lag for name, value in _force(car, position, velocity).items()} | {
        "force": -1.0 / lag,
    }


def _quarter_car(
    car: QuarterCar,
    filters: Rows,
    force: dict[str, float],
    *outputs: str,
) -> StateSpace:
    """Both masses (5.46, 5.47) under that force."""
    validate(car)
    tyre = {"wheel": -car.tyre_stiffness, "wheel_velocity": -car.tyre_damping, GROUND: 1.0}
    wheel = {name: force.get(name, 0.0) + tyre.get(name, 0.0) for name in force | tyre}
    rows = {
        "wheel": {"wheel_velocity": 1.0},
        "body": {"body_velocity": 1.0},
        "wheel_velocity": {name: value / car.unsprung_mass for name, value in wheel.items()},
        "body_velocity": {name: -value / car.sprung_mass for name, value in force.items()},
    }
    return _system({**filters, **rows}, "wheel", "body", *outputs)


def _system(rows: Rows, *outputs: str) -> StateSpace:
    states = list(rows)
    dynamics = np.array([[row.get(state, 0.0) for state in states] for row in rows.values()])
    ground = np.array([[row.get(GROUND, 0.0)] for row in rows.values()])
    read = np.array([[float(state == output) for state in states] for output in outputs])
    return StateSpace(
        dynamics,
        ground,
        read,
        0.0,
        states=states,
        inputs=[GROUND],
        outputs=list(outputs),
    )
