"""Equation of motion of one joint, pushed by a force or with prescribed motion. Compiled.

    m·x'' + g(x) + k·(x − x_rest) + d(x')·x' + c_q·x'·|x'| + F_dry = F_actuator + F_disturbance

with the inertia m, the gravity load g, the guide's spring k, viscous friction d (through a lag
where the guide has a relaxation), quadratic friction c_q and dry friction F_dry.

Dry friction acts through a backlash and a spring in series with it: an elastic, perfectly plastic
element (Prandtl's). Like the bristles of the LuGre model (Canudas de Wit et al., IEEE Transactions
on Automatic Control 40(3), 1995), it gives presliding motion. Without a described spring, it is as
stiff as the step resolves, which holds a sticking joint in place.

Numerical scheme: positions at the steps, velocities midway between them. Viscous forces act at the
mean of two velocities, which is second order, as a lightly damped resonance needs. Where they would
overcome the inertia within a step, they become implicit. Dry friction is implicit, so it neither
chatters nor creeps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from controllers.formula_program import Program, run
from rigtwin.components.conditioning import Actuator, ActuatorState, condition
from rigtwin.components.guide_force import damping
from rigtwin.components.guide_step import GuideStep
from rigtwin.components.mount import MountState, give_way
from rigtwin.components.sensors import Transducer, TransducerState, transduce
from rigtwin.components.servo import Play, Push, depends_on_motion, pull, push
from rigtwin.models.joint_step import step_behind_play, step_joint
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import loop_kernel, part_kernel

FURTHEST = 1e12
"""Largest position that is looked up in the gravity grid, in grid spacings."""
SHORTEST = 1.0
"""Factor on step² / inertia below which the compliance of a mount counts as rigid."""
RIGID = 1e6
"""Factor on inertia / step² above which a spring counts as rigid."""


class Inertia(NamedTuple):
    """Inertia and gravity load of one joint.

    The gravity load is tabulated on a grid of positions and interpolated linearly.
    """

    mass: float  # Inertia, kg or kg m².
    first: float  # First position of the grid, m or rad.
    spacing: float  # Spacing of the grid, m or rad.
    load: Array  # Gravity load on the grid, N or Nm, shape (positions,).
    turns: bool  # Whether the joint turns round, so that the grid's end is its beginning.


class Drive(NamedTuple):
    """Force actuator or servo that pushes one joint."""

    law: Push  # Law from the conditioned command to the force.
    conditioning: Actuator  # Conditioning of the command, for one integration step.
    held: ActuatorState  # State of the conditioning, changed in place.
    play: Play  # Play between its motor and the joint.


class Loop(NamedTuple):
    """Source of the actuator's command: the recording, or a controller in closed loop."""

    closed: bool  # Whether the controller runs along; otherwise the command is the recorded one.
    program: Program  # Compiled formula of the controller.
    registers: Array  # Work space of the formula; its inputs come first.
    memory: Array  # State of the formula (integrals, filters, delays).
    recorded: Array  # Recorded inputs of the controller, shape (ticks, inputs).
    noise: Array  # Noise added to simulated inputs, shape (ticks, inputs).
    sensor_of_input: np.ndarray  # Simulated sensor of each input, or −1 for a recorded one.
    sensors: tuple[Transducer, ...]  # Sensors that the controller reads.
    states: tuple[TransducerState, ...]  # States of these sensors, changed in place.
    neutral: np.ndarray  # Whether each sensor reads the true quantity.
    rates: np.ndarray  # Quantity of each sensor: 0 position, 1 velocity.


@compilable
def gravity(inertia: Inertia, position: float) -> float:
    """Return the gravity load at a position, by linear interpolation.

    Parameters
    ----------
    inertia
        Inertia and gravity grid of the joint.
    position
        Position, m or rad.

    Returns
    -------
    float
        Gravity load, N or Nm; that of the grid's end beyond it.
    """
    place, last = (position - inertia.first) / inertia.spacing, len(inertia.load) - 1
    # A diverged position is not reduced to one turn: it may be infinite.
    if inertia.turns and abs(place) < FURTHEST:
        place -= math.floor(place / last) * last
    # The negated comparison also catches NaN, which would be an index out of range.
    if not place > 0.0:
        place = 0.0
    place = min(place, last - 1e-6)
    whole = int(place)
    part = place - whole
    return (1.0 - part) * inertia.load[whole] + part * inertia.load[whole + 1]


