"""Video of a recording: the moving machine, with its signals and a time mark below it.

Rendering is offscreen, so no display is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import mujoco
import numpy as np
from numpy.typing import NDArray

from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import compile_model
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.render.plot import find_stretch
from rigtwin.render.video_traces import SCENE_HEIGHT, TRACE_HEIGHT, WIDTH, Image, Traces
from rigtwin.system import RENDERER

FRAMES_PER_SECOND = 30
BEAM_DRAWN = 0.13
"""Length of a beam in the picture, in m."""
BEAM_COLOUR = np.array([0.82, 0.38, 0.24, 1.0], np.float32)
GHOST_COLOUR = np.array([0.92, 0.43, 0.08, 0.4], np.float32)
"""Colour of the twin's prediction, the same as on the page of a look."""
NO_RENDERING = (
    "cannot render without a display; on Debian or Ubuntu: sudo apt-get install libegl1 libgl1 "
    "libgl1-mesa-dri, elsewhere install EGL or OSMesa and set MUJOCO_GL=egl or osmesa"
)


def film(
    recording: RecordedTest,
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
    """Film a stretch of a recording in real time.

    Parameters
    ----------
    recording : RecordedTest
        Recording of any machine.
    out : Path
        Path of an mp4 file.
    machine : Machine
        Machine to be shown.
    camera : str, optional
        Camera of the model, or `free`. Defaults to the model's first camera.
    start, until : float
        Times in s. The stretch reaches to the end if `until` is None.
    magnify : float
        Magnification of motions, at most 20.
    progress : callable, optional
        Function called with the number of frames done, and of all frames.
    ghost : mapping, optional
        Joint → position of a twin, in m or rad, at every tick of the recording. The twin is drawn
        through the machine.

    Raises
    ------
    RigtwinError
        If the file's ending, the camera, the stretch or this computer's rendering is unsuitable.
    """
    if out.suffix.lower() != ".mp4":
        raise RigtwinError(f"cannot film {out.name!r}: the name must end in .mp4")
    if not 0.0 < magnify <= 20.0:
        raise RigtwinError(f"magnify {magnify:g}: expected more than 0, at most 20")
    ticks = find_stretch(recording, start, until)
    motions = {
        name: magnify * values[ticks] for name, values in _motions(recording, machine).items()
    }
    time = recording.time[ticks]
    ghosts = {name: magnify * values[ticks] for name, values in (ghost or {}).items()}
    traces = Traces(machine.physics.curves(machine, recording), recording.time, ticks)
    beams = machine.physics.deflection(recording)
    bent = None if beams is None else magnify * beams[ticks]
    frames = _list_frames(time)
    with _renderer(machine, camera) as render, _open_video(out) as put:
        for number, tick in enumerate(frames):
            at = {name: float(values[tick]) for name, values in motions.items()}
            twin = {name: float(values[tick]) for name, values in ghosts.items()}
            scene = render(at, None if bent is None else bent[tick], twin)
            put(np.vstack([scene, traces.at(float(time[tick]))]))
            if progress is not None:
                progress(number + 1, len(frames))


def _list_frames(time: Array) -> NDArray[np.intp]:
    """Return the tick that each frame shows: the next one recorded, at equal distances in time."""
    shown = np.searchsorted(time, np.arange(time[0], time[-1], 1.0 / FRAMES_PER_SECOND))
    # Rounding may place the last frame behind the end.
    return np.minimum(shown, len(time) - 1)


@contextmanager
def _open_video(out: Path) -> Iterator[Callable[[Image], object]]:
    """Provide a function that adds a picture to a video file, which is complete or not there."""
    # The video grows under another name; a failure must not leave half a file.
    temporary = out.with_name(f".{os.getpid()}.{out.name[-100:]}.part")
    try:
        with av.open(str(temporary), "w", format="mp4") as container:
            stream = _add_stream(container)

            def put(picture: Image) -> None:
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
                container.mux(stream.encode(frame))

            yield put
            # Encoding nothing flushes the frames that the encoder has delayed.
            container.mux(stream.encode())
        temporary.replace(out)
    except OSError as error:
        raise RigtwinError(f"cannot write {out}: {error.strerror}") from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _add_stream(container: Any) -> Any:
    """Add an H.264 stream to a video file; yuv420p is the format that every player shows."""
    stream = container.add_stream(
        "libx264", rate=FRAMES_PER_SECOND, options={"crf": "20", "preset": "veryfast"}
    )
    stream.width, stream.height = WIDTH, SCENE_HEIGHT + TRACE_HEIGHT
    stream.pix_fmt = "yuv420p"
    return stream


def _motions(recording: RecordedTest, machine: Machine) -> dict[str, Array]:
    """Return the position of each joint at every tick, in m or rad, from the recording alone."""
    machine.physics.require_motion(recording)
    motions = machine.physics.joint_positions(machine, recording.columns, recording.period)
    if not motions:
        raise RigtwinError(
            f"{recording.path}: no signal determines a joint's position; nothing can be drawn"
        )
    for joint, values in motions.items():
        if not np.isfinite(values).all():
            raise RigtwinError(
                f"{recording.path}: the position of {joint} has values that are not finite; "
                "nothing can be drawn of it"
            )
    return motions


def _context() -> Any:
    """Return an offscreen GL context.

    MUJOCO_GL selects its kind. The default is EGL on Linux, and the system's own elsewhere.
    """
    kind = os.environ.get("MUJOCO_GL", "").strip().lower() or RENDERER
    try:
        context = import_module(f"mujoco.{kind}").GLContext(WIDTH, SCENE_HEIGHT)
        context.make_current()
    # MuJoCo's back ends raise errors of their own types.
    except Exception as error:  # each kind raises its own
        raise RigtwinError(f"{NO_RENDERING} ({kind}: {type(error).__name__})") from None
    return context


@contextmanager
def _renderer(
    machine: Machine, camera: str | None
) -> Iterator[Callable[[dict[str, float], Array | None, dict[str, float]], Image]]:
    """Provide a function that renders a picture.

    Its arguments are the joints' positions, the beams' heights or None, and the ghost's joint
    positions, which may be empty.
    """
    model = compile_model(machine.physics.scene(machine))
    cameras = [model.camera(number).name for number in range(model.ncam)]
    camera = camera or (cameras[0] if cameras else "free")
    if camera not in (*cameras, "free"):
        raise RigtwinError(f"unknown camera {camera!r}; expected {', '.join([*cameras, 'free'])}")
    # The context must be current before MuJoCo uploads its textures and meshes.
    data = mujoco.MjData(model)
    context = _context()
    # MuJoCo allocates the offscreen buffer at this size, 640 x 480 by default.
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, SCENE_HEIGHT
    drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
    # Room for the machine's geoms, a ghost, and the beams.
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
        # Kinematics alone: a picture needs poses, not forces.
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
        # OpenGL's first row is the lowest.
        return picture[::-1]

    try:
        yield render
    finally:
        drawing.free()
        context.free()


def _draw_ghost(
    scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData, options: mujoco.MjvOption
) -> None:
    """Add the twin's moving geoms to a scene, in the ghost's colour."""
    first = scene.ngeom
    moving = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, data, options, mujoco.MjvPerturb(), moving, scene)
    for number in range(first, scene.ngeom):
        geom = scene.geoms[number]
        # Without the material its texture would hide the ghost's colour.
        geom.rgba, geom.matid, geom.transparent = GHOST_COLOUR, -1, 1


def _draw_beams(scene: mujoco.MjvScene, plate: Array, bent: Array) -> None:
    """Add the cross of beams to a scene, with its centre at the plate.

    The arms are drawn across the rig and much shorter than they are; their deflection is drawn in
    full size.
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
