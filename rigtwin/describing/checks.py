"""Checks of a log against the model: forces by inverse dynamics, commands by what follows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from rigtwin.description.mechanism import Mechanism
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import white_noise

LARGEST = 1e100
"""Largest force that is compared with the model's; the square of a larger one overflows."""
SAMPLES = 2000
"""Rows at which inverse dynamics are worked out."""
CORNER = 8.0
"""Hz; motions are smoothed before they are differentiated."""
EDGE = 0.05
"""Share of the rows at either end that does not count."""
MOVING = 0.2
"""Share of the highest speed from which a joint moves."""
MAGNITUDE_REVERSALS = 4
"""Reversals of a joint after which a force that never changes its sign is a magnitude."""
POWER, HARMONICS = 0.9, 8.0
"""Share of the power of a joint's speed, and the multiple of the frequency below which that lies:
dry friction has the odd harmonics of a motion."""
STANDS_OUT = 3.0
"""Ratio of a spectrum to that of the noise from which it is motion: single lines of noise vary."""
LOWEST_BAND, HIGHEST_BAND = 5.0, 150.0
"""Hz, bounds of a band."""


@dataclass(frozen=True)
class Slope:
    """Regression of a measured force on that of the model and on friction.

    Parameters
    ----------
    slope
        Measured force for each unit of the model's.
    explained
        Share of the measured force's variance, friction set aside, that the model explains.
    """

    slope: float
    explained: float


def is_magnitude(force: Array, position: Array) -> bool:
    """Return whether a force has no sign: never below zero, zero at times, the joint reversing.

    Parameters
    ----------
    force, position
        Shape (rows,).
    """
    for values in (force, -force):
        low, high = float(np.min(values)), float(np.max(values))
        # A force with a sign crosses zero where the joint turns back; a magnitude only touches it.
        if high > 0.0 and low == 0.0 and _reversals(position) >= MAGNITUDE_REVERSALS:
            return True
    return False


