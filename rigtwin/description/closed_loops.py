"""Closed loops of joints, such as four-bar linkages, whose coordinates depend on each other."""

from __future__ import annotations

from pathlib import Path

import mujoco

from rigtwin.errors import RigtwinError

LOOPS = {int(mujoco.mjtEq.mjEQ_CONNECT): "connect", int(mujoco.mjtEq.mjEQ_WELD): "weld"}
"""Equalities that tie two bodies, and so may close a loop of joints."""


def refuse_closed_loops(path: Path, model: mujoco.MjModel) -> None:
    """Refuse a model of which an equality ties two bodies that move against each other.

    Parameters
    ----------
    path
        File of the model, for the message.
    model
        Compiled model.

    Raises
    ------
    RigtwinError
        If an active connect or weld equality closes a loop of joints.
    """
    for number in range(model.neq):
        kind, within = int(model.eq_type[number]), int(model.eq_objtype[number])
        if kind not in LOOPS or not model.eq_active0[number]:
            continue
        ends = [int(model.eq_obj1id[number]), int(model.eq_obj2id[number])]
        if within == mujoco.mjtObj.mjOBJ_SITE:
            ends = [int(model.site_bodyid[site]) for site in ends]
        # Bodies that are welded together move alike, so that nothing is constrained between them.
        if model.body_weldid[ends[0]] != model.body_weldid[ends[1]]:
            names = [
                mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, end) or f"number {end}"
                for end in ends
            ]
            raise RigtwinError(
                f"model {path}: the {LOOPS[kind]} equality of bodies {names[0]} and {names[1]} "
                "closes a loop of joints; expected a tree, such as the same machine without it"
            )
