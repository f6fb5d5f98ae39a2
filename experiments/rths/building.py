"""The benchmark's building: three storeys, one column of the first being the specimen.

Silva, Gomez, Maghareh, Dyke, Spencer: Benchmark control problem for real-time hybrid simulation,
Mech. Syst. Signal Process. 135 (2020) 106381.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh, expm

from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

RATE = 4096.0
"""Sampling rate of the real-time computer, Hz."""
PERIOD = 1.0 / RATE  # s
STIFFNESS = np.array(
    [
        [26054883.87960384, -23133938.8771082, 5937035.46333915],
        [-23133938.8771082, 32560774.18638033, -14419970.77723698],
        [5937035.46333915, -14419970.77723699, 9267275.50622431],
    ]
)
"""Stiffness matrix of the whole building, N/m, shape (3, 3)."""
FLOORS = 3


class BuildingCase(NamedTuple):
    """Parameters of one case of the benchmark.

    Attributes
    ----------
    mass : float
        Mass of each floor, kg.
    damping : float
        Damping ratio of every mode, 1.
    """

    mass: float
    damping: float


CASES = {
    1: BuildingCase(1000.0, 0.05),
    2: BuildingCase(1100.0, 0.04),
    3: BuildingCase(1300.0, 0.03),
    4: BuildingCase(1000.0, 0.03),
}


class Specimen(NamedTuple):
    """The physical column.

    Attributes
    ----------
    mass : float
        Mass, kg.
    stiffness : float
        Stiffness k_e, N/m.
    damping_ratio : float
        Damping ratio, 1.
    """

    mass: float = 29.13
    stiffness: float = 1.19e6
    damping_ratio: float = 0.0097

    @property
    def damping(self) -> float:
        """Viscous damping c_e = 2 ζ √(m k), Ns/m."""
        return 2.0 * self.damping_ratio * math.sqrt(self.mass * self.stiffness)


class Sampled(NamedTuple):
    """Building sampled at `PERIOD`: x[n + 1] = a x[n] + ground ẍ_g[n] + force f[n].

    The state x holds the displacements, m, and velocities, m/s, of the floors, shape (6,).

    Attributes
    ----------
    a : ndarray
        Transition matrix, shape (6, 6).
    ground : ndarray
        Input vector of the ground acceleration, m/s², shape (6,).
    force : ndarray
        Input vector of the force on the first floor, N, shape (6,).
    """

    a: Array
    ground: Array
    force: Array


def find_case(number: int) -> BuildingCase:
    """Return a case by its number. Raises RigtwinError, listing the numbers, for another one."""
    if number not in CASES:
        raise RigtwinError(f"case {number}: expected {', '.join(map(str, CASES))}")
    return CASES[number]


def frequencies(case: BuildingCase) -> Array:
    """Return the natural frequencies of the whole building, Hz, ascending, shape (3,)."""
    # Generalised eigenvalues K φ = ω² M φ.
    # The generalised eigenproblem K φ = ω² M φ; eigh returns ω² in ascending order.
    squares, _ = eigh(STIFFNESS, case.mass * np.eye(FLOORS))
    return np.sqrt(squares) / (2.0 * math.pi)


def whole_building(case: BuildingCase) -> Sampled:
    """Return the reference: the whole building, simulated."""
    # Nothing is removed, so the force input is never used.
    return _sampled(case, Specimen(0.0, 0.0, 0.0))


def numerical_part(case: BuildingCase, nominal: Specimen) -> Sampled:
    """Return the building without the specimen, whose force acts on the first floor."""
    return _sampled(case, nominal)


def _sampled(case: BuildingCase, removed: Specimen) -> Sampled:
    """Return the sampled building with a specimen removed from the first storey."""
    mass = case.mass * np.eye(FLOORS)
    # Modal damping: C = M Φ diag(2 ζ ω_i) Φᵀ M, with Φᵀ M Φ = 1.
    squares, shapes = eigh(STIFFNESS, mass)
    modal = np.diag(2.0 * case.damping * np.sqrt(squares))
    damping = mass @ shapes @ modal @ shapes.T @ mass
    first = np.zeros((FLOORS, FLOORS))
    first[0, 0] = 1.0
    # The specimen carries its share of the first storey's M, C and K, so the simulated part has it
    # subtracted; the reaction of the specimen then acts with a minus sign.
    inverse_mass = np.linalg.inv(mass - removed.mass * first)
    augmented = np.zeros((8, 8))
    augmented[:3, 3:6] = np.eye(FLOORS)
    augmented[3:6, :3] = -inverse_mass @ (STIFFNESS - removed.stiffness * first)
    augmented[3:6, 3:6] = -inverse_mass @ (damping - removed.damping * first)
    # The ground moves the whole mass, the specimen's included: its inertia is not measured.
    augmented[3:6, 6] = -inverse_mass @ mass @ np.ones(FLOORS)
    augmented[3:6, 7] = -inverse_mass @ first[:, 0]
    # Zero-order hold of both inputs by one exponential of the augmented matrix.
    augmented = expm(augmented * PERIOD)
    a, ground, force = augmented[:6, :6], augmented[:6, 6], augmented[:6, 7]
    return Sampled(*(np.ascontiguousarray(each) for each in (a, ground, force)))


def move(building: Sampled, ground: Array) -> Array:
    """Return the floor displacements, m, shape (n, 3); ground: acceleration, m/s², shape (n,)."""
    return _move(building.a, building.ground, ground)


@kernel
def _move(a: Array, by_ground: Array, ground: Array) -> Array:
    state, displacements = np.zeros(6), np.empty((len(ground), FLOORS))
    for tick in range(len(ground)):
        displacements[tick] = state[:FLOORS]
        state = a @ state + by_ground * ground[tick]
    return displacements
