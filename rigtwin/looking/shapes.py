"""Shapes of a machine: the geoms of its MJCF as triangles, and the poses of its bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import compile_model
from rigtwin.errors import RigtwinError
from rigtwin.looking.skeleton import draw_bones
from rigtwin.numerics.arrays import Array

SHOWN_GROUPS = 3
"""Geoms of groups below this are shown, as in MuJoCo's viewer."""
PLANE = 4.0
"""Side of an infinite plane, relative to the machine's size."""
THIN = 1e-3
"""Thickness of a plane, relative to the machine's size."""
BONE = (150, 160, 175)
"""Colour of a body without a shape: red, green, blue."""
ASPECT = 16.0 / 9.0
"""Width over height of the pictures for which the cameras of an MJCF are set."""
ASIDE = np.array([0.7, -1.4, 0.7])
"""Direction from which a machine without a camera is seen."""
POSES = 25
"""Number of poses of a motion that camera and floor are chosen for."""
BALL = 2
"""Subdivisions of the icosahedron that approximates a ball."""


@dataclass(frozen=True)
class Shape:
    """Shape of one geom.

    Attributes
    ----------
    body
        Number of the body that the geom is fixed to.
    moves
        Whether that body can move.
    vertices
        Vertices in the geom's frame, in m, shape (vertices, 3).
    faces
        Indices of the triangles' vertices, shape (triangles, 3).
    colour
        Red, green and blue, 0 to 255.
    opacity
        Opacity, 0 to 1.
    edges
        Whether the faces are flat.
    position, turn
        Pose in the body's frame: position in m, and a quaternion.
    is_plane
        Whether the geom is the plane of a floor or wall.
    """

    body: int
    moves: bool
    vertices: Array
    faces: NDArray[np.integer]
    colour: tuple[int, int, int]
    opacity: float
    edges: bool
    position: Array
    turn: Array
    is_plane: bool = False


@dataclass(frozen=True)
class Extent:
    """Box that a machine needs during a motion.

    Attributes
    ----------
    low, high
        Corners, in m, shape (3,).
    """

    low: Array
    high: Array

    @property
    def centre(self) -> Array:
        """Middle of the box, m, shape (3,)."""
        return 0.5 * (self.low + self.high)

    @property
    def radius(self) -> float:
        """Radius of the ball around the box, m."""
        return max(0.5 * float(np.linalg.norm(self.high - self.low)), 1e-6)


