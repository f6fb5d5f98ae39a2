"""The benchmark's hydraulic actuator and what is fixed to it, and the plants that it may be.

    P(s) = 1.0261 feedback(G_s G_0),   G_s = 2.1283e13/(s² + β_1 s + β_2)
    G_0 = feedback(1/((s + a_3)(m_e s² + c_e s + k_e)), 4.2297e6 s)

The gain stands before the loop: the load cell feels the position that the sensor shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from experiments.rths.building import PERIOD, Specimen
from rigtwin.numerics.arrays import Array

VALVE, VELOCITY, GAIN = 2.1283e13, 4.2297e6, 1.0261
UNITS = np.array([1.0, 1e-2, 1e-8, 1e-9, 1e-12])
"""Each state is kept times this, or they differ by twelve decades."""


class Plant(NamedTuple):
    """β_1 1/s, β_2 1/s², a_3 1/s, and the specimen."""

    beta1: float = 425.0
    beta2: float = 9.9976e4
    a3: float = 3.3
    specimen: Specimen = Specimen()


SPREAD = (3.3, 3.3e3, 1.3, 5e4)
"""Standard deviations of β_1, β_2, a_3 and k_e."""


def draw_plants(count: int, seed: int = 1) -> list[Plant]:
    """The nominal plant, then as many drawn ones as make up that count."""
    random = np.random.default_rng([seed, 7])
    drawn = [Plant()]
    for one in random.standard_normal((count - 1, 4)) * np.array(SPREAD):
        nominal = Plant()
        stiffness = nominal.specimen.stiffness + float(one[3])
        drawn.append(
            Plant(
                nominal.beta1 + float(one[0]),
                nominal.beta2 + float(one[1]),
                nominal.a3 + float(one[2]),
                nominal.specimen._replace(stiffness=stiffness),
            )
        )
    return drawn


def continuous(plant: Plant) -> tuple[Array, Array]:
    """A (5, 5) and B (5,): position, velocity, force (N), the valve and its rate, each times
    UNITS."""
    piece = plant.specimen
    a, b = np.zeros((5, 5)), np.zeros(5)
    a[0, 1] = 1.0
    a[1, :3] = np.array([-piece.stiffness, -piece.damping, 1.0]) / piece.mass
    a[2, 1:4] = [-VELOCITY, -plant.a3, 1.0]
    a[3, 4] = 1.0
    a[4, 0], a[4, 3], a[4, 4] = -VALVE, -plant.beta2, -plant.beta1
    b[4] = VALVE * GAIN
    return a * UNITS[:, None] / UNITS[None, :], b * UNITS


def sampled(plant: Plant) -> tuple[Array, Array]:
    """A and B at the benchmark's rate, the command held."""
    a, b = continuous(plant)
    both = np.zeros((6, 6))
    both[:5, :5], both[:5, 5] = a, b
    both = expm(both * PERIOD)
    return np.ascontiguousarray(both[:5, :5]), np.ascontiguousarray(both[:5, 5])


def transfer(plant: Plant) -> tuple[Sequence[float], Sequence[float]]:
    """Numerator and denominator from the highest power of s down, from command to position."""
    piece = plant.specimen
    own = np.polymul([1.0, plant.a3], [piece.mass, piece.damping, piece.stiffness])
    inner = np.polyadd(own, [VELOCITY, 0.0])
    below = np.polyadd(np.polymul([1.0, plant.beta1, plant.beta2], inner), [VALVE])
    return [VALVE * GAIN], below.tolist()
