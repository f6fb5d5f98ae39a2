"""Base parameters: the sums of inertial parameters that are all that the forces of joints can ever
show of bodies and rotors (Gautier and Khalil, IEEE Transactions on Robotics and Automation 6(3),
1990; numerically, as in Gautier, Journal of Robotic Systems 8(4), 1991).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.components import Body, Guide, Rotor
from rigtwin.components.body import INERTIAL
from rigtwin.description.machine import Component, Machine
from rigtwin.models.rigid import RigidBodies
from rigtwin.numerics.arrays import Array

STATES, SEED = 200, 23
"""Motions of all joints that are made up, each a moment, and where their random numbers begin."""
SPREAD = (1.0, 2.0, 10.0)
"""rms of positions, velocities and accelerations, in rad or m and seconds."""
DEPENDENT = 1e-8
"""Share of a column's length that others leave of it, below which it is their sum."""
COUNTS = 1e-6
"""Least coefficient that is no rounding."""


def find_base_parameters(machine: Machine) -> tuple[Mapping[str, float], ...]:
    """What of the inertia of a machine's bodies and rotors can be seen, whatever it does.

    Parameters
    ----------
    machine
        Of joints that act on each other and move as measured, with bodies among its components;
        all other bodies are taken as known.

    Returns
    -------
    tuple of mappings
        The base parameters, independent of each other: parameter → its coefficient in the sum, that
        of the first 1. A parameter is `component.name`, with the names of `INERTIAL`, or `inertia`
        of a rotor; one that is in no sum is never seen. Empty for other machines.
    """
    plant, components = machine.plant, machine.components
    at: dict[type, list[Component]] = {Body: [], Rotor: [], Guide: []}
    for component in components.values():
        at.get(type(getattr(plant, component.name)), []).append(component)
    if not at[Body]:
        return ()
    (replay,) = machine.replays
    joints = [components[name].joint for name in replay.moved_by]
    rows = [joints.index(components[row.name].joint) for row in replay.rows]
    random = np.random.default_rng(SEED)
    motion = random.standard_normal((3, len(joints), STATES)) * np.reshape(SPREAD, (3, 1, 1))
    bodies = RigidBodies(machine.model, joints, at[Guide], at[Rotor])
    columns: dict[str, Array] = {}
    for rotor in at[Rotor]:
        along = np.array([dict(rotor.acts_on).get(joint, 0.0) for joint in joints])
        columns[f"{rotor.name}.inertia"] = np.outer(along, along @ motion[2])[rows].ravel()
    # What is further out is said in terms of what is further in.
    for body in at[Body]:
        found = bodies.regressor(motion, body.mjcf)[:, rows].reshape(len(INERTIAL), -1)
        columns |= {f"{body.name}.{word}": each for word, each in zip(INERTIAL, found, strict=True)}
    return _sum_up(columns)


def _sum_up(columns: Mapping[str, Array]) -> tuple[Mapping[str, float], ...]:
    """Independent sums of columns' parameters: a column that is a sum of those before adds its
    parameter to theirs."""
    chosen: list[str] = []
    sums: dict[str, dict[str, float]] = {}
    for name, column in columns.items():
        size = float(np.linalg.norm(column))
        if size == 0.0:
            continue
        before = np.stack([columns[each] for each in chosen], axis=1) if chosen else None
        if before is not None:
            lengths = np.linalg.norm(before, axis=0)
            shares = np.linalg.lstsq(before / lengths, column, rcond=None)[0] / lengths
            if float(np.linalg.norm(column - before @ shares)) < DEPENDENT * size:
                for each, share in zip(chosen, shares, strict=True):
                    if abs(share) > COUNTS:
                        sums[each][name] = float(share)
                continue
        chosen.append(name)
        sums[name] = {name: 1.0}
    return tuple(sums.values())