class PosedMachine:
    """Mechanics of a machine, posed joint by joint."""

    def __init__(self, machine: Machine) -> None:
        """Raises RigtwinError if its MJCF cannot be compiled."""
        path = machine.physics.scene(machine)
        try:
            self._model = compile_model(path)
        except ValueError as error:
            raise RigtwinError(f"{path}: {error}") from None
        self._data = mujoco.MjData(self._model)

    def shapes(self) -> list[Shape]:
        """Return all visible shapes. Height fields and signed distance fields are left out."""
        model = self._model
        shapes = []
        for number in range(model.ngeom):
            mesh = _triangles(model, number)
            if mesh is None or model.geom_group[number] >= SHOWN_GROUPS:
                continue
            material = int(model.geom_matid[number])
            # As in MuJoCo, a material overrides the geom's own colour.
            rgba = model.geom_rgba[number] if material < 0 else model.mat_rgba[material]
            # Invisible geoms serve contacts only.
            if rgba[3] <= 0.0:
                continue
            kind = model.geom_type[number]
            red, green, blue = (round(255 * float(channel)) for channel in rgba[:3])
            shapes.append(
                Shape(
                    body=int(model.geom_bodyid[number]),
                    moves=int(model.body_weldid[model.geom_bodyid[number]]) != 0,
                    vertices=np.asarray(mesh.vertices),
                    faces=np.asarray(mesh.faces),
                    colour=(red, green, blue),
                    opacity=float(rgba[3]),
                    edges=kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_PLANE),
                    position=model.geom_pos[number].copy(),
                    turn=model.geom_quat[number].copy(),
                    is_plane=kind == mujoco.mjtGeom.mjGEOM_PLANE,
                )
            )
        return [*shapes, *self._bones({shape.body for shape in shapes})]

    def _bones(self, shaped: set[int]) -> list[Shape]:
        """Return rods for all bodies that move and have a mass, but no shape."""
        bones = []
        for body in range(1, self._model.nbody):
            # A body that is welded to the world has the weld number 0.
            moves = int(self._model.body_weldid[body]) != 0
            if body in shaped or not moves or self._model.body_mass[body] <= 0.0:
                continue
            mesh = draw_bones(self._model, body)
            bones.append(
                Shape(
                    body=body,
                    moves=True,
                    vertices=np.asarray(mesh.vertices),
                    faces=np.asarray(mesh.faces),
                    colour=BONE,
                    opacity=1.0,
                    edges=False,
                    position=np.zeros(3),
                    turn=np.array([1.0, 0.0, 0.0, 0.0]),
                )
            )
        return bones

    def poses(self, positions: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the poses of the bodies.

        Parameters
        ----------
        positions
            Joint → position, in m or rad. All other joints stay where the MJCF has them.

        Returns
        -------
        tuple of Array
            Positions in m, shape (bodies, 3), and quaternions, shape (bodies, 4).
        """
        # Joints without a position keep the reference pose of the MJCF.
        self._data.qpos[:] = self._model.qpos0
        for joint, position in positions.items():
            self._data.qpos[self._model.joint(joint).qposadr[0]] = position
        # Kinematics alone: a picture needs no forces.
        mujoco.mj_kinematics(self._model, self._data)
        return self._data.xpos.copy(), self._data.xquat.copy()

    @property
    def has_floor(self) -> bool:
        """Whether the MJCF has a plane."""
        return bool(np.any(self._model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE))

    def extent(self, motion: Mapping[str, Array]) -> Extent:
        """Return the box that the machine needs during a motion.

        Parameters
        ----------
        motion
            Joint → positions, in m or rad, shape (ticks,). All other joints stay where the MJCF has
            them. `POSES` of the ticks are looked at.

        Returns
        -------
        Extent
            Box around all shapes but planes.
        """
        ticks = min((len(values) for values in motion.values()), default=1)
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        corners = [
            (shape.body, _place_corners(shape)) for shape in self.shapes() if not shape.is_plane
        ]
        for tick in np.unique(np.linspace(0, ticks - 1, POSES).astype(int)):
            self.poses({joint: float(values[tick]) for joint, values in motion.items()})
            for body, points in corners:
                turn = self._data.xmat[body].reshape(3, 3)
                placed = points @ turn.T + self._data.xpos[body]
                low = np.minimum(low, placed.min(axis=0))
                high = np.maximum(high, placed.max(axis=0))
        if not np.all(low <= high):
            centre, size = self._model.stat.center, float(self._model.stat.extent)
            low, high = centre - 0.5 * size, centre + 0.5 * size
        return Extent(low, high)

    def camera(self, extent: Extent) -> tuple[Array, Array, float]:
        """Return the camera's position and target, in m, and its vertical field of view, in rad.

        The first camera of the MJCF is used. Without one, the view is from the side and above, and
        as far off as shows the whole extent.
        """
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        statistic = self._model.stat
        centre = np.array(statistic.center)
        if self._model.ncam:
            place = self._data.cam_xpos[0].copy()
            # A MuJoCo camera looks along its negative z axis.
            forward = -self._data.cam_xmat[0].reshape(3, 3)[:, 2]
            # The camera turns about the point nearest to the machine's centre on its line of sight.
            ahead = max(float(forward @ (centre - place)), 0.1 * float(statistic.extent))
            return place, place + ahead * forward, _widen(self._model.cam_fovy[0])
        angle = _widen(self._model.vis.global_.fovy)
        # A square picture shows the least of it where a panel covers either side: the angle of a
        # wide picture's height counts.
        distance = extent.radius / math.sin(0.5 * math.radians(self._model.vis.global_.fovy))
        middle = extent.centre
        return middle + distance * ASIDE / np.linalg.norm(ASIDE), middle, angle


def _place_corners(shape: Shape) -> Array:
    """Return the corners of the box around a shape, in its body's frame, in m, shape (8, 3)."""
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, shape.turn)
    return (low + corners * (high - low)) @ turn.reshape(3, 3).T + shape.position


def _widen(angle: float) -> float:
    """Return the field of view, in rad, of a square picture that shows as much as a wide one.

    `angle` is the vertical field of view of a picture with `ASPECT`, in degrees.
    """
    return 2.0 * math.atan(ASPECT * math.tan(0.5 * math.radians(angle)))


def _triangles(model: mujoco.MjModel, number: int) -> trimesh.Trimesh | None:
    """Return a geom as triangles in its own frame; None for one that is not drawn."""
    size, kind = model.geom_size[number], model.geom_type[number]
    # MuJoCo's sizes are half lengths and radii.
    geom, make = mujoco.mjtGeom, trimesh.creation
    if kind == geom.mjGEOM_BOX:
        return make.box(extents=2.0 * size)
    if kind == geom.mjGEOM_SPHERE:
        return make.icosphere(subdivisions=BALL, radius=float(size[0]))
    if kind == geom.mjGEOM_ELLIPSOID:
        # A unit ball stretched along its three axes.
        return make.icosphere(subdivisions=BALL).apply_scale(size)
    if kind == geom.mjGEOM_CYLINDER:
        return make.cylinder(radius=float(size[0]), height=2.0 * float(size[1]))
    if kind == geom.mjGEOM_CAPSULE:
        return make.capsule(radius=float(size[0]), height=2.0 * float(size[1]), count=(12, 12))
    if kind == geom.mjGEOM_PLANE:
        extent = float(model.stat.extent)
        sides = [2.0 * float(side) if side > 0.0 else PLANE * extent for side in size[:2]]
        return make.box(extents=[*sides, THIN * extent])
    if kind == geom.mjGEOM_MESH:
        # A model's meshes share one array each for vertices and faces.
        mesh = int(model.geom_dataid[number])
        start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        first, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        # Unprocessed: merging vertices would lose the sharp edges of the mesh.
        return trimesh.Trimesh(
            model.mesh_vert[start : start + count],
            model.mesh_face[first : first + faces],
            process=False,
        )
    return None
