"""One joint's equation of motion: pushed by a force, or moved as prescribed. Compiled.

Dry friction acts through a play and a spring in series with it. Where the description gives no
spring it is as stiff as the step allows, which holds a sticking joint where it is. Positions are
taken at the steps, velocities midway between them. Viscous forces are those of the mean of two
velocities, which is of second order, as a lightly damped resonance needs; where they would overcome
the inertia within a step they become implicit. Dry friction is implicit, so it neither chatters nor
creeps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.compiled import compilable
from controllers.formula import Program, run
from rigtwin.components import Guide
from rigtwin.components.conditioning import Actuator, ActuatorState, condition
from rigtwin.components.guide import Friction, damping, dry_limits, position_force, slide
from rigtwin.components.mount import give_way
from rigtwin.components.sensors import Transducer, TransducerState, transduce
from rigtwin.components.servo import Push, pull, push
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

FURTHEST = 1e12
"""Spacings of a grid beyond which a position is none."""
SHORTEST = 1.0
"""Times step² / inertia, below which a mount's compliance cannot be told from a rigid one."""
RIGID = 1e6
"""Times inertia / step², above which a spring cannot be told from a rigid one."""


class Inertia(NamedTuple):
    """mass: kg or kg m². first, spacing, load: the gravity load, N or Nm, on a grid of positions;
    rest: where the guide's spring is slack; turns: whether the grid's end is its beginning."""

    mass: float
    first: float
    spacing: float
    load: Array
    rest: float
    turns: bool


class Loop(NamedTuple):
    """What commands the force actuator: the recording (closed 0), or a controller whose inputs are
    recorded signals, shape (ticks, inputs), or sensors with `noise` added, of that shape too:
    sensor[i] is −1 or the number of the sensor that input i comes from."""

    closed: bool
    program: Program
    registers: Array
    memory: Array
    recorded: Array
    noise: Array
    sensor: np.ndarray


@compilable
def gravity(inertia: Inertia, position: float) -> float:
    """The gravity load at a position, straight between the grid's points.

    Parameters
    ----------
    inertia
        Of the joint.
    position
        m.

    Returns
    -------
    float
        N.
    """
    place, last = (position - inertia.first) / inertia.spacing, len(inertia.load) - 1
    # Of what ran away there is no place.
    if inertia.turns and abs(place) < FURTHEST:
        place -= math.floor(place / last) * last
    if not place > 0.0:
        place = 0.0
    place = min(place, last - 1e-6)
    whole = int(place)
    part = place - whole
    return (1.0 - part) * inertia.load[whole] + part * inertia.load[whole + 1]


@kernel
def resist(
    guide: Guide,
    dry_friction: Friction,
    spring: float,
    rest: float,
    period: float,
    motion: Array,
    out: Array,
) -> None:
    """Adds a guide's forces to the load that it transmits.

    Parameters
    ----------
    guide, dry_friction
        What resists the motion.
    spring
        In series with the dry friction, N/m.
    rest
        Where the guide's own spring is slack, m.
    period
        s, of a tick.
    motion
        Position m, velocity m/s, acceleration m/s², shape (3, ticks).
    out
        The load, N, shape (ticks,); the whole force is written here.
    """
    slider, viscous = motion[0, 0], 0.0
    share = period / (guide.relaxation + period)
    if guide.mount_compliance > 0.0:
        inner = motion[0, 0]
        speed = 0.0
        for tick in range(motion.shape[1]):
            place, slider, viscous, force = give_way(
                guide=guide,
                dry_friction=dry_friction,
                spring=spring,
                rest=rest,
                share=share,
                period=period,
                inner=inner,
                speed=speed,
                slider=slider,
                viscous=viscous,
                load=out[tick],
                outer=motion[0, tick],
            )
            speed, inner = (place - inner) / period, place
            out[tick] += force
        return
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        transmitted = out[tick] + position_force(guide, x, rest)
        forward, backward = dry_limits(dry_friction, v, transmitted)
        dry, by = slide(x - slider, 0.5 * guide.backlash, spring, forward, backward)
        slider += by
        viscous += share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + guide.drag * v * abs(v)


@kernel
def resist_at_once(
    guide: Guide, dry_friction: Friction, rest: float, period: float, motion: Array, out: Array
) -> None:
    """The same of a guide without play and springs before its friction, whose speed is known: dry
    friction reverses in the very tick in which the speed does.

    Parameters
    ----------
    guide, dry_friction
        What resists the motion.
    rest
        Where the guide's own spring is slack, m.
    period
        s, of a tick.
    motion
        Position m, velocity m/s, acceleration m/s², shape (3, ticks).
    out
        The load, N, shape (ticks,); the whole force is written here.
    """
    viscous, share = 0.0, period / (guide.relaxation + period)
    for tick in range(motion.shape[1]):
        x, v = motion[0, tick], motion[1, tick]
        transmitted = out[tick] + position_force(guide, x, rest)
        forward, backward = dry_limits(dry_friction, v, transmitted)
        dry = forward if v > 0.0 else (-backward if v < 0.0 else 0.0)
        viscous += share * (damping(guide, v) * v - viscous)
        out[tick] = transmitted + dry + viscous + guide.drag * v * abs(v)


