"""The benchmark's building: three storeys, of which one column is the specimen.

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
"""Hz, of the real-time computer."""
PERIOD = 1.0 / RATE
STIFFNESS = np.array(
    [
        [26054883.87960384, -23133938.8771082, 5937035.46333915],
        [-23133938.8771082, 32560774.18638033, -14419970.77723698],
        [5937035.46333915, -14419970.77723699, 9267275.50622431],
    ]
)
"""N/m, of the whole building."""
FLOORS = 3


class Case(NamedTuple):
    """Mass of a floor, kg, and damping ratio of every mode, 1."""

    mass: float
    damping: float


CASES = {
    1: Case(1000.0, 0.05),
    2: Case(1100.0, 0.04),
    3: Case(1300.0, 0.03),
    4: Case(1000.0, 0.03),
}


class Specimen(NamedTuple):
    """The column that is real: mass kg, stiffness N/m, damping ratio 1."""

    mass: float = 29.13
    stiffness: float = 1.19e6
    damping_ratio: float = 0.0097

    @property
    def damping(self) -> float:
        """Ns/m."""
        return 2.0 * self.damping_ratio * math.sqrt(self.mass * self.stiffness)


class Sampled(NamedTuple):
    """Displacements and velocities of the floors, m and m/s, from one tick to the next.

    a: shape (6, 6); ground: (6,), of the ground's acceleration, m/s²; force: (6,), of the force on
    the first floor, N; both held.
    """

    a: Array
    ground: Array
    force: Array


def find_case(number: int) -> Case:
    """The benchmark's case of that number. Raises RigtwinError with what there is."""
    if number not in CASES:
        raise RigtwinError(f"case {number}: expected {', '.join(map(str, CASES))}")
    return CASES[number]


def frequencies(case: Case) -> Array:
    """Hz, ascending, of the whole building."""
    squares, _ = eigh(STIFFNESS, case.mass * np.eye(FLOORS))
    return np.sqrt(squares) / (2.0 * math.pi)


def whole_building(case: Case) -> Sampled:
    """The reference: nothing of it is real."""
    return _sampled(case, Specimen(0.0, 0.0, 0.0))


def numerical_part(case: Case, nominal: Specimen) -> Sampled:
    """The building without the specimen, whose force acts on the first floor with a minus sign."""
    return _sampled(case, nominal)


def _sampled(case: Case, without: Specimen) -> Sampled:
    mass = case.mass * np.eye(FLOORS)
    squares, shapes = eigh(STIFFNESS, mass)
    modal = np.diag(2.0 * case.damping * np.sqrt(squares))
    damping = mass @ shapes @ modal @ shapes.T @ mass
    first = np.zeros((FLOORS, FLOORS))
    first[0, 0] = 1.0
    own = np.linalg.inv(mass - without.mass * first)
    both = np.zeros((8, 8))
    both[:3, 3:6] = np.eye(FLOORS)
    both[3:6, :3] = -own @ (STIFFNESS - without.stiffness * first)
    both[3:6, 3:6] = -own @ (damping - without.damping * first)
    both[3:6, 6] = -own @ mass @ np.ones(FLOORS)
    both[3:6, 7] = -own @ first[:, 0]
    both = expm(both * PERIOD)
    a, ground, force = both[:6, :6], both[:6, 6], both[:6, 7]
    return Sampled(*(np.ascontiguousarray(each) for each in (a, ground, force)))


def move(building: Sampled, ground: Array) -> Array:
    """Displacements of the floors, m, shape (n, 3), under a ground's acceleration, m/s², (n,)."""
    return _move(building.a, building.ground, ground)


@kernel
def _move(a: Array, by_ground: Array, ground: Array) -> Array:
    state, moved = np.zeros(6), np.empty((len(ground), FLOORS))
    for tick in range(len(ground)):
        moved[tick] = state[:FLOORS]
        state = a @ state + by_ground * ground[tick]
    return moved
