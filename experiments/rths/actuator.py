"""The benchmark's hydraulic actuator with the specimen fixed to it, nominal and perturbed.

    P(s) = 1.0261 feedback(G_s G_0),   G_s = 2.1283e13/(s² + β_1 s + β_2)
    G_0 = feedback(1/((s + a_3)(m_e s² + c_e s + k_e)), 4.2297e6 s)

The gain 1.0261 multiplies the command, so position sensor and load cell refer to the same motion.
The values are those of the benchmark's problem statement (see `experiments.rths.building`).
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
"""Scale of each of the five states.

Unscaled, the states differ by twelve decades and the matrix exponential loses its accuracy.
"""


class ActuatorPlant(NamedTuple):
    """Parameters of the actuator and its specimen.

    Attributes
    ----------
    beta1, beta2 : float
        Coefficients β_1, 1/s, and β_2, 1/s², of the servo valve.
    a3 : float
        Pole a_3 of the actuator force, 1/s.
    specimen : Specimen
        Column fixed to the actuator.
    """

    beta1: float = 425.0
    beta2: float = 9.9976e4
    a3: float = 3.3
    specimen: Specimen = Specimen()


SPREAD = (3.3, 3.3e3, 1.3, 5e4)
"""Standard deviations of β_1, 1/s, β_2, 1/s², a_3, 1/s, and k_e, N/m."""


def draw_plants(count: int, seed: int = 1) -> list[ActuatorPlant]:
    """Return `count` plants: the nominal one first, then normally distributed ones.

    The same seed gives the same plants, whatever the count.
    """
    # One row of normal numbers a plant: a larger count extends the series and changes no plant.
    random = np.random.default_rng([seed, 7])
    drawn = [ActuatorPlant()]
    for deviation in random.standard_normal((count - 1, 4)) * np.array(SPREAD):
        nominal = ActuatorPlant()
        # The specimen's stiffness varies with the actuator: its true value is not measured either.
        stiffness = nominal.specimen.stiffness + float(deviation[3])
        drawn.append(
            ActuatorPlant(
                nominal.beta1 + float(deviation[0]),
                nominal.beta2 + float(deviation[1]),
                nominal.a3 + float(deviation[2]),
                nominal.specimen._replace(stiffness=stiffness),
            )
        )
    return drawn


def continuous(plant: ActuatorPlant) -> tuple[Array, Array]:
    """Return the state-space matrices A, shape (5, 5), and B, shape (5,), in scaled units.

    The states are position (m), velocity (m/s), force (N), valve and valve rate, times `UNITS`.
    """
    specimen = plant.specimen
    a, b = np.zeros((5, 5)), np.zeros(5)
    a[0, 1] = 1.0
    # m_e ẍ = f − c_e ẋ − k_e x
    a[1, :3] = np.array([-specimen.stiffness, -specimen.damping, 1.0]) / specimen.mass
    # ḟ = −a_3 f − 4.2297e6 ẋ + valve: the velocity feedback inside G_0.
    a[2, 1:4] = [-VELOCITY, -plant.a3, 1.0]
    a[3, 4] = 1.0
    # The position feedback closes the outer loop around G_s G_0.
    a[4, 0], a[4, 3], a[4, 4] = -VALVE, -plant.beta2, -plant.beta1
    b[4] = VALVE * GAIN
    return a * UNITS[:, None] / UNITS[None, :], b * UNITS


def sampled(plant: ActuatorPlant) -> tuple[Array, Array]:
    """Return A, shape (5, 5), and B, shape (5,), sampled at `PERIOD` with the command held."""
    # Zero-order hold by one exponential: exp([[A, B], [0, 0]] T) = [[A_d, B_d], [0, 1]].
    a, b = continuous(plant)
    augmented = np.zeros((6, 6))
    augmented[:5, :5], augmented[:5, 5] = a, b
    augmented = expm(augmented * PERIOD)
    return np.ascontiguousarray(augmented[:5, :5]), np.ascontiguousarray(augmented[:5, 5])


def transfer(plant: ActuatorPlant) -> tuple[Sequence[float], Sequence[float]]:
    """Return numerator and denominator of command → position, highest power of s first."""
    specimen = plant.specimen
    # G_0 before its feedback: (s + a_3)(m_e s² + c_e s + k_e).
    specimen_denominator = np.polymul(
        [1.0, plant.a3], [specimen.mass, specimen.damping, specimen.stiffness]
    )
    # The velocity feedback adds 4.2297e6 s to the denominator.
    feedback_denominator = np.polyadd(specimen_denominator, [VELOCITY, 0.0])
    denominator = np.polyadd(
        np.polymul([1.0, plant.beta1, plant.beta2], feedback_denominator), [VALVE]
    )
    # Both inner denominators multiply out, so no pole and zero need cancelling.
    return [VALVE * GAIN], denominator.tolist()
