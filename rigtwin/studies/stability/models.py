"""State-space models of the thesis (§5.1 to 5.3, §6.2) as python-control systems with named states.

The input μ, in N, is the force that the motion u of the ground exerts: k u + b u̇ through the
suspension of a single mass, k_t u + b_t u̇ through the tyre of a quarter car.

The thesis has misprints that are corrected here:

- (5.7) and (5.16) print −k and −b for +k and +b in the row of the mass: a spring that would push
  the mass away from its rest.
- (5.16) prints +1/τ for −1/τ in the row of the lagged velocity.
- (5.13) adds μ after the force filter; (5.17) adds it before the filter, as this module does.
- (5.37) prints b_s u for k_t u, and (5.38) k_t for k_s; the matrix (5.43) has both right.
- (5.55) and (5.56) are missing. Here (5.55) is (5.53) and (5.54) as first-order rows, and (5.56)
  adds a filter of the suspension's force to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from control import StateSpace

from rigtwin.studies.stability.vehicle import QuarterCar, SingleMass, check_time, validate

GROUND = "mu"
Rows = Mapping[str, Mapping[str, float]]
"""State → coefficients of its time derivative, by state or `mu`."""


class Lags(NamedTuple):
    """First-order lags of the rig, in s (§6.2).

    Attributes
    ----------
    force
        Lag of the force loop.
    plate
        Lag of the plate's cylinder.
    travel, velocity
        Lags of the filters of the travel and of its velocity.
    """

    force: float
    plate: float
    travel: float
    velocity: float


def ideal_single_mass(mass: SingleMass) -> StateSpace:
    """Return the model of a single mass without lags (5.7)."""
    m, k, b = validate(mass)
    return _system(
        {
            "position": {"velocity": 1.0},
            "velocity": {"position": -k / m, "velocity": -b / m, GROUND: 1.0 / m},
        },
        "position",
    )


def single_mass_suspension(mass: SingleMass, *lags: float) -> StateSpace:
    """Return the model of a single mass whose force passes through first-order lags (5.13).

    Several lags, in s, act in series (§5.1.6).
    """
    m, k, b = validate(mass)
    demanded = {"position": k, "velocity": b, GROUND: -1.0}
    rows: dict[str, dict[str, float]] = {}
    # Each lag filters the output of the one before: τ ẏ + y = x.
    for number, lag in enumerate(lags):
        check_time("lag", lag)
        state = "force" if number == len(lags) - 1 else f"force_{number + 1}"
        rows[state] = {state: -1.0 / lag} | {name: value / lag for name, value in demanded.items()}
        demanded = {state: 1.0}
    rows |= {
        "position": {"velocity": 1.0},
        "velocity": {name: -value / m for name, value in demanded.items()},
    }
    return _system(rows, "position")


def single_mass_structure(mass: SingleMass, lag: float) -> StateSpace:
    """Return the model of a single mass whose position and velocity pass through a lag (5.16).

    Both lags have the same time constant, in s. The plate stands at the lagged position.
    """
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
    """Return the model of a quarter car without lags (5.43)."""
    return _quarter_car(car, {}, _force(car, "body", "body_velocity"))


def suspension(car: QuarterCar, lag: float) -> StateSpace:
    """Return the model of a quarter car whose suspension force has a lag, in s (5.48)."""
    return _quarter_car(
        car, {"force": _filtered_force(car, "body", "body_velocity", lag)}, {"force": 1.0}
    )


def structure(car: QuarterCar, lag: float) -> StateSpace:
    """Return the model of a quarter car whose sprung mass moves with a lag (5.55).

    Position and velocity of the sprung mass have the same lag, in s; see (5.49) to (5.54).
    """
    return _quarter_car(car, _plate(lag), _force(car, "plate", "plate_velocity"), "plate")


def combined(car: QuarterCar, force_lag: float, structure_lag: float) -> StateSpace:
    """Return the model of a quarter car with lags of force and sprung mass, in s (5.56).

    The force filter is fed the lagged position and velocity of the sprung mass.
    """
    force = _filtered_force(car, "plate", "plate_velocity", force_lag)
    return _quarter_car(car, {"force": force} | _plate(structure_lag), {"force": 1.0}, "plate")


def rig(car: QuarterCar, lags: Lags) -> StateSpace:
    """Return the model of the rig (Figure 6.14).

    The plate follows the sprung mass with a lag. Travel and its velocity are measured at the plate
    and filtered. The force follows its demand with a lag.
    """
    for lag in lags:
        check_time("lag", lag)
    plate = _lag_row("plate", "body", lags.plate)
    # Travel is measured between plate and wheel, then filtered: τ ẏ + y = plate − wheel.
    travel = {"plate": 1.0 / lags.travel, "wheel": -1.0 / lags.travel, "travel": -1.0 / lags.travel}
    # The velocity filter is fed the derivative of the plate's lagged position.
    velocity = {name: value / lags.velocity for name, value in plate.items()}
    velocity |= {"wheel_velocity": -1.0 / lags.velocity, "velocity": -1.0 / lags.velocity}
    demanded = {"travel": car.suspension_stiffness, "velocity": car.suspension_damping}
    force = {name: value / lags.force for name, value in demanded.items()} | {
        "force": -1.0 / lags.force
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
"""Name of a model → function that returns it with the same value, in s, for all lags. The names
are those of `rigtwin.studies.stability.loop.LOOPS`."""


def poles(system: StateSpace) -> np.ndarray:
    """Return the poles, in 1/s, sorted as by `sort_poles`."""
    return sort_poles(np.asarray(system.poles()))


def rightmost(system: StateSpace) -> complex:
    """Return the pole with the largest real part, in 1/s; of a pair, the one with Im > 0."""
    # Rounding makes the real parts of a pair equal, so that the imaginary part decides.
    return complex(max(poles(system).tolist(), key=lambda pole: (round(pole.real, 9), pole.imag)))


def sort_poles(poles: np.ndarray) -> np.ndarray:
    """Return poles sorted by real part; of a pair, the one with positive frequency first."""
    # The real parts of a pair differ in their last bits; rounding keeps the pair together.
    return poles[np.lexsort((-poles.imag, np.round(poles.real, 9)))]


def _lag_row(output: str, source: str, lag: float) -> dict[str, float]:
    """Return the row of a first-order lag, τ ẏ + y = x (5.11)."""
    return {output: -1.0 / check_time("lag", lag), source: 1.0 / lag}


def _plate(lag: float) -> dict[str, dict[str, float]]:
    """Return the rows of the plate's position and velocity (5.50, 5.52)."""
    return {
        "plate": _lag_row("plate", "body", lag),
        "plate_velocity": _lag_row("plate_velocity", "body_velocity", lag),
    }


