"""Three-dimensional view of the machine as measured, with the twin's prediction as a ghost."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import viser

from rigtwin.description.machine import Machine
from rigtwin.looking.shapes import Extent, PosedMachine, Shape
from rigtwin.numerics.arrays import Array

GHOST = (235, 110, 20)
"""Colour of the twin's prediction: red, green, blue."""
SEEN_THROUGH = 0.4
"""Opacity of the ghost."""
FLOOR = 6.0
"""Side of the floor, relative to the machine's radius."""


class Scene:
    """A machine on a page, with a ghost if the twin predicts a motion.

    Attributes
    ----------
    floor
        Grid below the machine. None where the MJCF has a plane.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        machine: Machine,
        ghost: bool,
        motion: Mapping[str, Array] | None = None,
    ) -> None:
        """Draw a machine.

        Parameters
        ----------
        server
            Server of the page.
        machine
            Machine that is drawn.
        ghost
            Whether the twin's prediction is drawn too.
        motion
            Joint → positions, in m or rad, that camera and floor are chosen for. Default: the
            machine stands as the MJCF has it.
        """
        self._body = PosedMachine(machine)
        self._server = server
        shapes = self._body.shapes()
        extent = self._body.extent(motion or {})
        place, centre, angle = self._body.camera(extent)
        server.initial_camera.position = place
        server.initial_camera.look_at = centre
        server.initial_camera.fov = angle
        self._machine = _add(server, "/machine", shapes)
        self.floor = None if self._body.has_floor else _add_floor(server, extent)
        # What cannot move would only cover itself.
        moving = [shape for shape in shapes if shape.moves]
        self._ghost = _add(server, "/ghost", moving, GHOST) if ghost else {}

    def draw(
        self, measured: Mapping[str, float], predicted: Mapping[str, float], magnify: float
    ) -> None:
        """Move the machine and its ghost.

        Parameters
        ----------
        measured, predicted
            Joint → position, in m or rad.
        magnify
            Factor by which the ghost's distance from the machine is magnified.
        """
        # All frames move in one message; otherwise a browser could draw half of the motion.
        with self._server.atomic():
            _place(self._machine, *self._body.poses(measured))
            if self._ghost:
                magnified = {
                    joint: position + magnify * (predicted.get(joint, position) - position)
                    for joint, position in measured.items()
                }
                _place(self._ghost, *self._body.poses(magnified))


def _add_floor(server: viser.ViserServer, extent: Extent) -> viser.GridHandle:
    """Add a grid at the lowest point of a machine whose MJCF has no plane."""
    cell = 10.0 ** math.floor(math.log10(extent.radius))
    side = cell * math.ceil(FLOOR * extent.radius / cell)
    middle = extent.centre
    return server.scene.add_grid(
        "/floor",
        width=side,
        height=side,
        cell_size=0.5 * cell,
        section_size=cell,
        plane_opacity=0.4,
        position=(float(middle[0]), float(middle[1]), float(extent.low[2])),
    )


def _add(
    server: viser.ViserServer,
    name: str,
    shapes: list[Shape],
    colour: tuple[int, int, int] | None = None,
) -> dict[int, viser.FrameHandle]:
    """Add all bodies that have shapes, and return their frames by the body's number."""
    frames: dict[int, viser.FrameHandle] = {}
    for number, shape in enumerate(shapes):
        # Shapes hang on their body's frame, so a motion moves few objects.
        if shape.body not in frames:
            frames[shape.body] = server.scene.add_frame(f"{name}/{shape.body}", show_axes=False)
        opacity = shape.opacity if colour is None else SEEN_THROUGH
        server.scene.add_mesh_simple(
            f"{name}/{shape.body}/{number}",
            shape.vertices,
            shape.faces,
            color=shape.colour if colour is None else colour,
            opacity=None if opacity >= 1.0 else opacity,
            flat_shading=shape.edges,
            cast_shadow=colour is None,
            position=shape.position,
            wxyz=shape.turn,
        )
    return frames


def _place(frames: dict[int, viser.FrameHandle], positions: Array, turns: Array) -> None:
    """Move frames. Unchanged ones are skipped, because every assignment is sent to the browser."""
    for body, frame in frames.items():
        if not np.array_equal(frame.position, positions[body]):
            frame.position = positions[body]
        if not np.array_equal(frame.wxyz, turns[body]):
            frame.wxyz = turns[body]
