"""What a position actuator makes of its command, whatever is inside it. Compiled."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from rigtwin.components import UNLIMITED, PositionActuator
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

HELD = 0.5
"""Ticks by which a held command is late on average."""


@kernel
def _follow_command(
    wanted: Array,
    play: float,
    gain: float,
    offset: float,
    limit: float,
    rate: float,
    shares: Array,
    second: Array,
    out: Array,
) -> None:
    """wanted, out: shape (steps,); rate: greatest change a step; shares: of each lag a step;
    second: transition of the resonance and its entry, shape (2, 3), or of no size."""
    passed = wanted[0]
    limited = min(max(gain * passed + offset, -limit), limit)
    one = two = before = limited
    place, speed = limited, 0.0
    for step in range(len(wanted)):
        passed = min(max(passed, wanted[step] - play), wanted[step] + play)
        aim = min(max(gain * passed + offset, -limit), limit)
        limited += min(max(aim - limited, -rate), rate)
        # The mean over the step is what a lag sees of it.
        seen = 0.5 * (before + limited)
        before = limited
        if shares[0] < 1.0:
            earlier = one
            one += shares[0] * (seen - one)
            seen = 0.5 * (earlier + one)
        else:
            one = limited
        earlier = two
        if shares[1] < 1.0:
            two += shares[1] * (seen - two)
        else:
            two = one
        if second.shape[0]:
            seen = 0.5 * (earlier + two)
            place, speed = (
                second[0, 0] * place + second[0, 1] * speed + second[0, 2] * seen,
                second[1, 0] * place + second[1, 1] * speed + second[1, 2] * seen,
            )
            out[step] = place
        else:
            out[step] = two


def follow_command(
    actuator: PositionActuator, command: Array, late: float, period: float, steps: int
) -> Array:
    """What a position actuator makes of its command.

    Parameters
    ----------
    actuator
        Its parameters.
    command
        m, shape (ticks,).
    late
        s besides, of the computer.
    period
        s, of a tick.
    steps
        Of integration a tick.

    Returns
    -------
    array
        Position at every tick, m, shape (ticks,).
    """
    ticks, h = len(command), period / steps
    count = (ticks - 1) * steps + 1
    time = np.arange(count) * h
    delay = actuator.delay + late + HELD * period
    within = np.clip(command, actuator.command_low, actuator.command_high)
    wanted = np.interp(time - delay, np.arange(ticks) * period, within)
    shares = np.array(
        [
            1.0 if lag <= 0.0 else 1.0 - math.exp(-h / lag)
            for lag in (actuator.lag, actuator.second_lag)
        ]
    )
    second = np.zeros((0, 3))
    if actuator.natural_frequency < 0.25 / h:
        w = 2.0 * math.pi * actuator.natural_frequency
        both = np.array(
            [[0.0, 1.0, 0.0], [-w * w, -2.0 * actuator.damping_ratio * w, w * w], [0.0, 0.0, 0.0]]
        )
        second = np.ascontiguousarray(expm(both * h)[:2])
    out = np.empty(count)
    rate = actuator.rate_limit * h if actuator.rate_limit < UNLIMITED else UNLIMITED
    _follow_command(
        wanted=wanted,
        play=actuator.deadband,
        gain=actuator.gain,
        offset=actuator.offset,
        limit=actuator.saturation,
        rate=rate,
        shares=shares,
        second=second,
        out=out,
    )
    return np.ascontiguousarray(out[::steps])
