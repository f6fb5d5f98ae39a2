"""Compensation of the motor's dry friction by a force that changes its sign with the friction.

The compensator of the thesis (§4.5, §4.6) opens a window while the velocity is about to cross zero.
Within the window, a force error that has risen for some samples counts as a friction spike. The
added force then changes its sign, at most once per buffer time. With two steps, the change is twice
as large at first, and half of it is taken back when the error has fallen.

An alternative needs no velocity: an observer of the friction force, see `observe_friction`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controllers.compiled import compilable
from controllers.filters import low_pass
from controllers.settings import Compensator, Settings

HISTORY = 17
"""Number of stored filtered velocities."""
SPACING = 8
"""Ticks between the velocities that are used."""
ERRORS = 6
"""Number of stored force errors: five gradients (thesis Fig. 4.7)."""
FIRST_STEP = 2.0
"""First step of the two-step compensation, in friction jumps: 0.3 V to 0.15 V (thesis §4.6)."""
MOTOR_LAG = 1.26e-3
"""Time constant of the motor's current loop, s, from its data sheet."""
MAINS = 50.0
"""Mains frequency, Hz (thesis §3.4)."""

Velocities = tuple[float, ...]
"""Tuple of `HISTORY` velocities, m/s, newest first."""
Errors = tuple[float, ...]
"""Tuple of `ERRORS` force errors, N, newest first."""


class Compensation(NamedTuple):
    """Memory of the compensator, in s, N and m/s; directions are +1, −1, or 0 for none.

    The thesis' compensator uses the fields up to `added`, the observer `added` and those after it.
    """

    travel: float = math.nan
    """Last sample of the suspension travel, m; NaN before the first."""
    velocity: float = 0.0
    acceleration: float = 0.0
    window: float = 0.0
    """Direction of the motion expected after the crossing."""
    open_for: float = 0.0
    """Remaining time of the window, s."""
    wait: float = 0.0
    """Time until the next step is allowed, s."""
    pending: float = 0.0
    """Force that the second step will take back, N."""
    added: float = 0.0
    """Force added to the command of the motor, N."""
    motor: float = 0.0
    """Force of the motor by its model, N."""
    friction: float = 0.0
    """Estimated friction, N."""
    notch_in: float = 0.0
    notch_before: float = 0.0
    notch_out: float = 0.0
    notch_last: float = 0.0


REST = Compensation()
# Compiled code supports neither defaults nor `_replace`, but slices with constant ends.
ADDED = Compensation._fields.index("added")
MOTOR = Compensation._fields.index("motor")
BEHIND_MOTOR = MOTOR + 1
NO_STEPS = (0.0,) * ADDED
"""Memory of the thesis' compensator while the observer runs."""
NO_VELOCITIES: Velocities = (0.0,) * HISTORY
NO_ERRORS: Errors = (0.0,) * ERRORS