@part_kernel
def compute_command(loop: Loop, tick: int, x: float, v: float, period: float) -> float:
    """Return the controller's command at a tick, and advance the states of its sensors.

    Parameters
    ----------
    loop
        Controller with its sensors.
    tick
        Number of the tick.
    x, v
        Position and velocity of the joint, m and m/s.
    period
        Time from tick to tick, s.
    """
    for number in range(len(loop.sensor_of_input)):
        source = loop.sensor_of_input[number]
        value = loop.recorded[tick, number]
        if source >= 0:
            value = x if loop.rates[source] == 0 else v
            # Neutral sensors are skipped: finding one in the tuple at run time costs more than the
            # rest of a tick.
            if not loop.neutral[source]:
                value = transduce(loop.sensors[source], loop.states[source], value)
            value += loop.noise[tick, number]
        loop.registers[number] = value
    return run(loop.program.operations, loop.registers, loop.memory, period)


@part_kernel
def push_joint(
    drive: Drive, command: float, last: float, x: float, v: float
) -> tuple[float, float, float]:
    """Return the actuator's force over one step.

    The step of the velocity is centred on this position: half of it passes under the command of the
    step before, and half under that of this step. The force is therefore the mean of both.

    Parameters
    ----------
    drive
        Force actuator or servo.
    command
        Command of this tick, in its unit.
    last
        `last` as returned for the step before.
    x, v
        Position and velocity of the joint, m and m/s.

    Returns
    -------
    tuple
        Force without a servo's damping, N, the damping, Ns/m, and what the next step needs: the
        conditioned command of a servo, m, or the force of a force actuator, N.
    """
    law = drive.law
    wanted = condition(drive.conditioning, drive.held, command)
    if not depends_on_motion(law):
        force = push(law, wanted, x, v)
        return 0.5 * (last + force), 0.0, force
    pushed, held_by = pull(law, 0.5 * (last + wanted), x), law.damping_gain
    if abs(pushed - held_by * v) > law.limit:
        # A saturated servo has a constant force, so it damps nothing.
        pushed, held_by = math.copysign(law.limit, pushed - held_by * v), 0.0
    return pushed, held_by, wanted


@loop_kernel
def integrate_pushed(
    guide_step: GuideStep,
    inertia: Inertia,
    start: tuple[float, float],
    drive: Drive,
    loop: Loop,
    disturbance: Array,
    period: float,
    steps: int,
    out: Array,
) -> None:
    """Integrate the joint under its force actuator or servo.

    Parameters
    ----------
    guide_step, inertia
        Guide of the joint, for the integration step, and inertia of the joint.
    start
        Initial position and velocity, m and m/s.
    drive
        Force actuator or servo.
    loop
        Source of the command.
    disturbance
        Unmodelled force on the joint, N, shape (ticks,).
    period
        Time from tick to tick, s.
    steps
        Integration steps per tick.
    out
        Position, velocity, actuator force and command, shape (4, ticks). The command is read where
        the loop is open, and all else is written.
    """
    h, (x, v) = guide_step.step, start
    slider, viscous = x, damping(guide_step.guide, v) * v
    behind = MountState(x, 0.0, slider, viscous)
    law, mass, rotor = drive.law, inertia.mass, start
    plays = drive.play.half > 0.0
    follows = depends_on_motion(law)
    # What the step before leaves: a servo's conditioned command, or a force actuator's force.
    last = drive.held.memory[4] if follows else 0.0
    # A mount whose oscillation with the mass is faster than the step, c·m < h², counts as rigid.
    yields = guide_step.guide.mount_compliance * mass > SHORTEST * h * h
    for tick in range(len(disturbance)):
        # Sensors read before the tick's command acts.
        out[0, tick], out[1, tick] = x, v
        out[2, tick] = push(law, last, rotor[0], rotor[1]) if follows else last
        if loop.closed:
            out[3, tick] = compute_command(loop, tick, x, v, period)
        for _ in range(steps):
            pushed, held_by, last = push_joint(drive, out[3, tick], last, rotor[0], rotor[1])
            outer = pushed + disturbance[tick] - gravity(inertia, x)
            if plays:
                rotor, (x, v, slider, viscous) = step_behind_play(
                    guide_step,
                    drive.play,
                    mass,
                    rotor,
                    (x, v, slider, viscous),
                    (pushed, held_by, outer - pushed),
                )
                continue
            if yields:
                behind, held_back = give_way(guide_step, behind, pushed - held_by * v, x)
                # The mount decouples the guide, whose force is therefore explicit; only a servo's
                # damping is implicit.
                v = (v + h * (outer - held_back) / mass) / (1.0 + h * held_by / mass)
                x += h * v
            else:
                x, v, slider, viscous = step_joint(
                    guide_step, mass, (x, v, slider, viscous), pushed, held_by, outer
                )
            rotor = (x, v)
