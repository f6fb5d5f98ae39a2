"""Response of a position actuator to its command, whatever its construction. Compiled."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from rigtwin.components import UNLIMITED, PositionActuator
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

HELD = 0.5
"""Mean delay of a held command, in ticks: a zero-order hold delays by half a tick."""


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
    """Apply backlash, gain, saturation, rate limit, two lags and a resonance to a command.

    `wanted` is the delayed command and `out` the position, written, m, shape (steps,). `play` is
    half the backlash, `rate` the largest change per step, m. `shares` are those of the remaining
    distance that the two lags cover per step, 1 for none. `second` is the transition of the
    resonance, [place, speed, input] → [place, speed], shape (2, 3), or (0, 3) for none.
    """
    passed = wanted[0]
    limited = min(max(gain * passed + offset, -limit), limit)
    first_lag = second_lag_output = before = limited
    place, speed = limited, 0.0
    for step in range(len(wanted)):
        # Backlash (play operator): the output moves only once the input has crossed the gap.
        passed = min(max(passed, wanted[step] - play), wanted[step] + play)
        aim = min(max(gain * passed + offset, -limit), limit)
        limited += min(max(aim - limited, -rate), rate)
        # A lag sees the mean of its input over the step, which keeps it second order.
        seen = 0.5 * (before + limited)
        before = limited
        if shares[0] < 1.0:
            earlier = first_lag
            first_lag += shares[0] * (seen - first_lag)
            seen = 0.5 * (earlier + first_lag)
        else:
            first_lag = limited
        earlier = second_lag_output
        if shares[1] < 1.0:
            second_lag_output += shares[1] * (seen - second_lag_output)
        else:
            second_lag_output = first_lag
        if second.shape[0]:
            seen = 0.5 * (earlier + second_lag_output)
            place, speed = (
                second[0, 0] * place + second[0, 1] * speed + second[0, 2] * seen,
                second[1, 0] * place + second[1, 1] * speed + second[1, 2] * seen,
            )
            out[step] = place
        else:
            out[step] = second_lag_output


def follow_command(
    actuator: PositionActuator, command: Array, late: float, period: float, steps: int
) -> Array:
    """Return the position of a position actuator under a command.

    Order of operations: limits of the command, delay, backlash, gain and offset, saturation, rate
    limit, first and second lag (T·y' = u − y), resonance (y'' + 2ζω·y' + ω²·y = ω²·u).

    Parameters
    ----------
    actuator
        Parameters of the actuator.
    command
        Command, m, shape (ticks,).
    late
        Additional delay of the computer, s.
    period
        Time from tick to tick, s.
    steps
        Integration steps per tick.

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
    # A resonance above a quarter of the step frequency is beyond what the steps resolve.
    second = np.zeros((0, 3))
    if actuator.natural_frequency < 0.25 / h:
        w = 2.0 * math.pi * actuator.natural_frequency
        both = np.array(
            [[0.0, 1.0, 0.0], [-w * w, -2.0 * actuator.damping_ratio * w, w * w], [0.0, 0.0, 0.0]]
        )
        # Exact discretisation with the input held over the step: exp of the augmented matrix.
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
