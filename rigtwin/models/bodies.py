"""Rigid bodies as compiled code takes them, and their equation of motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import (
    com_position,
    com_velocity,
    fwd_position,
    fwd_velocity,
    kernel,
    kinematics,
    make_inertia,
    newton_euler,
    passive,
)


class Bodies(NamedTuple):
    """Rigid bodies as compiled code takes them.

    The position of each moving joint is `base + ties · q`, with the coordinates q. MuJoCo stores
    its inertia matrix sparsely: the lower triangle row by row. Each of its entries contributes to
    some elements of the coordinates' inertia matrix, by Tᵀ M T with the ties T.
    """

    model: int  # Address of MuJoCo's model.
    data: int  # Address of MuJoCo's data.
    places: np.ndarray  # Indices of the moving joints in `qpos`, shape (joints,).
    dofs: np.ndarray  # Indices of the moving joints in `qvel`, shape (joints,).
    ties: Array  # Motion of each joint for a unit of each coordinate, shape (joints, coordinates).
    base: Array  # Position of each joint at zero coordinates, shape (joints,).
    qpos: Array  # MuJoCo's positions.
    qvel: Array  # MuJoCo's velocities.
    bias: Array  # MuJoCo's gravity, Coriolis and centrifugal forces.
    passive: Array  # MuJoCo's springs and dampers that no component describes.
    entries: Array  # Entries of MuJoCo's sparse inertia matrix.
    sources: np.ndarray  # Entry behind each contribution, shape (contributions,).
    targets: np.ndarray  # Row and column that it is added to, shape (contributions, 2).
    factors: Array  # Factor on the entry, shape (contributions,).
    bias_address: int  # Address of `bias`.
    tendons: bool  # Whether a tendon acts by a force that no component describes.
    added: Array  # Inertia of the rotors, shape (coordinates, coordinates).
    steady: bool  # Whether inertia and bias are the same in every state.
    inertia: Array  # Constant inertia matrix without `added`, used if `steady`.
    constant: Array  # Constant bias, used if `steady`.


@kernel
def find_terms(bodies: Bodies, place: Array, speed: Array, inertia: Array, bias: Array) -> None:
    """Compute inertia matrix and bias: force = inertia · acceleration + bias.

    Parameters
    ----------
    bodies
        Rigid bodies.
    place, speed
        Positions and velocities of the coordinates, m and m/s, shape (coordinates,).
    inertia
        Inertia matrix, written, kg, shape (coordinates, coordinates).
    bias
        Bias, written, N, shape (coordinates,).
    """
    size = len(place)
    # Constant terms need no call of MuJoCo.
    if bodies.steady:
        for i in range(size):
            bias[i] = bodies.constant[i]
            for j in range(size):
                inertia[i, j] = bodies.inertia[i, j] + bodies.added[i, j]
        return
    for joint in range(len(bodies.dofs)):
        at, rate = bodies.base[joint], 0.0
        for coordinate in range(size):
            at += bodies.ties[joint, coordinate] * place[coordinate]
            rate += bodies.ties[joint, coordinate] * speed[coordinate]
        bodies.qpos[bodies.places[joint]] = at
        bodies.qvel[bodies.dofs[joint]] = rate
    # Position before velocity: MuJoCo's velocity stage uses the kinematics of the position stage.
    if bodies.tendons:
        fwd_position(bodies.model, bodies.data)
        fwd_velocity(bodies.model, bodies.data)
    else:
        # The parts of these two stages that inertia and bias need take less than half the time.
        kinematics(bodies.model, bodies.data)
        com_position(bodies.model, bodies.data)
        make_inertia(bodies.model, bodies.data)
        com_velocity(bodies.model, bodies.data)
        passive(bodies.model, bodies.data)
        newton_euler(bodies.model, bodies.data, 0, bodies.bias_address)
    # Project on the coordinates: M_q = Tᵀ M T and c_q = Tᵀ c, with the ties T.
    for i in range(size):
        bias[i] = 0.0
        for j in range(size):
            inertia[i, j] = bodies.added[i, j]
    for joint in range(len(bodies.dofs)):
        row = bodies.dofs[joint]
        force = bodies.bias[row] - bodies.passive[row]
        for coordinate in range(size):
            bias[coordinate] += bodies.ties[joint, coordinate] * force
    for k in range(len(bodies.sources)):
        value = bodies.factors[k] * bodies.entries[bodies.sources[k]]
        inertia[bodies.targets[k, 0], bodies.targets[k, 1]] += value


def inertia_at(bodies: Bodies, place: Array) -> Array:
    """Return the inertia matrix at a position, kg, shape (coordinates, coordinates)."""
    size = len(place)
    inertia, bias = np.empty((size, size)), np.empty(size)
    find_terms(bodies, place, np.zeros(size), inertia, bias)
    return inertia


def arrange_moments(moments: Sequence[float]) -> Array:
    """Return the inertia matrix of the moments ixx, iyy, izz, ixy, ixz, iyz, shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
