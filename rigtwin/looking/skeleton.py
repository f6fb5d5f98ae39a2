"""Bodies that an MJCF gives no shape, as rods from joint to joint."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

THICK = 0.025
"""Radius of a rod over the machine's size."""
WIDER = 1.4
"""Radius of the ball at a rod's joint over the rod's."""
SHORTEST = 0.05
"""Length, over the machine's size, from which there is a rod."""


def draw_bones(model: mujoco.MjModel, body: int) -> trimesh.Trimesh:
    """A body as a ball at its own joint, with rods to those of the bodies that it carries and to
    its centre of mass.

    Parameters
    ----------
    model
        The mechanics.
    body
        Number of the body.

    Returns
    -------
    trimesh.Trimesh
        In the body's frame, m.
    """
    size = float(model.stat.extent)
    drawn = trimesh.creation.icosphere(subdivisions=2, radius=WIDER * THICK * size)
    carried = [
        model.body_pos[child]
        for child in range(1, model.nbody)
        if model.body_parentid[child] == body
    ]
    for end in (*carried, model.body_ipos[body]):
        if float(np.linalg.norm(end)) > SHORTEST * size:
            drawn += trimesh.creation.cylinder(radius=THICK * size, segment=[np.zeros(3), end])
    return drawn