def unforced_share(force: Array, position: Array) -> float:
    """Return the share of a joint's motion in which its force is zero, as after a push by hand.

    Parameters
    ----------
    force, position
        Shape (rows,).
    """
    reach = max(len(position) // 200, 1)
    speed = np.abs(position[2 * reach :] - position[: -2 * reach])
    moving = speed > MOVING * np.max(speed)
    return float(np.mean(force[reach:-reach][moving] == 0.0)) if moving.any() else 0.0


def _reversals(position: Array) -> int:
    """Times that a position turns back by more than a tenth of its stroke."""
    step = 0.1 * float(np.ptp(position))
    if step == 0.0:
        return 0
    count, extreme, up = 0, float(position[0]), True
    # The loop runs in Python; 4000 samples are enough for the reversals of a test.
    for value in position[:: max(1, len(position) // 4000)]:
        value = float(value)
        # Hysteresis of a tenth of the stroke: the noise of a resting joint is no reversal.
        if (value > extreme) == up and value != extreme:
            extreme = value
        elif abs(value - extreme) > step:
            count, extreme, up = count + 1, value, not up
    return count


def follows(command: Array, position: Array) -> float:
    """Return the correlation of a command and of the position that follows it.

    Parameters
    ----------
    command, position
        Shape (rows,).
    """
    if np.ptp(command) == 0.0 or np.ptp(position) == 0.0:
        return 0.0
    return float(np.corrcoef(command, position)[0, 1])


def motion_band(time: Array, positions: Mapping[str, Array]) -> float:
    """Return the frequency up to which forces are worth judging, Hz.

    It is a multiple of the frequency below which most power of the joints' speeds lies, in the
    median of the joints.

    Parameters
    ----------
    time
        s, shape (rows,).
    positions
        Joint → position, SI, shape (rows,).
    """
    from scipy.signal import welch  # Late: it takes a second.

    steps = np.diff(time)
    # A log may repeat a time stamp. Such rows have no step.
    step = float(np.median(steps[steps > 0.0]))
    ticks = np.arange(time[0], time[-1], step)
    frequencies = []
    for values in positions.values():
        speed = np.gradient(np.interp(ticks, time, values), step)
        # Segments of 4 s resolve 0.25 Hz, below the motions of a test.
        length = min(len(speed), max(int(4.0 / step), 8))
        frequency, power = welch(speed, 1.0 / step, nperseg=length)
        # White noise σ of the position has the one-sided density 2 σ² Δt; the central difference
        # multiplies it by (sin(2πf Δt) / Δt)².
        noise = 2.0 * white_noise(values) ** 2 * step
        carried = noise * (np.sin(2.0 * np.pi * frequency * step) / step) ** 2
        power = np.where(power > STANDS_OUT * carried, power - carried, 0.0)
        if np.sum(power) > 0.0:
            share = np.cumsum(power) / np.sum(power)
            frequencies.append(float(frequency[int(np.searchsorted(share, POWER))]))
    band = HARMONICS * float(np.median(frequencies)) if frequencies else HIGHEST_BAND
    # Two digits: the description that this goes into is for people to edit.
    return float(f"{min(max(band, LOWEST_BAND), HIGHEST_BAND):.2g}")


def force_slopes(
    mechanism: Mechanism, time: Array, positions: Mapping[str, Array], forces: Mapping[str, Array]
) -> dict[str, Slope]:
    """Hold measured forces against the model's inverse dynamics.

    Each measured force is regressed on τ(q, q̇, q̈) of the model, on the sign of the speed, on the
    speed and on a constant.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    time
        s, shape (rows,).
    positions
        Joint → position, SI, shape (rows,). Other joints stay where the model has them.
    forces
        Joint → force, SI, shape (rows,).

    Returns
    -------
    dict
        Joint → regression; without joints whose regression is not possible.
    """
    from scipy.signal import butter, sosfiltfilt  # Late, as above.

    ticks = np.linspace(time[0], time[-1], min(len(time), 20 * SAMPLES))
    step = float(ticks[1] - ticks[0])
    if len(ticks) < 200 or step <= 0.0:
        return {}
    # Zero-phase (forward and backward), or the filter's delay would look like friction. The corner
    # is relative to the Nyquist frequency.
    smooth = butter(4, min(2.0 * CORNER * step, 0.9), output="sos")
    places, speeds, rates = {}, {}, {}
    for joint, values in positions.items():
        places[joint] = sosfiltfilt(smooth, np.interp(ticks, time, values))
        speeds[joint] = np.gradient(places[joint], step)
        rates[joint] = np.gradient(speeds[joint], step)
    # Derivatives near the ends depend on how the filter pads the signal.
    rows = np.unique(np.linspace(EDGE * len(ticks), (1.0 - EDGE) * len(ticks), SAMPLES).astype(int))
    needed = _inverse(mechanism, places, speeds, rates, rows)
    slopes = {}
    for joint, force in forces.items():
        measured = sosfiltfilt(smooth, np.interp(ticks, time, force))[rows]
        speed = speeds[joint][rows]
        if (slope := _regress(measured, needed[joint], speed)) is not None:
            slopes[joint] = slope
    return slopes


def _inverse(
    mechanism: Mechanism,
    places: Mapping[str, Array],
    speeds: Mapping[str, Array],
    rates: Mapping[str, Array],
    rows: Sequence[int] | Array,
) -> dict[str, Array]:
    """Forces that the model needs for a motion, contacts and limits apart, joint by joint."""
    model = mechanism.model
    data = mujoco.MjData(model)
    numbers = {joint: mechanism.number("joint", joint) for joint in places}
    needed: dict[str, Array] = {joint: np.zeros(len(rows)) for joint in places}
    flags = int(model.opt.disableflags)
    # Measured forces contain no force of MuJoCo's contacts and limits, whose penetration a log
    # cannot show.
    model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    try:
        for at, row in enumerate(rows):
            for joint, number in numbers.items():
                place, speed = int(model.jnt_qposadr[number]), int(model.jnt_dofadr[number])
                data.qpos[place] = places[joint][row]
                data.qvel[speed] = speeds[joint][row]
                data.qacc[speed] = rates[joint][row]
            mujoco.mj_inverse(model, data)
            for joint, number in numbers.items():
                needed[joint][at] = data.qfrc_inverse[int(model.jnt_dofadr[number])]
    finally:
        model.opt.disableflags = flags
    return needed


def _regress(measured: Array, needed: Array, speed: Array) -> Slope | None:
    """Slope of a measured force against that of the model, friction set aside."""
    if float(np.abs(measured).max()) > LARGEST:
        return None
    scale = float(np.std(speed))
    if scale == 0.0 or np.std(measured) == 0.0 or np.std(needed) == 0.0:
        return None
    # tanh in place of the sign: a measured speed is never exactly zero. Both sides are freed of
    # these columns, so the slope is that of the partial regression.
    friction = np.column_stack([np.tanh(speed / (0.1 * scale)), speed / scale, np.ones(len(speed))])
    residual, model = (
        values - friction @ np.linalg.lstsq(friction, values, rcond=None)[0]
        for values in (measured, needed)
    )
    power = float(model @ model)
    # The columns of friction explain the model's force too: no slope can be told.
    if power <= 1e-12 * float(needed @ needed):
        return None
    slope = float(residual @ model) / power
    explained = slope**2 * power / max(float(residual @ residual), 1e-300)
    return Slope(slope, min(explained, 1.0))
