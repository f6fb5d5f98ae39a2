"""Responses of linear laws in closed form."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from controllers.linear_law import LinearLaw


def response(law: LinearLaw, frequency: float, period: float) -> tuple[complex, complex]:
    """Return the response of the command to desired and to measured position at a frequency, Hz."""
    z = np.exp(2j * np.pi * frequency * period)
    inner = np.linalg.solve(z * np.eye(len(law.a)) - law.a, law.b)
    desired, measured = law.c @ inner + law.d
    return complex(desired), complex(measured)


def noise_gain(law: LinearLaw) -> tuple[float, float]:
    """Return the rms of the command per rms of white noise on desired and on measured position.

    Raises ValueError for a law that is not stable by itself, such as one that integrates.
    """
    if np.max(np.abs(np.linalg.eigvals(law.a))) >= 1.0:
        raise ValueError("the law integrates: its noise gain is that of the loop around it")
    gains = []
    for column in range(2):
        entry = law.b[:, [column]]
        # Stationary covariance: P = A P Aᵀ + B Bᵀ; variance of u = C P Cᵀ + D².
        covariance = solve_discrete_lyapunov(law.a, entry @ entry.T)
        gains.append(float(np.sqrt(law.c @ covariance @ law.c + law.d[column] ** 2)))
    return gains[0], gains[1]