def _force(car: QuarterCar, position: str, velocity: str) -> dict[str, float]:
    """Return the suspension force, in N, which pulls the sprung mass down and the wheel up."""
    k, b = car.suspension_stiffness, car.suspension_damping
    return {position: k, velocity: b, "wheel": -k, "wheel_velocity": -b}


def _filtered_force(car: QuarterCar, position: str, velocity: str, lag: float) -> dict[str, float]:
    """Return the row of the suspension force after its lag (5.45)."""
    check_time("lag", lag)
    return {name: value / lag for name, value in _force(car, position, velocity).items()} | {
        "force": -1.0 / lag
    }


def _quarter_car(
    car: QuarterCar, filters: Rows, force: dict[str, float], *outputs: str
) -> StateSpace:
    """Return the system of both masses (5.46, 5.47) under a suspension force."""
    validate(car)
    tyre = {"wheel": -car.tyre_stiffness, "wheel_velocity": -car.tyre_damping, GROUND: 1.0}
    # The wheel feels the suspension's force and the tyre's; the sprung mass feels the reaction.
    wheel = {name: force.get(name, 0.0) + tyre.get(name, 0.0) for name in force | tyre}
    rows = {
        "wheel": {"wheel_velocity": 1.0},
        "body": {"body_velocity": 1.0},
        "wheel_velocity": {name: value / car.unsprung_mass for name, value in wheel.items()},
        "body_velocity": {name: -value / car.sprung_mass for name, value in force.items()},
    }
    return _system({**filters, **rows}, "wheel", "body", *outputs)


def _system(rows: Rows, *outputs: str) -> StateSpace:
    """Assemble a state-space system from its rows, with the states' names."""
    states = list(rows)
    # The coefficient of a state that a row does not name is 0.
    dynamics = np.array([[row.get(state, 0.0) for state in states] for row in rows.values()])
    ground = np.array([[row.get(GROUND, 0.0)] for row in rows.values()])
    read = np.array([[float(state == output) for state in states] for output in outputs])
    return StateSpace(
        dynamics, ground, read, 0.0, states=states, inputs=[GROUND], outputs=list(outputs)
    )
