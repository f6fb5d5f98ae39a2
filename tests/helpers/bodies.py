"""Pseudo-inertia matrix of a body, by which tests judge whether the body can exist."""

from __future__ import annotations

import numpy as np

from rigtwin.numerics.arrays import Array


def arrange_pseudo_inertia(parameters: Array) -> Array:
    """Return the pseudo-inertia matrix of ten inertial parameters.

    With Σ = ½·tr(I)·1 − I and the first moment h, it is [[Σ, h], [hᵀ, m]]. It is positive definite
    exactly for physically consistent bodies (Wensing, Kim and Slotine 2018).

    Parameters
    ----------
    parameters
        Parameters in the order of `INERTIAL`, shape (10,).

    Returns
    -------
    array
        Pseudo-inertia matrix, shape (4, 4).
    """
    mass, mx, my, mz, ixx, iyy, izz, ixy, ixz, iyz = parameters
    about = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    pseudo_inertia = np.empty((4, 4))
    pseudo_inertia[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    pseudo_inertia[:3, 3] = pseudo_inertia[3, :3] = (mx, my, mz)
    pseudo_inertia[3, 3] = mass
    return pseudo_inertia
