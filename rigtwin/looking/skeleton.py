"""Rods from joint to joint, for bodies without a shape in the MJCF."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

THICK = 0.025
"""Radius of a rod, relative to the machine's size."""
WIDER = 1.4
"""Radius of the ball at a joint, relative to the rod's."""
SHORTEST = 0.05
"""Length of the shortest rod, relative to the machine's size."""


def draw_bones(model: mujoco.MjModel, body: int) -> trimesh.Trimesh:
    """Return a body as a ball at its joint, with rods to its children and its centre of mass.

    Parameters
    ----------
    model
        Mechanics of the machine.
    body
        Number of the body.

    Returns
    -------
    trimesh.Trimesh
        Triangles in the body's frame, in m.
    """
    size = float(model.stat.extent)
    drawn = trimesh.creation.icosphere(subdivisions=2, radius=WIDER * THICK * size)
    carried = [
        model.body_pos[child]
        for child in range(1, model.nbody)
        if model.body_parentid[child] == body
    ]
    # A rod too short would vanish inside the ball.
    for end in (*carried, model.body_ipos[body]):
        if float(np.linalg.norm(end)) > SHORTEST * size:
            drawn += trimesh.creation.cylinder(radius=THICK * size, segment=[np.zeros(3), end])
    return drawn