@compilable
def _sign(value: float) -> float:
    """Return 1, −1, or 0 for 0."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


@compilable
def _crossing(velocity: float, acceleration: float, horizon: float) -> float:
    """Return the direction after a zero crossing within `horizon`, s, else 0 (rule 1).

    The crossing is extrapolated with constant acceleration: t = −v/a.
    """
    # The velocity crosses zero only if the acceleration is against it.
    if velocity * acceleration >= 0.0:
        return 0.0
    return -_sign(velocity) if -velocity / acceleration < horizon else 0.0


@compilable
def expected_direction(
    settings: Settings, velocities: Velocities, filtered: float, period: float
) -> float:
    """Return the direction of the motion after the next crossing, or 0 (thesis §4.5.1).

    Two estimates of the acceleration are used: a parabola through three filtered velocities,
    carried forward, which leads, and the filtered derivative, which lags and is quieter.
    """
    now, middle, oldest = velocities[0], velocities[SPACING], velocities[2 * SPACING]
    span = SPACING * period
    # Second and first derivative of the parabola at its newest point.
    curvature = (now - 2.0 * middle + oldest) / span**2
    slope = (3.0 * now - 4.0 * middle + oldest) / (
        2.0 * span
    ) + settings.crossing_prediction * curvature
    leading = _crossing(now, slope, settings.crossing_time)
    return leading if leading != 0.0 else _crossing(now, filtered, settings.crossing_time)


@compilable
def error_has_risen(settings: Settings, errors: Errors, direction: float, period: float) -> bool:
    """Return whether the error rose towards `direction` over the last samples (rule 2).

    The oldest gradient needs only the right sign: the spike may begin within that sample.
    """
    least = settings.spike_gradient * period
    samples = int(settings.spike_samples)
    for number in range(samples):
        gradient = direction * (errors[number] - errors[number + 1])
        if gradient < (0.0 if number == samples - 1 and samples > 1 else least):
            return False
    return True


@compilable
def _spike(settings: Settings, window: float, errors: Errors, period: float) -> float:
    """Return the direction of a friction spike in the present error, else 0.

    A positive error means that the force is too small: the friction has risen.
    """
    kind = settings.compensator
    direction = _sign(errors[0])
    if abs(errors[0]) < settings.spike_threshold:
        return 0.0
    # This one needs neither the window nor the history of the error.
    if kind == Compensator.FORCE_THRESHOLD:
        return direction
    if not error_has_risen(settings, errors, direction, period):
        return 0.0
    if kind == Compensator.FORCE_PROFILE:
        return direction
    # With a window, the spike has to point the way in which the motion is about to reverse.
    return direction if direction == window else 0.0


@compilable
def step_compensator(
    settings: Settings,
    state: Compensation,
    velocities: Velocities,
    errors: Errors,
    travel: float,
    error: float,
    period: float,
) -> tuple[Compensation, Velocities, Errors]:
    """Return the memories after one tick of the thesis' compensator.

    travel: raw travel of the motor, m; error: demanded minus filtered force, N; period: s.
    """
    # Without a previous sample there is no difference to filter.
    velocity, acceleration = 0.0, 0.0
    if not math.isnan(state.travel):
        velocity = low_pass(
            state.velocity, (travel - state.travel) / period, settings.filter_velocity, period
        )
        acceleration = low_pass(
            state.acceleration,
            (velocity - state.velocity) / period,
            settings.filter_acceleration,
            period,
        )
    velocities = (velocity,) + velocities[:-1]  # noqa: RUF005, compiled code does not unpack
    errors = (error,) + errors[:-1]  # noqa: RUF005
    # The window stays open for a while after the last prediction of a crossing.
    window, open_for = state.window, state.open_for - period
    coming = expected_direction(settings, velocities, acceleration, period)
    if coming != 0.0:
        window, open_for = coming, settings.crossing_extension
    elif open_for <= 0.0:
        window = 0.0
    wait, pending = state.wait - period, state.pending
    # What stays once the second step is made: half a friction jump to either side.
    level = state.added - pending
    if pending * error < abs(pending) * settings.spike_threshold:
        # The error is below the threshold again: make the second step.
        pending = 0.0
    spike = _spike(settings, window, errors, period) if wait <= 0.0 else 0.0
    # Friction cannot rise twice in a row, so a second spike in the same direction makes no step.
    jump = 0.5 * settings.friction_step * spike - level if spike != 0.0 else 0.0
    if jump != 0.0:
        wait = settings.compensation_buffer
        level += jump
        pending = (FIRST_STEP - 1.0) * jump if settings.compensator == Compensator.TWO_STEP else 0.0
    added = level + pending
    steps: Any = (travel, velocity, acceleration, window, open_for, wait, pending, added)
    return Compensation(*(steps + REST[MOTOR:])), velocities, errors


@compilable
def observe_friction(
    settings: Settings, state: Compensation, sample: float, period: float
) -> Compensation:
    """Return the memory after one tick of the friction observer; sample: raw load cell, N.

    Friction is the force of the motor's model minus that of the load cell. A narrow notch removes
    the hum of the mains. While the friction is steady the difference is mostly noise and is
    filtered with `observer_lag`. A deviation beyond `observer_gate` is no noise: the friction has
    changed its sign, and the observer follows at once.

    The added force leads by the lag of the motor, so the motor's force has changed by the friction
    one tick later.
    """
    residual = state.motor - sample
    if math.isnan(state.travel):
        return Compensation(*(NO_STEPS + (0.0, sample) + REST[BEHIND_MOTOR:]))  # noqa: RUF005
    notched = residual
    if settings.observer_notch > 0.0:
        # Notch (z² − 2 cos ω T z + 1)/(z² − 2 r cos ω T z + r²), scaled to gain 1 at rest.
        cosine = 2.0 * math.cos(2.0 * math.pi * MAINS * period)
        # Pole radius of a notch whose −3 dB width is `observer_notch`, Hz, if it is narrow.
        radius = 1.0 - math.pi * settings.observer_notch * period
        scale = (1.0 - radius * cosine + radius**2) / (2.0 - cosine)
        notched = scale * (residual - cosine * state.notch_in + state.notch_before)
        notched += radius * cosine * state.notch_out - radius**2 * state.notch_last
    friction = notched
    if abs(notched - state.friction) < settings.observer_gate:
        friction = low_pass(state.friction, notched, settings.observer_lag, period)
    decay = math.exp(-period / MOTOR_LAG)
    # Inverse of the motor's sampled lag: m⁺ = s m + (1 − s) u solved for u.
    added = friction + (friction - state.friction) * decay / (1.0 - decay)
    notch = (residual, state.notch_in, notched, state.notch_out)
    observer: Any = (added, state.motor, friction) + notch  # noqa: RUF005
    return Compensation(*(NO_STEPS + observer))


@compilable
def advance_motor_model(state: Compensation, force: float, period: float) -> Compensation:
    """Return the memory with the motor's model advanced by a tick; force: commanded, N."""
    decay = math.exp(-period / MOTOR_LAG)
    # Exact for a force held over the tick: the amplifier's command is.
    motor = decay * state.motor + (1.0 - decay) * force
    return Compensation(*(state[:MOTOR] + (motor,) + state[BEHIND_MOTOR:]))  # noqa: RUF005
