"""A hydraulic cylinder under position control as one transfer function.

The twin's cylinder and the model in a delay compensator have these parameters in common.

    H(s) = (b2 s² + b1 s + b0) / (s⁴ + a3 s³ + a2 s² + a1 s + a0),   scaled to unit static gain
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.quantity import Quantity

Array = NDArray[np.float64]

H_OF_S = "identified closed loop H(s), thesis Eq. 6.2"
NONE = "none in the nominal machine"
B2 = Annotated[float, Quantity("1/s^2", -1e6, 1e6, H_OF_S)]
B1 = Annotated[float, Quantity("1/s^3", -1e8, 1e8, H_OF_S)]
B0 = Annotated[float, Quantity("1/s^4", 1.0, 1e10, H_OF_S)]
A3 = Annotated[float, Quantity("1/s", 0.0, 1e5, H_OF_S)]
A2 = Annotated[float, Quantity("1/s^2", 0.0, 1e8, H_OF_S)]
A1 = Annotated[float, Quantity("1/s^3", 0.0, 1e10, H_OF_S)]
A0 = Annotated[float, Quantity("1/s^4", 1.0, 1e10, H_OF_S)]
Gain = Annotated[float, Quantity("1", 0.1, 3.0, "1: follows its command at rest")]
Lag = Annotated[float, Quantity("s", 0.0, 0.5, NONE)]
LATE = Quantity("s", 0.0, 0.05, NONE)
Delay = Annotated[float, LATE]


class ClosedLoop(NamedTuple):
    """Gain, lag and delay before H(s). Defaults are those of the rig; units are in the types."""

    b2: B2 = 1817.0
    b1: B1 = 7.719e4
    b0: B0 = 6.243e5
    a3: A3 = 165.9
    a2: A2 = 6674.0
    a1: A1 = 8.598e4
    a0: A0 = 6.281e5
    gain: Gain = 1.0
    lag: Lag = 0.0
    delay: Delay = 0.0


NOMINAL = ClosedLoop()


def state_space(loop: ClosedLoop) -> tuple[Array, Array, Array]:
    """Return the controllable form A, (4, 4), B, (4,), and C, (4,), of H(s)/H(0) alone."""
    a = np.diag(np.ones(3), 1)
    a[3] = [-loop.a0, -loop.a1, -loop.a2, -loop.a3]
    b = np.array([0.0, 0.0, 0.0, 1.0])
    c = np.array([loop.b0, loop.b1, loop.b2, 0.0]) * (loop.a0 / loop.b0)
    return a, b, c


def with_lag(loop: ClosedLoop) -> tuple[Array, Array, Array]:
    """Return A, B and C of gain, lag and H(s), without the delay; the lag adds a fifth state."""
    inner, entry, out = state_space(loop)
    if loop.lag <= 0.0:
        return inner, entry * loop.gain, out
    a, b = np.zeros((5, 5)), np.zeros(5)
    a[:4, :4], a[:4, 4] = inner, entry
    a[4, 4], b[4] = -1.0 / loop.lag, loop.gain / loop.lag
    return a, b, np.append(out, 0.0)


def transfer(loop: ClosedLoop) -> tuple[list[float], list[float]]:
    """Return numerator and denominator of gain, lag and H(s), highest power first.

    The delay is left out.
    """
    # Scaled to H(0) = 1: b0 and a0 are identified separately and differ by 0.6 %.
    scale = loop.gain * loop.a0 / loop.b0
    numerator = [scale * b for b in (loop.b2, loop.b1, loop.b0)]
    denominator = [1.0, loop.a3, loop.a2, loop.a1, loop.a0]
    if loop.lag > 0.0:
        denominator = np.convolve([loop.lag, 1.0], denominator).tolist()
    return numerator, denominator