@kernel
def inverse_dynamics(
    guide: Guide,
    dry_friction: Friction,
    inertia: Inertia,
    spring: float,
    period: float,
    motion: Array,
    out: Array,
) -> None:
    """The force that moves the joint as prescribed.

    Parameters
    ----------
    guide, dry_friction, inertia
        What moves.
    spring
        In series with the dry friction, N/m.
    period
        s, of a tick.
    motion
        Position m, velocity m/s, acceleration m/s², shape (3, ticks).
    out
        The force is written here, N, shape (ticks,).
    """
    for tick in range(motion.shape[1]):
        x, a = motion[0, tick], motion[2, tick]
        out[tick] = inertia.mass * a + gravity(inertia, x)
    resist(
        guide=guide,
        dry_friction=dry_friction,
        spring=spring,
        rest=inertia.rest,
        period=period,
        motion=motion,
        out=out,
    )


@kernel
def integrate_pushed(
    guide: Guide,
    dry_friction: Friction,
    inertia: Inertia,
    spring: float,
    start: tuple[float, float],
    law: Push,
    drive: Actuator,
    held: ActuatorState,
    sensors: tuple[Transducer, ...],
    states: tuple[TransducerState, ...],
    kinds: np.ndarray,
    loop: Loop,
    command: Array,
    besides: Array,
    period: float,
    steps: int,
    out: Array,
) -> None:
    """The joint under its force actuator or servo.

    Parameters
    ----------
    guide, dry_friction, inertia
        What moves.
    spring
        In series with the dry friction, N/m.
    start
        Position m and velocity m/s.
    law
        Of what pushes it.
    drive, held
        Conditioning of its command, and its state.
    sensors, states, kinds
        That the controller reads; kind 0 of position, 1 of velocity.
    loop
        What commands the actuator.
    command
        As recorded, shape (ticks,); replaced by the controller's if the loop is closed.
    besides
        Another force, N, shape (ticks,).
    period
        s, of a tick.
    steps
        Of integration a tick.
    out
        Position, velocity and the actuator's force are written here, shape (3, ticks).
    """
    h = period / steps
    x, v = start
    slider, viscous, force = x, damping(guide, v) * v, 0.0
    follows, wanted, held_by = law.position_gain > 0.0, held.memory[3], 0.0
    half = 0.5 * guide.backlash
    neutral = np.array([sensor.neutral for sensor in sensors])
    share = h / (guide.relaxation + h)
    yields = guide.mount_compliance * inertia.mass > SHORTEST * h * h
    inner, speed = x, 0.0
    # Taken out of their tuple here: in the loop it costs more than a step.
    sensor, recorded, noise = loop.sensor, loop.recorded, loop.noise
    operations, registers, memory = loop.program.operations, loop.registers, loop.memory
    for tick in range(len(command)):
        out[0, tick], out[1, tick] = x, v
        out[2, tick] = push(law, wanted, x, v) if follows else force
        if loop.closed:
            for number in range(len(sensor)):
                which = sensor[number]
                registers[number] = recorded[tick, number]
                if which >= 0:
                    true = x if kinds[which] == 0 else v
                    # To take a sensor out of the tuple costs more than the rest of a tick.
                    sensed = (
                        true if neutral[which] else transduce(sensors[which], states[which], true)
                    )
                    registers[number] = sensed + noise[tick, number]
            command[tick] = run(operations, registers, memory, period)
        for _ in range(steps):
            if follows:
                before, wanted = wanted, condition(drive, held, command[tick])
                pushed, held_by = pull(law, 0.5 * (before + wanted), x), law.damping_gain
                if abs(pushed - held_by * v) > law.limit:
                    # At its limit a servo damps nothing.
                    pushed, held_by = math.copysign(law.limit, pushed - held_by * v), 0.0
            else:
                earlier = force
                force = push(law, condition(drive, held, command[tick]), x, v)
                pushed = 0.5 * (earlier + force)
            if yields:
                place, slider, viscous, held_back = give_way(
                    guide=guide,
                    dry_friction=dry_friction,
                    spring=spring,
                    rest=inertia.rest,
                    share=share,
                    period=h,
                    inner=inner,
                    speed=speed,
                    slider=slider,
                    viscous=viscous,
                    load=pushed,
                    outer=x,
                )
                speed, inner = (place - inner) / h, place
                load = pushed + besides[tick] - gravity(inertia, x) - held_back
                v = (v + h * load / inertia.mass) / (1.0 + h * held_by / inertia.mass)
                x += h * v
                continue
            coefficient = damping(guide, v)
            # About this position half a step passes under the old force and half under the new one.
            load = (
                pushed
                + besides[tick]
                - gravity(inertia, x)
                - position_force(guide, x, inertia.rest)
                - (1.0 - share) * viscous
            )
            damped = h * (share * coefficient + guide.drag * abs(v) + held_by)
            # Above ½ only there; a division that is not needed delays the step.
            ahead = 1.0 - inertia.mass / damped if damped > 2.0 * inertia.mass else 0.5
            total = inertia.mass + ahead * damped
            rhs = (inertia.mass - (1.0 - ahead) * damped) * v + h * load
            forward, backward = dry_limits(dry_friction, v, pushed)
            velocity = rhs / total
            apart = x + h * velocity - slider
            if apart > half or apart < -half:
                edge = math.copysign(half, apart)
                velocity = (rhs - h * spring * (x - slider - edge)) / (total + h * h * spring)
                dry, by = slide(x + h * velocity - slider, half, spring, forward, backward)
                if by != 0.0:
                    velocity = (rhs - h * dry) / total
                    slider = x + h * velocity - edge - dry / spring
            between = ahead * velocity + (1.0 - ahead) * v
            viscous += share * (coefficient * between - viscous)
            v = velocity
            x += h * v
