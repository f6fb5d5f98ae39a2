"""The cross of elastic beams: finite elements, their modes, and one tick of the few modes that its
centre feels (thesis §7.2).

Four arms of three Bernoulli beams; 13 nodes of three displacements and three rotations each, 78 in
all. Of the modes only those that are symmetric about the centre move it vertically; they alone are
in the loop.
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
"""Of MODES numbers."""

ARMS, BEAMS = 4, 3
NODES = 1 + ARMS * BEAMS
FREEDOMS = 6 * NODES
HEAVE = 2
"""Number of the vertical displacement among a node's freedoms x, y, z, about x, about y, about
z."""
MODES = 6
"""Symmetric modes in the loop: heave and five elastic ones, up to 135 Hz with the beams of thesis
Table 7.4."""
AT_REST: Six = (0.0,) * 6


class Modes(NamedTuple):
    """The structure model sampled at the controller's period; one row a mode.

    transition: of (displacement, rate), shape (MODES, 2, 2); entry: of the modal force, shape
    (MODES, 2); centre: of the mode shape at the centre, 1/√kg; weight: modal force of gravity;
    wing: of the mode shape at 0, 1, 2, 3 beams from the centre, shape (MODES, 4); frequencies in
    Hz.
    """

    transition: Array
    entry: Array
    centre: Array
    weight: Array
    wing: Array
    frequencies: Array


def element(settings: Settings) -> tuple[Array, Array]:
    """Consistent mass and stiffness of one beam along x, shape (12, 12) each; thesis Eq. 7.2, 7.3.

    A vertical load at the centre of a symmetric cross bends its arms in the vertical plane alone,
    so torsion and horizontal bending do not matter (thesis §7.2.1): the section is taken as equal
    both ways, with a Poisson ratio of 0.3.
    """
    modulus, inertia, length = settings.beam_modulus, settings.beam_inertia, settings.beam_length
    line = settings.beam_density * settings.beam_area
    polar, shear = 2.0 * inertia, modulus / 2.6
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    rod = np.array([[2.0, 1.0], [1.0, 2.0]]) * length / 6.0
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    for first, inertial, elastic in (
        (0, line, modulus * settings.beam_area),
        (3, line * polar / settings.beam_area, shear * polar),
    ):
        at = np.ix_([first, first + 6], [first, first + 6])
        mass[at], stiffness[at] = inertial * rod, elastic * spring
    # Bending in the plane x-z turns about −y, in x-y about z.
    for freedoms, sign in (([2, 4, 8, 10], -1.0), ([1, 5, 7, 11], 1.0)):
        turn = np.array([1.0, sign, 1.0, sign])
        scale = np.outer(turn, turn)
        a = length
        at = np.ix_(freedoms, freedoms)
        mass[at] = (
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
        stiffness[at] = (
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
    """Mass and stiffness of the whole cross, shape (78, 78) each. Node 0 is the centre; arm i has
    nodes 1 + 3i to 3 + 3i."""
    mass, stiffness = np.zeros((FREEDOMS, FREEDOMS)), np.zeros((FREEDOMS, FREEDOMS))
    of_one = element(settings)
    for arm in range(ARMS):
        angle = arm * math.pi / 2
        turn = np.array(
            [
                [math.cos(angle), math.sin(angle), 0.0],
                [-math.sin(angle), math.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        whole = np.kron(np.eye(4), turn)
        nodes = [0, *range(1 + BEAMS * arm, 1 + BEAMS * (arm + 1))]
        for inner, outer in pairwise(nodes):
            place = [6 * node + freedom for node in (inner, outer) for freedom in range(6)]
            for into, single in zip((mass, stiffness), of_one, strict=True):
                into[np.ix_(place, place)] += whole.T @ single @ whole
    return mass, stiffness


def all_modes(settings: Settings) -> tuple[Array, Array]:
    """Angular frequencies (rad/s, ascending, shape (78,)) and mass-normalised shapes (columns) of
    the free cross."""
    mass, stiffness = assembled(settings)
    squares, shapes = eigh(stiffness, mass)
    # The six rigid motions come out as rounding; the elastic ones are far above.
    rigid = squares < 1e-9 * squares[-1]
    return np.sqrt(np.where(rigid, 0.0, squares)), shapes


def modes(settings: Settings, period: float) -> Modes:
    """The symmetric modes, sampled exactly for a force held over each period (s)."""
    described = {
        name: getattr(settings, name) for name in Settings._fields if name.startswith("beam_")
    }
    # A diagnosis asks for controllers by the hundred, whose beams are all the same.
    return _modes(Settings(gravity=settings.gravity, **{**described, "beam_sag": 0.0}), period)


@lru_cache(maxsize=64)
def _modes(settings: Settings, period: float) -> Modes:
    angular, shapes = _symmetric(settings)
    mass, _ = assembled(settings)
    upward = np.zeros(FREEDOMS)
    upward[HEAVE::6] = 1.0
    transition, entry = np.empty((MODES, 2, 2)), np.empty((MODES, 2))
    for number, frequency in enumerate(angular):
        both = np.zeros((3, 3))
        both[:2] = [[0.0, 1.0, 0.0], [-(frequency**2), -settings.beam_damping * frequency**2, 1.0]]
        sampled = expm(both * period)
        transition[number], entry[number] = sampled[:2, :2], sampled[:2, 2]
    along = [HEAVE, *(6 * node + HEAVE for node in range(1, BEAMS + 1))]
    return Modes(
        transition,
        entry,
        np.ascontiguousarray(shapes[HEAVE]),
        np.ascontiguousarray(-settings.gravity * upward @ mass @ shapes),
        np.ascontiguousarray(shapes[along].T),
        angular / (2 * math.pi),
    )


def _symmetric(settings: Settings) -> tuple[Array, Array]:
    """The lowest MODES modes that the cross has under a vertical force at its centre: frequencies
    and shapes."""
    mass, stiffness = assembled(settings)
    # What is left when every arm does the same: heave of the centre, heave and slope of the three
    # nodes of an arm.
    base = np.zeros((FREEDOMS, 1 + 2 * BEAMS))
    base[HEAVE, 0] = 1.0
    for arm in range(ARMS):
        angle = arm * math.pi / 2
        for number in range(BEAMS):
            node = 6 * (1 + BEAMS * arm + number)
            base[node + HEAVE, 1 + 2 * number] = 1.0
            base[node + 3, 2 + 2 * number] = -math.sin(angle)
            base[node + 4, 2 + 2 * number] = math.cos(angle)
    squares, shapes = eigh(base.T @ stiffness @ base, base.T @ mass @ base)
    squares[0] = 0.0
    return np.sqrt(squares[:MODES]), base @ shapes[:, :MODES]


def at_start(settings: Settings, model: Modes) -> Six:
    """Modal displacements with the centre at `start`: straight, or bent by a share of the
    preload."""
    angular = 2 * math.pi * model.frequencies[1:]
    bent = settings.beam_sag * settings.preload * model.centre[1:] / angular**2
    heave = (settings.start - model.centre[1:] @ bent) / model.centre[0]
    return (
        float(heave),
        float(bent[0]),
        float(bent[1]),
        float(bent[2]),
        float(bent[3]),
        float(bent[4]),
    )


@compilable
def _advanced(
    model: Modes, number: int, displacement: float, rate: float, force: float
) -> tuple[float, float]:
    pushed = model.centre[number] * force + model.weight[number]
    step, entry = model.transition[number], model.entry[number]
    return (
        step[0, 0] * displacement + step[0, 1] * rate + entry[0] * pushed,
        step[1, 0] * displacement + step[1, 1] * rate + entry[1] * pushed,
    )


@compilable
def beam(model: Modes, at: Six, rates: Six, force: float) -> tuple[Six, Six]:
    """One tick of the modes under a force (N) on the centre, held. at, rates: modal displacements
    and their rates."""
    # Written out, since compiled code knows tuples by their length.
    a = _advanced(model, 0, at[0], rates[0], force)
    b = _advanced(model, 1, at[1], rates[1], force)
    c = _advanced(model, 2, at[2], rates[2], force)
    d = _advanced(model, 3, at[3], rates[3], force)
    e = _advanced(model, 4, at[4], rates[4], force)
    f = _advanced(model, 5, at[5], rates[5], force)
    return (a[0], b[0], c[0], d[0], e[0], f[0]), (a[1], b[1], c[1], d[1], e[1], f[1])


@compilable
def centre(model: Modes, modal: Six) -> float:
    """Of the centre: its position (m) of modal displacements, or its velocity (m/s) of their
    rates."""
    total = 0.0
    for number in range(MODES):
        total += model.centre[number] * modal[number]
    return total
