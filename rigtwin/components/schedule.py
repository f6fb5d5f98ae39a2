"""Schedule: forces of a guide that follow a recorded channel, such as a voltage or a temperature.

With the channel's value behind a first-order lag, c, position x and velocity v of the joint:

    F = coulomb·u·s + viscous·u·v + offset·u,    u = a + (exp(growth·(c − a)) − 1)/growth,

with the middle a of the channel, `growth_about`; without growth u = c. Dry friction of unit size, s
from −1 to 1, has the direction of motion, after a reversal only once the joint has moved by the
error of its measured position. Friction that builds up over a speed v_r, the `rounding`, has
s = tanh(v/v_r). The dampers of controllable fluids are of this kind [Spencer, Dyke, Sain and
Carlson, J. Eng. Mech. 123(3), 1997]. The viscosity of oil falls exponentially with its temperature
[Reynolds, Phil. Trans. R. Soc. 177 (1886) 157].
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from rigtwin.components.dry_friction import slide
from rigtwin.components.effect import Context, Guess, Kind, Starts
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.components.scales import SHARES, Scales
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.filters import low_pass

PARTS = (0.02, 0.1, 0.4, -0.1)
"""Shares of the motion's force at which a search starts, at the channel's largest value."""
LARGEST_EXPONENT = 50.0
"""Largest exponent of a force that grows with its channel, which keeps it finite."""


class Schedule(NamedTuple):
    """Change of a guide's forces per unit of a recorded channel.

    Units are those of a sliding joint; for a turning joint, read Nm for N.
    """

    coulomb: Annotated[float, Quantity("N per unit of the channel", -1e9, 1e9, NONE)] = 0.0
    viscous: Annotated[float, Quantity("Ns/m per unit of the channel", -1e9, 1e9, NONE)] = 0.0
    offset: Annotated[float, Quantity("N per unit of the channel", -1e9, 1e9, NONE)] = 0.0
    growth: Annotated[float, Quantity("1 per unit of the channel", -1e9, 1e9, NONE)] = 0.0
    growth_about: Annotated[float, Quantity("unit of the channel", -1e12, 1e12, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    rounding: Annotated[float, Quantity("m/s", 0.0, 1e3, NONE)] = 0.0


def follow(schedule: Schedule, level: Array, period: float) -> Array:
    """Return the channel behind its lag and growth, to which forces are proportional.

    Parameters
    ----------
    schedule
        Schedule with lag and growth.
    level
        Recorded values of the channel, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        Values in the channel's unit, shape (ticks,).
    """
    late = low_pass(level, schedule.lag, period) if schedule.lag > 0.0 else level
    if schedule.growth == 0.0:
        return late
    middle = schedule.growth_about
    exponents = np.clip(schedule.growth * (late - middle), -LARGEST_EXPONENT, LARGEST_EXPONENT)
    return middle + np.expm1(exponents) / schedule.growth


def scheduled_force(schedule: Schedule, level: Array, motion: Array, spring: float) -> Array:
    """Return the force that follows a channel, N, shape (ticks,).

    Parameters
    ----------
    schedule
        Change of the guide's forces per unit of the channel.
    level
        Channel behind its lag and growth, shape (ticks,), as `follow` returns it.
    motion
        Position, velocity and acceleration of the joint, shape (3, ticks).
    spring
        Inverse of the distance over which dry friction builds up after a reversal, 1/m.
    """
    force = schedule.viscous * level * motion[1] + schedule.offset * level
    if schedule.coulomb != 0.0:
        direction = np.zeros(motion.shape[1])
        if schedule.rounding > 0.0:
            direction = np.tanh(motion[1] / schedule.rounding)
        else:
            find_direction(motion[0], spring, direction)
        force = force + schedule.coulomb * level * direction
    return np.asarray(force)


@kernel
def find_direction(position: Array, spring: float, out: Array) -> None:
    """Compute dry friction of unit size along a prescribed motion.

    Parameters
    ----------
    position
        Position of the joint, m, shape (ticks,).
    spring
        Inverse of the distance over which friction builds up after a reversal, 1/m.
    out
        Direction from −1 to 1, written, shape (ticks,).
    """
    slider = position[0]
    for tick in range(len(position)):
        out[tick], moved = slide(position[tick] - slider, 0.0, spring, 1.0, 1.0)
        slider += moved


def _per_channel(size: str) -> Guess:
    """Return starts of a force per unit of the channel: `size` names the scale of the force."""

    def guess(context: Context) -> Starts:
        scales: Scales = context.scales
        force = scales.force / (scales.speed if size == "damping" else 1.0)
        unit = force / max(context.swing.largest[0], 1e-300)
        return Starts.single([share * unit for share in PARTS], 0.005 * unit)

    return guess


def _growth(context: Context) -> Starts:
    # About the middle of the channel, growth resembles the proportional force least.
    largest, middle = context.swing.largest[0], context.swing.largest[SHARES.index(0.5)]
    unit = 1.0 / max(largest, 1e-300)
    values = tuple((share * unit, middle) for share in (-2.0, -0.5, 0.5, 2.0))
    return Starts(values, (0.01 * unit, 0.0))


def _lag(context: Context) -> Starts:
    period = context.scales.period
    times = sorted({2.0 * period, 8.0 * period, 0.01 * context.scales.time})
    return Starts.single(times, 0.5 * period)


def _rounding(context: Context) -> Starts:
    speed = context.scales.speed
    return Starts.single([share * speed for share in (0.05, 0.3, 1.0)], 0.01 * speed)


KINDS = (
    Kind(
        "coulomb",
        "proportional Coulomb friction",
        ("coulomb",),
        "dry friction that grows with the recorded channel",
        {Schedule: _per_channel("force")},
        "dry friction that falls as the recorded channel grows",
    ),
    Kind(
        "viscous",
        "proportional viscous friction",
        ("viscous",),
        "viscous friction that grows with the recorded channel",
        {Schedule: _per_channel("damping")},
        "viscous friction that falls as the recorded channel grows",
    ),
    Kind(
        "offset",
        "proportional force",
        ("offset",),
        "a force that grows with the recorded channel, whichever way the joint moves",
        {Schedule: _per_channel("force")},
    ),
    Kind(
        "growth",
        "exponential growth of its force",
        ("growth", "growth_about"),
        "the force grows exponentially with the recorded channel, and not in proportion",
        {Schedule: _growth},
        "the force fades exponentially as the recorded channel grows",
        constants=("growth_about",),
    ),
    Kind(
        "lag",
        "lag of its force",
        ("lag",),
        "the force follows the recorded channel late",
        {Schedule: _lag},
    ),
    Kind(
        "rounding",
        "rounding of proportional friction",
        ("rounding",),
        "dry friction that grows with the channel builds up over this speed",
        {Schedule: _rounding},
    ),
)
