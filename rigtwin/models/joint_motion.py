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
    rest: float  # Position at which the guide's spring is slack, m or rad.
    turns: bool  # Whether the joint turns round, so that the grid's end is its beginning.


class Loop(NamedTuple):
    """Source of the actuator's command: the recording, or a controller in closed loop."""

    closed: bool  # Whether the controller runs along; otherwise the command is the recorded one.
    program: Program  # Compiled formula of the controller.
    registers: Array  # Work space of the formula; its inputs come first.
    memory: Array  # State of the formula (integrals, filters, delays).
    recorded: Array  # Recorded inputs of the controller, shape (ticks, inputs).
    noise: Array  # Noise added to simulated inputs, shape (ticks, inputs).
    sensor: np.ndarray  # Simulated sensor of each input, or −1 for a recorded one.


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
    """Add a guide's forces to the load that it transmits, for a prescribed motion.

    Parameters
    ----------
    guide, dry_friction
        Guide that resists the motion, and its dry friction.
    spring
        Stiffness in series with the dry friction, N/m.
    rest
        Position at which the guide's own spring is slack, m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Transmitted load, N, shape (ticks,); overwritten with the whole force.
    """
    # At the start the friction spring is slack, as after a long rest.
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
        # Load-dependent friction sees inertia, gravity and spring, but not friction itself.
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
    """Add a guide's forces to its load where dry friction has neither backlash nor spring.

    The velocity is known, so dry friction follows its sign and reverses in the same tick.

    Parameters
    ----------
    guide, dry_friction
        Guide that resists the motion, and its dry friction.
    rest
        Position at which the guide's own spring is slack, m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Transmitted load, N, shape (ticks,); overwritten with the whole force.
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
    """Compute the force that moves the joint as prescribed: m·x'' + g(x) + guide's forces.

    Parameters
    ----------
    guide, dry_friction, inertia
        Guide with its dry friction, and inertia of the joint.
    spring
        Stiffness in series with the dry friction, N/m.
    period
        Time from tick to tick, s.
    motion
        Position, velocity and acceleration, m, m/s and m/s², shape (3, ticks).
    out
        Force, written, N, shape (ticks,).
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
    disturbance: Array,
    period: float,
    steps: int,
    out: Array,
) -> None:
    """Integrate the joint under its force actuator or servo.

    Parameters
    ----------
    guide, dry_friction, inertia
        Guide with its dry friction, and inertia of the joint.
    spring
        Stiffness in series with the dry friction, N/m.
    start
        Initial position and velocity, m and m/s.
    law
        Law of the force actuator or servo.
    drive, held
        Conditioning of its command, and the state of that.
    sensors, states
        Sensors that the controller reads, and their states.
    kinds
        Measured quantity of each sensor: 0 position, 1 velocity.
    loop
        Source of the command.
    command
        Recorded command, shape (ticks,); overwritten by the controller in closed loop.
    disturbance
        Unmodelled force on the joint, N, shape (ticks,).
    period
        Time from tick to tick, s.
    steps
        Integration steps per tick.
    out
        Position, velocity and actuator force, written, shape (3, ticks).
    """
    # One kernel on purpose: parts of their own would pass and return a dozen scalars of state in
    # every step.
    h = period / steps
    x, v = start
    slider, viscous, force = x, damping(guide, v) * v, 0.0
    # A servo's conditioned command is a position, a force actuator's a force.
    follows, wanted, held_by = law.position_gain > 0.0, held.memory[3], 0.0
    half = 0.5 * guide.backlash
    neutral = np.array([sensor.neutral for sensor in sensors])
    share = h / (guide.relaxation + h)
    yields = guide.mount_compliance * inertia.mass > SHORTEST * h * h
    inner, speed = x, 0.0
    # Reading a tuple's fields inside the loop costs more than a step.
    sensor, recorded, noise = loop.sensor, loop.recorded, loop.noise
    operations, registers, memory = loop.program.operations, loop.registers, loop.memory
    for tick in range(len(command)):
        # Sensors read before the tick's command acts.
        out[0, tick], out[1, tick] = x, v
        out[2, tick] = push(law, wanted, x, v) if follows else force
        if loop.closed:
            for number in range(len(sensor)):
                source = sensor[number]
                registers[number] = recorded[tick, number]
                if source >= 0:
                    true = x if kinds[source] == 0 else v
                    # A neutral sensor is skipped: reading it from the tuple costs more than the
                    # rest of a tick.
                    sensed = (
                        true
                        if neutral[source]
                        else transduce(sensors[source], states[source], true)
                    )
                    registers[number] = sensed + noise[tick, number]
            command[tick] = run(operations, registers, memory, period)
        for _ in range(steps):
            if follows:
                before, wanted = wanted, condition(drive, held, command[tick])
                pushed, held_by = pull(law, 0.5 * (before + wanted), x), law.damping_gain
                if abs(pushed - held_by * v) > law.limit:
                    # A saturated servo has a constant force, so it damps nothing.
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
                load = pushed + disturbance[tick] - gravity(inertia, x) - held_back
                v = (v + h * load / inertia.mass) / (1.0 + h * held_by / inertia.mass)
                x += h * v
                continue
            coefficient = damping(guide, v)
            # The velocity step is centred on this position: half of it passes under the old
            # command and half under the new one, which is why `pushed` is their mean.
            load = (
                pushed
                + disturbance[tick]
                - gravity(inertia, x)
                - position_force(guide, x, inertia.rest)
                - (1.0 - share) * viscous
            )
            damped = h * (share * coefficient + guide.drag * abs(v) + held_by)
            # Implicit share of the damping: the midpoint rule's ½ until d·h = 2m, where it would
            # start to oscillate, and more beyond.
            ahead = 1.0 - inertia.mass / damped if damped > 2.0 * inertia.mass else 0.5
            total = inertia.mass + ahead * damped
            rhs = (inertia.mass - (1.0 - ahead) * damped) * v + h * load
            forward, backward = dry_limits(dry_friction, v, pushed)
            # Without dry friction; then with a stretched spring; then with a slider that slides.
            velocity = rhs / total
            stretch_length = x + h * velocity - slider
            if stretch_length > half or stretch_length < -half:
                edge = math.copysign(half, stretch_length)
                velocity = (rhs - h * spring * (x - slider - edge)) / (total + h * h * spring)
                dry, by = slide(x + h * velocity - slider, half, spring, forward, backward)
                if by != 0.0:
                    velocity = (rhs - h * dry) / total
                    slider = x + h * velocity - edge - dry / spring
            between = ahead * velocity + (1.0 - ahead) * v
            viscous += share * (coefficient * between - viscous)
            v = velocity
            x += h * v
