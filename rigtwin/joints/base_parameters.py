"""Base parameters: the sums of inertial parameters that joint forces can identify.

Forces are linear in the inertial parameters, τ = Y·π. Linearly dependent columns of the regressor Y
can only be identified as sums (Gautier and Khalil, IEEE Transactions on Robotics and Automation
6(3), 1990; numerically as in Gautier, Journal of Robotic Systems 8(4), 1991).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.components import Body, Guide, Rotor
from rigtwin.components.body import INERTIAL
from rigtwin.description.machine import Machine
from rigtwin.models.rigid import RigidBodies
from rigtwin.numerics.arrays import Array

STATES, SEED = 200, 23
"""Number of random states at which the regressor is evaluated, and seed of these states."""
SPREAD = (1.0, 2.0, 10.0)
"""RMS of positions, velocities and accelerations, in rad or m and their derivatives by s."""
DEPENDENT = 1e-8
"""Relative residual of a column below which it is a linear combination of earlier columns."""
COUNTS = 1e-6
"""Smallest coefficient that is not a rounding error."""


def find_base_parameters(machine: Machine) -> tuple[Mapping[str, float], ...]:
    """Find the base parameters of a machine's bodies and rotors.

    Parameters
    ----------
    machine
        Machine of coupled joints with prescribed motion, with bodies among its components. Bodies
        that are not components are taken as known.

    Returns
    -------
    tuple of mappings
        Independent sums: parameter → coefficient, with 1 for the first. A parameter is
        `component.name`, with the names of `INERTIAL`, or `inertia` of a rotor. A parameter in no
        sum cannot be identified. Empty for other machines.
    """
    heavy, rotors = machine.components_of(Body), machine.components_of(Rotor)
    if not heavy:
        return ()
    components = machine.components
    (replay,) = machine.replays
    joints = [components[name].joint for name in replay.moved_by]
    rows = [joints.index(components[row.name].joint) for row in replay.rows]
    # A random state excites all joints at once, so the regressor has the rank that any motion of
    # the machine could reach.
    random = np.random.default_rng(SEED)
    motion = random.standard_normal((3, len(joints), STATES)) * np.reshape(SPREAD, (3, 1, 1))
    bodies = RigidBodies(machine.model, joints, machine.components_of(Guide), rotors)
    columns: dict[str, Array] = {}
    # A rotor adds its inertia times the acceleration of its shaft, which the ratios in `acts_on`
    # map to and from the joints.
    for rotor in rotors:
        along = np.array([dict(rotor.acts_on).get(joint, 0.0) for joint in joints])
        columns[f"{rotor.name}.inertia"] = np.outer(along, along @ motion[2])[rows].ravel()
    # Rotors first, then bodies from the base outwards: a dependent parameter of an outer body is
    # added to those of inner bodies.
    for body in heavy:
        regressor = bodies.regressor(motion, body.mjcf)[:, rows].reshape(len(INERTIAL), -1)
        columns |= {
            f"{body.name}.{word}": each for word, each in zip(INERTIAL, regressor, strict=True)
        }
    return _sum_up(columns)


def _sum_up(columns: Mapping[str, Array]) -> tuple[Mapping[str, float], ...]:
    """Return independent sums of the columns' parameters.

    A column that is a linear combination of earlier ones adds its parameter to their sums.
    """
    chosen: list[str] = []
    sums: dict[str, dict[str, float]] = {}
    for name, column in columns.items():
        size = float(np.linalg.norm(column))
        # A zero column belongs to a parameter that no force depends on.
        if size == 0.0:
            continue
        before = np.stack([columns[earlier] for earlier in chosen], axis=1) if chosen else None
        if before is not None:
            # Columns of kg, kg m and kg m² differ in size: normalise before the least squares.
            lengths = np.linalg.norm(before, axis=0)
            # Columns differ in unit and size; without this scaling lstsq would judge rank by unit.
            shares = np.linalg.lstsq(before / lengths, column, rcond=None)[0] / lengths
            if float(np.linalg.norm(column - before @ shares)) < DEPENDENT * size:
                for earlier, share in zip(chosen, shares, strict=True):
                    if abs(share) > COUNTS:
                        sums[earlier][name] = float(share)
                continue
        # An independent column starts a new sum, in which its own coefficient is 1.
        chosen.append(name)
        sums[name] = {name: 1.0}
    return tuple(sums.values())
