"""Noise of a hybrid test's measurements and commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.rths.building import (
    PERIOD,
)
from rigtwin.numerics.arrays import Array

HELD = 2e-4
"""Time for which a value of the noise is held, s."""


@dataclass(frozen=True)
class Noise:
    """White noise of the converters.

    Attributes
    ----------
    position, force : float
        Noise of the position and of the force channel, V rms.
    """

    position: float
    force: float


BENCHMARK = Noise(2e-3, 2e-3)
"""Noise of the benchmark's problem statement."""
NONE = Noise(0.0, 0.0)


def draw_noise(noise: Noise, ticks: int, seed: int) -> Array:
    """Return the noise of position and force, V, shape (2, ticks), each value held for `HELD`."""
    # An independent random stream: noise and plants do not share random numbers.
    random = np.random.default_rng([seed, 3])
    # The noise of the real converters is band-limited: one value holds for `HELD`.
    index = (np.arange(ticks) * PERIOD / HELD).astype(int)
    drawn = random.standard_normal((2, int(index[-1]) + 1))
    return drawn[:, index] * np.array([[noise.position], [noise.force]])
