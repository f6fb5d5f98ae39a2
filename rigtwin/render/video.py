"""Films a recording offscreen.

The rig in motion, and its force and travel drawn beneath with a line that marks the time.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.render.curves import Curve
from rigtwin.render.plot import find_stretch
from rigtwin.system import RENDERER

Image = NDArray[np.uint8]

FRAMES_PER_SECOND = 30
WIDTH, SCENE_HEIGHT, TRACE_HEIGHT = 960, 432, 288
BEAM_DRAWN = 0.13
"""m; drawn length of a beam."""
BEAM_COLOUR = np.array([0.82, 0.38, 0.24, 1.0], np.float32)
GHOST_COLOUR = np.array([0.92, 0.43, 0.08, 0.4], np.float32)
"""Of what the twin predicts, as the page of a look has it."""
NO_RENDERING = (
    "cannot render without a display; on Debian or Ubuntu: "
    "sudo apt-get install libegl1 libgl1 libgl1-mesa-dri, "
    "elsewhere install EGL or OSMesa and set MUJOCO_GL=egl or osmesa"
)


def film(
    recording: Recording,
    out: Path,
    machine: Machine,
    camera: str | None = None,
    start: float = 0.0,
    until: float | None = None,
    magnify: float = 1.0,
    progress: Callable[[int, int], object] | None = None,
    *,
    ghost: Mapping[str, Array] | None = None,
) -> None:
    """Films a stretch of a recording in real time.

    Parameters
    ----------
    recording : Recording
        Of any machine.
    out : Path
        An mp4 file.
    machine : Machine
        What is seen.
    camera : str, optional
        One of the model's, or free; its first by default.
    start, until : float
        s; to the end where `until` is None.
    magnify : float
        How many times as large motions are drawn, at most 20.
    progress : callable, optional
        Called with frames done and frames in all.
    ghost : mapping, optional
        Joint → position of a twin, m or rad, at every tick of the recording; drawn through the
        machine.

    Raises
    ------
    RigtwinError
        If the file's ending, the camera, the stretch or this computer's rendering is at fault.
    """
    if out.suffix.lower() != ".mp4":
        raise RigtwinError(f"cannot film {out.name!r}: the name must end in .mp4")
    if not 0.0 < magnify <= 20.0:
        raise RigtwinError(f"--magnify {magnify:g}: expected more than 0, at most 20")
    motions = _motions(recording, machine)
    for joint, values in motions.items():
        if not np.isfinite(values).all():
            raise RigtwinError(
                f"{recording.path}: the position of {joint} has values that are no numbers; "
                "nothing can be drawn of it"
            )
    ticks = find_stretch(recording, start, until)
    time = recording.time[ticks]
    motions = {name: magnify * values[ticks] for name, values in motions.items()}
    apart = {name: magnify * values[ticks] for name, values in (ghost or {}).items()}
    traces = _Traces(machine.physics.curves(machine, recording), recording.time, ticks)
    beams = machine.physics.deflection(recording)
    bent = None if beams is None else magnify * beams[ticks]
    shown = np.searchsorted(time, np.arange(time[0], time[-1], 1.0 / FRAMES_PER_SECOND))
    # Rounding may place the last of them behind the end.
    frames = np.minimum(shown, len(time) - 1)
    temporary = out.with_name(f".{os.getpid()}.{out.name[-100:]}.part")
    try:
        with (
            _renderer(machine, camera) as render,
            av.open(str(temporary), "w", format="mp4") as container,
        ):
            stream = container.add_stream(
                "libx264", rate=FRAMES_PER_SECOND, options={"crf": "20", "preset": "veryfast"}
            )
            stream.width, stream.height, stream.pix_fmt = (
                WIDTH,
                SCENE_HEIGHT + TRACE_HEIGHT,
                "yuv420p",
            )
            for number, tick in enumerate(frames):
                at = {name: float(values[tick]) for name, values in motions.items()}
                there = {name: float(values[tick]) for name, values in apart.items()}
                scene = render(at, None if bent is None else bent[tick], there)
                picture = np.vstack([scene, traces.at(float(time[tick]))])
                container.mux(
                    stream.encode(
                        av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
                    )
                )
                if progress is not None:
                    progress(number + 1, len(frames))
            container.mux(stream.encode())
        temporary.replace(out)
    except OSError as error:
        raise RigtwinError(f"cannot write {out}: {error.strerror}") from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _motions(recording: Recording, machine: Machine) -> dict[str, Array]:
    """Joint → position at every tick, m or rad, from what was recorded alone."""
    machine.physics.require_motion(recording)
    found = machine.physics.joint_positions(machine, recording.columns, recording.period)
    if not found:
        raise RigtwinError(
            f"{recording.path}: it says nothing of a joint's position; nothing can be drawn of it"
        )
    return found


def _context() -> Any:
    """An offscreen GL context.

    Of the kind MUJOCO_GL names, else EGL on Linux and the system's own elsewhere.
    """
    kind = os.environ.get("MUJOCO_GL", "").strip().lower() or RENDERER
    try:
        context = import_module(f"mujoco.{kind}").GLContext(WIDTH, SCENE_HEIGHT)
        context.make_current()
    except Exception as error:  # each kind raises its own
        raise RigtwinError(f"{NO_RENDERING} ({kind}: {type(error).__name__})") from None
    return context


@contextmanager
def _renderer(
    machine: Machine, camera: str | None
) -> Iterator[Callable[[dict[str, float], Array | None, dict[str, float]], Image]]:
    """A function from joint positions, the beams' heights if there are any, and the ghost's joint
    positions if there is one, to a picture."""
    model = mujoco.MjModel.from_xml_path(str(machine.physics.scene(machine)))
    cameras = [model.camera(number).name for number in range(model.ncam)]
    camera = camera or (cameras[0] if cameras else "free")
    if camera not in (*cameras, "free"):
        raise RigtwinError(f"unknown camera {camera!r}; there are {', '.join([*cameras, 'free'])}")
    data = mujoco.MjData(model)
    context = _context()
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, SCENE_HEIGHT
    drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
    scene = mujoco.MjvScene(model, maxgeom=500)
    options, view = mujoco.MjvOption(), mujoco.MjvCamera()
    if camera == "free":
        mujoco.mjv_defaultFreeCamera(model, view)
    else:
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(camera).id
    window = mujoco.MjrRect(0, 0, WIDTH, SCENE_HEIGHT)
    picture = np.empty((SCENE_HEIGHT, WIDTH, 3), np.uint8)

    def render(positions: dict[str, float], bent: Array | None, ghost: dict[str, float]) -> Image:
        for joint, position in positions.items():
            data.qpos[model.joint(joint).qposadr[0]] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        mujoco.mjv_updateScene(model, data, options, None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
        if bent is not None:
            _draw_beams(scene, data.body("structure_plate").xpos, bent)
        if ghost:
            for joint, position in ghost.items():
                data.qpos[model.joint(joint).qposadr[0]] = position
            mujoco.mj_kinematics(model, data)
            _draw_ghost(scene, model, data, options)
        mujoco.mjr_render(window, scene, drawing)
        mujoco.mjr_readPixels(picture, None, window, drawing)
        return picture[::-1]

    try:
        yield render
    finally:
        drawing.free()
        context.free()


def _draw_ghost(
    scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData, options: mujoco.MjvOption
) -> None:
    """Adds what moves once more to a scene, where a twin has it."""
    first = scene.ngeom
    moving = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, data, options, mujoco.MjvPerturb(), moving, scene)
    for number in range(first, scene.ngeom):
        geom = scene.geoms[number]
        geom.rgba, geom.matid, geom.transparent = GHOST_COLOUR, -1, 1


def _draw_beams(scene: mujoco.MjvScene, plate: Array, bent: Array) -> None:
    """Adds the cross of beams to a scene, its centre at the plate.

    Its arms are drawn across the rig and far shorter than they are, what they do along it in full
    size.
    """
    for arm in ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)):
        points = [
            plate + np.array([height, 0.0, 0.0]) + BEAM_DRAWN * n * np.array(arm)
            for n, height in enumerate(bent)
        ]
        for inner, outer in pairwise(points):
            geom = scene.geoms[scene.ngeom]
            kind = mujoco.mjtGeom.mjGEOM_CAPSULE
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), BEAM_COLOUR)
            mujoco.mjv_connector(geom, kind, 0.012, inner, outer)
            scene.ngeom += 1


class _Traces:
    """Force and travel drawn once; every frame adds the line that marks its time."""

    def __init__(self, curves: Sequence[Curve], time: Array, ticks: slice) -> None:
        time = time[ticks]
        figure = Figure(figsize=(WIDTH / 100, TRACE_HEIGHT / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        titles = list(dict.fromkeys(curve.axis for curve in curves))[:2]
        axes = figure.subplots(max(len(titles), 1), 1, sharex=True, squeeze=False)[:, 0]
        for axis, title in zip(axes, titles, strict=False):
            for curve in (each for each in curves if each.axis == title):
                axis.plot(
                    time, curve.values[ticks], color=curve.colour, linewidth=0.9, label=curve.label
                )
            axis.set_ylabel(title, fontsize=8)
            if len(axis.lines) > 1:
                axis.legend(
                    loc="upper right", fontsize=7, framealpha=0.85, edgecolor="none", ncols=2
                )
        upper, lower = axes[0], axes[-1]
        lower.set_xlabel("time, s", fontsize=8)
        for axis in axes:
            axis.grid(alpha=0.3)
            axis.tick_params(labelsize=7)
            axis.set_xlim(time[0], time[-1])
        figure.subplots_adjust(left=0.07, right=0.985, top=0.97, bottom=0.16, hspace=0.12)
        canvas.draw()
        self._picture: Image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        box = lower.get_window_extent()
        top = upper.get_window_extent()
        self._rows = slice(TRACE_HEIGHT - int(top.y1), TRACE_HEIGHT - int(box.y0))
        self._left, self._width = box.x0, box.width
        self._start, self._span = float(time[0]), float(time[-1] - time[0])

    def at(self, time: float) -> Image:
        """The traces with the marker at `time` (s)."""
        picture = self._picture.copy()
        column = int(self._left + self._width * (time - self._start) / self._span)
        picture[self._rows, max(column - 1, 0) : column + 1] = (20, 20, 20)
        return picture
