"""Sizes of a recorded motion, by which the search for an effect is scaled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigtwin.numerics.arrays import Array

SHARES = (0.9999, 0.999, 0.98, 0.9, 0.75, 0.5, 0.3)
"""Quantiles of a command's magnitude and rate at which a search for a limit starts."""
TINY = 1e-12


@dataclass(frozen=True)
class Swing:
    """Magnitude and rate of a command, as quantiles.

    Attributes
    ----------
    largest : tuple of float
        Magnitudes below which the command stays for `SHARES` of the time, in its unit.
    fastest : tuple of float
        Rates below which it stays for `SHARES` of the time, unit/s.
    """

    largest: tuple[float, ...] = (0.0,) * len(SHARES)
    fastest: tuple[float, ...] = (0.0,) * len(SHARES)


@dataclass(frozen=True)
class Motion:
    """Motion of a component.

    Attributes
    ----------
    position, speed, force : Array
        Position, m, velocity, m/s, and force, N, shape (ticks,) each.
    """

    position: Array
    speed: Array
    force: Array


@dataclass(frozen=True)
class Scales:
    """Sizes of a component's motion, by which a search is scaled.

    Attributes
    ----------
    stroke : float
        Half the range of positions, m.
    span : tuple of float
        Lowest and highest position, m; as measured, where the position is.
    speed, acceleration, force : float
        rms values, m/s, m/s² and N.
    fastest : float
        Highest speed, m/s.
    period : float
        Time from tick to tick, s.
    pitches : tuple of float
        Pitches at which the unexplained force repeats along the stroke, m.
    """

    stroke: float
    span: tuple[float, float]
    speed: float
    fastest: float
    acceleration: float
    force: float
    period: float
    pitches: tuple[float, ...] = ()

    @property
    def time(self) -> float:
        """Characteristic time of the motion, stroke / speed, s."""
        return max(self.stroke / self.speed, self.period)

    @classmethod
    def of(
        cls, motion: Motion, force: float, period: float, measured: Array | None = None
    ) -> Scales:
        """Return the scales of a motion.

        Parameters
        ----------
        motion
            Motion of the component.
        force
            rms of the force measured there, N.
        period
            Time from tick to tick, s.
        measured
            Measured position, m, shape (ticks,), where there is any.
        """
        positions = motion.position if measured is None else measured
        rms = float(np.sqrt(np.mean(motion.force**2)))
        return cls(
            stroke=max(0.5 * float(np.ptp(motion.position)), TINY),
            span=(float(np.min(positions)), float(np.max(positions))),
            speed=max(float(np.sqrt(np.mean(motion.speed**2))), TINY),
            fastest=max(float(np.max(np.abs(motion.speed))), TINY),
            acceleration=max(float(np.std(np.gradient(motion.speed, period))), TINY),
            force=max(force, rms, TINY),
            period=period,
        )
