"""One joint that is moved as prescribed or pushed by a constant force, with a guide and a mass."""

from __future__ import annotations

import numba
import numpy as np

from controllers.formula import formula
from rigtwin.components import Computer, ForceActuator, Guide, PositionSensor, Pusher
from rigtwin.components.conditioning import actuator, hold
from rigtwin.components.guide_step import guide_step_of
from rigtwin.components.sensors import start_transducer, transducer
from rigtwin.components.servo import play_of, push_law
from rigtwin.models.joint_inverse import inverse_dynamics
from rigtwin.models.joint_motion import Drive, Inertia, Loop, integrate_pushed
from rigtwin.numerics.arrays import Array

PERIOD = 1e-3
"""Time between ticks, s."""
INTERPRETED = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
"""Whether compilation is switched off; what calls MuJoCo from compiled code cannot run then."""
STIFF = 1e9
"""Stiffness of the spring in series with dry friction that counts as rigid, N/m."""


def inertia_of(mass: float, load: float = 0.0) -> Inertia:
    """Return a mass in kg under a constant load in N."""
    return Inertia(mass, -10.0, 20.0, np.full(2, load), turns=False)


def force_to_move(
    guide: Guide,
    position: Array,
    mass: float = 0.0,
    load: float = 0.0,
    spring: float = STIFF,
    rest: float = 0.0,
) -> Array:
    """Return the force in N, shape (ticks,), that moves a joint through positions in m."""
    speed = np.gradient(position, PERIOD)
    motion = np.ascontiguousarray(np.stack([position, speed, np.gradient(speed, PERIOD)]))
    force = np.empty(len(position))
    guide_step = guide_step_of(guide, spring, rest, PERIOD)
    inverse_dynamics(guide_step, inertia_of(mass, load), motion, force)
    return force


def motion_under(
    guide: Guide,
    command: Array,
    mass: float,
    mover: Pusher | None = None,
    load: float = 0.0,
    spring: float = STIFF,
    start: tuple[float, float] = (0.0, 0.0),
    steps: int = 4,
) -> Array:
    """Return position m, speed m/s and force N, shape (3, ticks), of a joint under a command.

    The command is a force in N unless `mover` makes something else of it.
    """
    of = ForceActuator() if mover is None else mover
    none = formula("0", {})
    empty = np.zeros((1, 1))
    sensor = transducer(PositionSensor(), PERIOD)
    loop = Loop(
        closed=False,
        program=none.program,
        registers=none.program.registers.copy(),
        memory=none.memory(),
        recorded=empty,
        noise=empty,
        sensor_of_input=np.zeros(0, np.int64),
        sensors=(sensor,),
        states=(start_transducer(sensor),),
        neutral=np.ones(1, np.bool_),
        rates=np.zeros(1, np.int64),
    )
    conditioning = actuator(of, Computer(), PERIOD / steps)
    motion = np.zeros((4, len(command)))
    motion[3] = command
    integrate_pushed(
        guide_step=guide_step_of(guide, spring, 0.0, PERIOD / steps),
        inertia=inertia_of(mass, load),
        start=start,
        drive=Drive(push_law(of), conditioning, hold(conditioning, float(command[0])), play_of(of)),
        loop=loop,
        disturbance=np.zeros(len(command)),
        period=PERIOD,
        steps=steps,
        out=motion,
    )
    return motion[:3]
