"""Geoms that touch during a recording: no model of joints has contacts, so their forces would be
taken for friction or stiffness."""

from __future__ import annotations

import mujoco
import numpy as np

from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

POSES = 1000
"""Poses of a recording in which contacts are looked for, at most."""
PAIRS = 3
"""Pairs of geoms that are named; the rest is counted."""


def find_contacts(machine: Machine, recording: RecordedTest) -> list[str]:
    """Say which geoms of the MJCF touch in the recorded poses, and for how long.

    Parameters
    ----------
    machine
        Machine the recording belongs to.
    recording
        Recording whose positions are posed in MuJoCo; joints without a position stay where the
        MJCF has them.

    Returns
    -------
    list of str
        A line for each of the pairs that touch longest; empty if none touch.
    """
    if machine.physics.has_contacts:
        return []
    mechanism = Mechanism(machine.model)
    model = mechanism.model
    able = np.count_nonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    positions = machine.physics.joint_positions(machine, recording.columns, recording.period)
    # Pairs that an MJCF lists explicitly collide whatever the geoms' contype and conaffinity.
    if (able < 2 and not model.npair) or not positions:
        return []
    # Division rounded up, so that at most `POSES` poses are taken.
    every = -(-recording.ticks // POSES)
    ticks = np.arange(0, recording.ticks, every)
    touched = _pose(mechanism, positions, ticks)
    longest = sorted(touched.items(), key=lambda item: -len(item[1]))
    lines = [
        f"{_geom(model, pair[0])} and {_geom(model, pair[1])} touch for "
        f"{len(at) * every * recording.period:.3g} s of {recording.ticks * recording.period:.3g} s,"
        f" first at {at[0] * recording.period:.3g} s; the twin has no contacts, so their forces "
        "are taken for something else"
        for pair, at in longest[:PAIRS]
    ]
    if len(longest) > PAIRS:
        lines.append(f"{len(longest) - PAIRS} more pairs of geoms touch for a shorter time")
    return lines


def _pose(
    mechanism: Mechanism, positions: dict[str, Array], ticks: np.ndarray
) -> dict[tuple[int, int], list[int]]:
    """Pair of geoms → ticks at which they touch."""
    model, touched = mechanism.model, {}
    data = mujoco.MjData(model)
    place = {joint: int(model.jnt_qposadr[mechanism.number("joint", joint)]) for joint in positions}
    # A joint tied to a measured one has no channel of its own, but moves its geoms.
    ties = [tie for tie in mechanism.ties_of(positions)[0] if tie.joint not in positions]
    led = [int(model.jnt_qposadr[mechanism.number("joint", tie.joint)]) for tie in ties]
    for tick in ticks.tolist():
        for joint, values in positions.items():
            data.qpos[place[joint]] = values[tick] if np.isfinite(values[tick]) else 0.0
        for tie, at in zip(ties, led, strict=True):
            to = int(model.jnt_qposadr[mechanism.number("joint", tie.to)])
            data.qpos[at] = tie.offset + tie.ratio * data.qpos[to]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        contacts = data.contact
        for pair in {
            (int(one), int(other))
            for (one, other), distance in zip(contacts.geom, contacts.dist, strict=True)
            # MuJoCo lists a contact as soon as the distance is within the geoms' margin. Flexible
            # bodies have the geom number -1.
            if distance < 0.0 and one >= 0 and other >= 0
        }:
            touched.setdefault(pair, []).append(tick)
    return touched


def _geom(model: mujoco.MjModel, number: int) -> str:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, number)
    if name:
        return f"geom {name!r}"
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.geom_bodyid[number]))
    return f"a geom of body {body!r}" if body else f"geom {number}"
