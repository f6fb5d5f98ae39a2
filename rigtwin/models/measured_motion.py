"""Motion of a joint by the sensor that measured it, and the friction that its error can show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigtwin.components import Guide
from rigtwin.components.dry_friction import friction, friction_size
from rigtwin.components.sensors import Sensor, remove_drift, undo_static
from rigtwin.numerics.arrays import Array

ENDS = 0.3
"""Time at both ends of a recording where the acceleration of a smoothed motion is uncertain, s."""
AT_REST = 4.0
"""Velocity, in its standard errors, up to which a joint may be at rest."""
SLOWEST = 1e-3
"""Share of the rms velocity up to which a joint may be at rest even if its motion was measured
without noise: smoothing leaves a small velocity where the motion stops."""
ELASTIC = 0.3
"""Shortest distance over which friction that reverses builds up, in errors of the measured motion.
Without it, friction would jump with the noise of the velocity's sign."""


def may_be_at_rest(
    velocity: Array, error: float, resolution: float, period: float
) -> NDArray[np.bool_]:
    """Return the ticks at or near which a joint may be at rest, as its measured motion shows it.

    At rest, dry friction may have any value within its limits, so that the motion does not
    determine the force. Nor does it shortly before and after a rest: smoothing spreads the jumps
    of the acceleration in time. A joint that never moves has no such ticks, as its rest is all
    that the recording shows.

    Parameters
    ----------
    velocity
        Velocity along the joint, m/s, shape (ticks,).
    error
        Standard error of the velocity, m/s.
    resolution
        Time over which smoothing spreads a jump of the acceleration, s. 0 where inertia has no
        part in the force.
    period
        Time from tick to tick, s.
    """
    from scipy.ndimage import binary_dilation  # Imported late: scipy is slow to load.

    typical = float(np.sqrt(np.mean(velocity**2)))
    if typical <= AT_REST * error:
        return np.zeros(len(velocity), np.bool_)
    stands = np.abs(velocity) <= max(AT_REST * error, SLOWEST * typical)
    reach = round(resolution / period)
    return np.asarray(binary_dilation(stands, np.ones(2 * reach + 1)), np.bool_)


def recover_motion(sensor: Sensor, measured: Array, period: float) -> Array:
    """Recover the true motion from a measured one that was smoothed.

    Inverts the law of the sensor (`components.sensors`), its first-order lag and its delay.

    Parameters
    ----------
    sensor
        Sensor whose errors are undone.
    measured
        Smoothed reading, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        True motion, shape (ticks,).
    """
    # A lag T is inverted by x = y + T·y', which needs a smooth signal.
    signal = measured
    if sensor.lag > 0.0:
        signal = signal + sensor.lag * np.gradient(signal, period)
    # Linear interpolation between ticks; a delay beyond the last tick repeats the last value.
    if sensor.delay != 0.0:
        ticks = np.arange(len(signal))
        signal = np.interp(ticks + sensor.delay / period, ticks, signal)
    return undo_static(sensor, remove_drift(sensor, signal, period))


def softest_contact(guide: Guide, load: Array, position: Array, error: float) -> float:
    """Return the compliance in series with dry friction along a measured motion, m/N.

    The error of the measured motion hides smaller ones: friction that reverses builds up over at
    least `ELASTIC` of it.

    Parameters
    ----------
    guide
        Guide with the friction.
    load
        Force that the guide transmits, N, shape (ticks,).
    position
        Position along the guide, m, shape (ticks,).
    error
        Standard error of the position, m.
    """
    size = max(friction_size(friction(guide), float(np.sqrt(np.mean(load**2)))), 1e-300)
    # A billionth of the stroke keeps the spring finite where the motion has no error.
    stroke = max(float(np.ptp(position)), 1e-12)
    return max(guide.compliance, ELASTIC * error / size, 1e-9 * stroke / size)
