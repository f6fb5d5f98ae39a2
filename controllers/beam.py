"""The cross of elastic beams: finite elements, modes, and one tick of its model (thesis §7.2).

Four arms have three Bernoulli beams each. The 13 nodes have three displacements and three rotations
each, 78 degrees of freedom in all. Only modes that are symmetric about the centre move it
vertically, so they alone are in the loop.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

from controllers.compiled import compilable
from controllers.settings import Settings

Array = NDArray[np.float64]
Six = tuple[float, ...]
"""Tuple of `MODES` numbers."""

ARMS, BEAMS = 4, 3
NODES = 1 + ARMS * BEAMS
FREEDOMS = 6 * NODES
HEAVE = 2
"""Index of the vertical displacement among the freedoms of a node: x, y, z and rotations."""
MODES = 6
"""Number of modes in the loop: heave and five symmetric elastic modes.

With the beams of thesis Table 7.4 they reach up to 135 Hz.
"""
AT_REST: Six = (0.0,) * 6


class Modes(NamedTuple):
    """Structure model sampled at the controller's period, one row per mode.

    Attributes
    ----------
    transition : ndarray
        Transition of displacement and rate, shape (MODES, 2, 2).
    entry : ndarray
        Input vector of the modal force, shape (MODES, 2).
    centre : ndarray
        Mode shape at the centre, 1/√kg, shape (MODES,).
    weight : ndarray
        Modal force of gravity, shape (MODES,).
    wing : ndarray
        Mode shape at 0, 1, 2 and 3 beams from the centre, 1/√kg, shape (MODES, 4).
    frequencies : ndarray
        Natural frequencies, Hz, shape (MODES,).
    """

    transition: Array
    entry: Array
    centre: Array
    weight: Array
    wing: Array
    frequencies: Array


def element(settings: Settings) -> tuple[Array, Array]:
    """Return consistent mass and stiffness of a beam along x, each (12, 12): thesis Eq. 7.2, 7.3.

    A vertical load at the centre of a symmetric cross bends its arms in the vertical plane alone,
    so torsion and horizontal bending do not matter (thesis §7.2.1). The section is assumed equal in
    both directions, with a Poisson ratio of 0.3.
    """
    modulus, inertia, length = settings.beam_modulus, settings.beam_inertia, settings.beam_length
    line = settings.beam_density * settings.beam_area
    # Equal second moments: J = 2 I. G = E / (2 (1 + ν)) = E / 2.6.
    polar, shear = 2.0 * inertia, modulus / 2.6
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    # Consistent matrices of a rod with linear shape functions:
    # m·L/6·[2 1; 1 2] and EA/L·[1 −1; −1 1].
    rod = np.array([[2.0, 1.0], [1.0, 2.0]]) * length / 6.0
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    # Axial displacement and torsion share the linear shape functions of a rod.
    for first, inertial, elastic in (
        (0, line, modulus * settings.beam_area),
        (3, line * polar / settings.beam_area, shear * polar),
    ):
        block = np.ix_([first, first + 6], [first, first + 6])
        mass[block], stiffness[block] = inertial * rod, elastic * spring
    # Bending in the x-z plane rotates about −y, so its rotations change sign; in x-y, about z.
    for freedoms, sign in (([2, 4, 8, 10], -1.0), ([1, 5, 7, 11], 1.0)):
        signs = np.array([1.0, sign, 1.0, sign])
        scale = np.outer(signs, signs)
        a = length
        block = np.ix_(freedoms, freedoms)
        # Hermite's cubic shape functions of a Bernoulli beam, in the order deflection, slope,
        # deflection, slope (thesis Eq. 7.2, 7.3).
        mass[block] = (
            scale
            * (line * a / 420.0)
            * np.array(
                [
                    [156.0, 22 * a, 54.0, -13 * a],
                    [22 * a, 4 * a**2, 13 * a, -3 * a**2],
                    [54.0, 13 * a, 156.0, -22 * a],
                    [-13 * a, -3 * a**2, -22 * a, 4 * a**2],
                ]
            )
        )
        stiffness[block] = (
            scale
            * (modulus * inertia / a**3)
            * np.array(
                [
                    [12.0, 6 * a, -12.0, 6 * a],
                    [6 * a, 4 * a**2, -6 * a, 2 * a**2],
                    [-12.0, -6 * a, 12.0, -6 * a],
                    [6 * a, 2 * a**2, -6 * a, 4 * a**2],
                ]
            )
        )
    return mass, stiffness


def assembled(settings: Settings) -> tuple[Array, Array]:
    """Return mass and stiffness of the whole cross, each of shape (78, 78).

    Node 0 is the centre. Arm i has the nodes 1 + 3i to 3 + 3i.
    """
    mass, stiffness = np.zeros((FREEDOMS, FREEDOMS)), np.zeros((FREEDOMS, FREEDOMS))
    beam_matrices = element(settings)
    for arm in range(ARMS):
        angle = arm * math.pi / 2
        rotation = np.array(
            [
                [math.cos(angle), math.sin(angle), 0.0],
                [-math.sin(angle), math.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        # One matrix transforms displacements and rotations of both nodes: four blocks of 3 × 3.
        whole = np.kron(np.eye(4), rotation)
        nodes = [0, *range(1 + BEAMS * arm, 1 + BEAMS * (arm + 1))]
        for inner, outer in pairwise(nodes):
            indices = [6 * node + freedom for node in (inner, outer) for freedom in range(6)]
            for total, single in zip((mass, stiffness), beam_matrices, strict=True):
                # Energies add up: Tᵀ·K·T of every beam, at the freedoms of its two nodes.
                total[np.ix_(indices, indices)] += whole.T @ single @ whole
    return mass, stiffness


def all_modes(settings: Settings) -> tuple[Array, Array]:
    """Return the modes of the free cross: angular frequencies and mass-normalised shapes.

    Frequencies are in rad/s, ascending, shape (78,). Shapes are columns, shape (78, 78).
    """
    mass, stiffness = assembled(settings)
    squares, shapes = eigh(stiffness, mass)
    # The six rigid motions have eigenvalues of rounding size, far below the elastic ones.
    rigid = squares < 1e-9 * squares[-1]
    return np.sqrt(np.where(rigid, 0.0, squares)), shapes


def modes(settings: Settings, period: float) -> Modes:
    """Return the symmetric modes, sampled exactly for a force held over a period, s."""
    beam_settings = {
        name: value for name, value in settings._asdict().items() if name.startswith("beam_")
    }
    # A diagnosis makes hundreds of controllers with equal beams: the cache key keeps only what
    # the modes depend on.
    return _modes(Settings(gravity=settings.gravity, **{**beam_settings, "beam_sag": 0.0}), period)


@lru_cache(maxsize=64)
def _modes(settings: Settings, period: float) -> Modes:
    """Return the sampled modes. The cached part of `modes`."""
    angular, shapes = _symmetric(settings)
    mass, _ = assembled(settings)
    upward = np.zeros(FREEDOMS)
    upward[HEAVE::6] = 1.0
    transition, entry = np.empty((MODES, 2, 2)), np.empty((MODES, 2))
    for number, frequency in enumerate(angular):
        # q̈ = −ω² q − β ω² q̇ + f: stiffness-proportional damping, force held over the period.
        augmented = np.zeros((3, 3))
        augmented[:2] = [
            [0.0, 1.0, 0.0],
            [-(frequency**2), -settings.beam_damping * frequency**2, 1.0],
        ]
        sampled = expm(augmented * period)
        transition[number], entry[number] = sampled[:2, :2], sampled[:2, 2]
    along = [HEAVE, *(6 * node + HEAVE for node in range(1, BEAMS + 1))]
    return Modes(
        transition,
        entry,
        np.ascontiguousarray(shapes[HEAVE]),
        # Gravity acts on every mass: its modal force is −g·1ᵀ·M·φ.
        np.ascontiguousarray(-settings.gravity * upward @ mass @ shapes),
        np.ascontiguousarray(shapes[along].T),
        angular / (2 * math.pi),
    )


def _symmetric(settings: Settings) -> tuple[Array, Array]:
    """Return the lowest symmetric modes: frequencies, rad/s, and shapes, shape (78, MODES)."""
    mass, stiffness = assembled(settings)
    # With equal motion of all arms 7 freedoms remain: heave of the centre, and heave and slope of
    # the three nodes of an arm. `base` maps them to all 78.
    base = np.zeros((FREEDOMS, 1 + 2 * BEAMS))
    base[HEAVE, 0] = 1.0
    for arm in range(ARMS):
        angle = arm * math.pi / 2
        for number in range(BEAMS):
            node = 6 * (1 + BEAMS * arm + number)
            base[node + HEAVE, 1 + 2 * number] = 1.0
            # The slope of an arm is a rotation about the horizontal axis across it.
            base[node + 3, 2 + 2 * number] = -math.sin(angle)
            base[node + 4, 2 + 2 * number] = math.cos(angle)
    squares, shapes = eigh(base.T @ stiffness @ base, base.T @ mass @ base)
    # The heave mode is rigid: its eigenvalue differs from zero by rounding alone.
    squares[0] = 0.0
    return np.sqrt(squares[:MODES]), base @ shapes[:, :MODES]


def at_start(settings: Settings, model: Modes) -> Six:
    """Return the initial modal displacements with the centre at `start`.

    The beams are straight, or bent by the share `beam_sag` of the preload.
    """
    angular = 2 * math.pi * model.frequencies[1:]
    # Static deflection of mode i under a force F at the centre: φ_i F/ω_i².
    bent = settings.beam_sag * settings.preload * model.centre[1:] / angular**2
    heave = (settings.start - model.centre[1:] @ bent) / model.centre[0]
    return (float(heave), *bent.tolist())


@compilable
def _advance_mode(
    model: Modes, number: int, displacement: float, rate: float, force: float
) -> tuple[float, float]:
    """Return displacement and rate of one mode after a tick."""
    modal_force = model.centre[number] * force + model.weight[number]
    step, entry = model.transition[number], model.entry[number]
    return (
        step[0, 0] * displacement + step[0, 1] * rate + entry[0] * modal_force,
        step[1, 0] * displacement + step[1, 1] * rate + entry[1] * modal_force,
    )


@compilable
def beam(model: Modes, displacements: Six, rates: Six, force: float) -> tuple[Six, Six]:
    """Return modal displacements and rates after one tick under a force on the centre, N.

    displacements, rates: values before the tick. The force is held.
    """
    # Written out: compiled code needs the length of a tuple at compile time.
    a = _advance_mode(model, 0, displacements[0], rates[0], force)
    b = _advance_mode(model, 1, displacements[1], rates[1], force)
    c = _advance_mode(model, 2, displacements[2], rates[2], force)
    d = _advance_mode(model, 3, displacements[3], rates[3], force)
    e = _advance_mode(model, 4, displacements[4], rates[4], force)
    f = _advance_mode(model, 5, displacements[5], rates[5], force)
    return (a[0], b[0], c[0], d[0], e[0], f[0]), (a[1], b[1], c[1], d[1], e[1], f[1])


@compilable
def centre(model: Modes, modal: Six) -> float:
    """Return the centre's position, m, from modal displacements, or its velocity from rates."""
    total = 0.0
    for number in range(MODES):
        total += model.centre[number] * modal[number]
    return total
