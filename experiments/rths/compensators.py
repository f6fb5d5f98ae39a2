"""Delay compensators of the benchmark by name, all designed from the nominal plant alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from controllers.adaptive_law import adaptive_model, adaptive_time_series
from controllers.forward_prediction import forward_prediction
from controllers.inverse_model import inverse_coefficients, inverse_model
from controllers.kalman_inverse import ActuatorDynamics, Weights, kalman_inverse
from controllers.lag_compensation import lag_compensation
from controllers.linear_law import LinearLaw, pass_through
from controllers.smith_predictor import smith_predictor
from experiments.rths.actuator import ActuatorPlant, continuous, transfer
from experiments.rths.building import PERIOD
from experiments.rths.hybrid_test import Law
from rigtwin.errors import RigtwinError

SAMPLE_KP, SAMPLE_KI = 2.0, 95.0
SAMPLE_LEAD = (50.8, 168.6, 8570.0)
"""Lead compensator 50.8 (s + 168.6)/(s + 8570): gain, zero and pole in 1/s."""


def sample_controller() -> LinearLaw:
    """Return the controller of the benchmark's authors.

    The desired displacement passes a lead; a PI controller acts on the lead's output minus the
    measurement. Both are discretised by Tustin's rule.
    """
    gain, zero, pole = SAMPLE_LEAD
    # Tustin: s → 2/T (z − 1)/(z + 1).
    rate = 2.0 / PERIOD
    ahead, behind = gain * (rate + zero) / (rate + pole), gain * (zero - rate) / (rate + pole)
    back = (rate - pole) / (rate + pole)
    # States: the lead, the integral. The PI acts on e = ahead r + lead − y.
    lead, entry = np.array([1.0, 0.0]), np.array([ahead, -1.0])
    # Tustin's integral adds half the old and half the new error, so K_i T/2 joins K_p.
    half = 0.5 * SAMPLE_KI * PERIOD
    a = np.array([[back, 0.0], [2.0 * half, 1.0]])
    b = np.array([[behind + back * ahead, 0.0], 2.0 * half * entry])
    return LinearLaw(a, b, (SAMPLE_KP + half) * lead + [0.0, 1.0], (SAMPLE_KP + half) * entry)


def _nominal_delay() -> float:
    """Return the delay of the nominal plant at low frequency, s: the slope of its phase."""
    # A polynomial 1 + τ s + … inverts the plant at low frequency: its second coefficient is the
    # delay.
    below, above = transfer(ActuatorPlant())
    return inverse_coefficients(below, above, 0.0, 1)[1]


def nominal_inverse(order: int) -> list[float]:
    """Return the coefficients of the nominal plant's inverse, a polynomial of s of an order."""
    return inverse_coefficients(*transfer(ActuatorPlant()), 0.0, order)


def nominal_actuator() -> ActuatorDynamics:
    """Return the nominal plant as a state-space model of position."""
    a, b = (np.asarray(part, dtype=np.float64) for part in continuous(ActuatorPlant()))
    return ActuatorDynamics(a, b, np.eye(5)[0], 0.0)


KALMAN = Weights(
    effort=1e-5,
    derivatives=5,
    decay=10.0,
    desired_noise=1e-12,
    sensor_noise=1.5e-6,
    offset_walk=1e-6,
    state_noise=1e-5,
)
"""Weights of the Kalman inverse, chosen on the first eight plants (case 4, 25 s of El Centro).

`sensor_noise` trades accuracy against noise. With 1e-5, J2 of the worst plant is 0.38 %, and 0.02
points above the noise floor with noise. With 1e-6 the figures are 0.13 % and 0.26 points.
"""

SMITH = (1.0, 1.0 / 48.0, 0.005, 2.0, 95.0)
"""Gain, lag (s) and delay (s) of the plant model; proportional and integral feedback gains."""

# Factories, not laws: the design runs when a compensator is asked for.
COMPENSATORS: Mapping[str, Callable[[], Law]] = {
    "none": pass_through,
    "sample": sample_controller,
    "forward-prediction": lambda: forward_prediction(_nominal_delay(), PERIOD, interval=24),
    "lag": lambda: lag_compensation(_nominal_delay(), PERIOD),
    "inverse": lambda: inverse_model(nominal_inverse(4), PERIOD, proportional=1.0, integral=40.0),
    "smith": lambda: smith_predictor(*SMITH, PERIOD),
    "adaptive-time-series": lambda: adaptive_time_series(nominal_inverse(2), PERIOD),
    "adaptive-model": lambda: adaptive_model(nominal_inverse(3), PERIOD),
    "kalman-inverse": lambda: kalman_inverse(nominal_actuator(), PERIOD, KALMAN),
}


def find_compensator(name: str) -> Law:
    """Return a new compensator. Raises RigtwinError, listing the names, for an unknown one."""
    if name not in COMPENSATORS:
        raise RigtwinError(f"compensator {name}: expected {', '.join(COMPENSATORS)}")
    return COMPENSATORS[name]()
