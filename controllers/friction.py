"""Compensation of the motor's dry friction: when it changes its sign the motor is told to push that
much more or less.

The thesis' own (§4.5, §4.6): a window is open while the velocity is about to cross zero; within it
a force error that has risen for some samples is a friction spike; then the force added against
friction changes its sign, at most once per buffer time. Two steps: twice as much at first, half of
it taken back when the error has fallen. Another, which needs no velocity: an observer of the
friction force, see `observed`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controllers.compiled import compilable
from controllers.filters import low_pass
from controllers.settings import Compensator, Settings

HISTORY = 17
"""Filtered velocities kept, of which every eighth is used."""
SPACING = 8
ERRORS = 6
"""Force errors kept: five gradients, thesis Fig. 4.7."""
FIRST_STEP = 2.0
"""Of the two-step compensation, in friction jumps: 0.3 V of 0.15 V, thesis §4.6."""
MOTOR_LAG = 1.26e-3
"""s; time constant of the motor's current loop, from its data sheet."""
MAINS = 50.0
"""Hz; thesis §3.4."""

Velocities = tuple[float, ...]
"""HISTORY numbers, the newest first."""
Errors = tuple[float, ...]
"""ERRORS numbers, the newest first."""


class Compensation(NamedTuple):
    """What the compensator remembers. Times in s, forces in N, velocity m/s; directions are +1, −1,
    or 0 for none.

    The thesis' compensator alone uses what stands before `added`, the observer alone what stands
    behind it.
    """

    travel: float = math.nan
    """The last sample of the suspension travel; not a number before the first."""
    velocity: float = 0.0
    acceleration: float = 0.0
    window: float = 0.0
    """Direction of the motion expected after the crossing."""
    open_for: float = 0.0
    wait: float = 0.0
    """Until the next step may come."""
    pending: float = 0.0
    """Force that the second step takes back."""
    added: float = 0.0
    """Force added to what the motor is told."""
    motor: float = 0.0
    """Force of the motor by its model."""
    friction: float = 0.0
    notch_in: float = 0.0
    notch_before: float = 0.0
    notch_out: float = 0.0
    notch_last: float = 0.0


REST = Compensation()
# Compiled code takes neither defaults nor `_replace`, but slices whose ends are constants.
ADDED = Compensation._fields.index("added")
MOTOR = Compensation._fields.index("motor")
BEHIND_MOTOR = MOTOR + 1
NO_STEPS = (0.0,) * ADDED
"""The memory of the thesis' compensator while the observer is at work."""
NO_VELOCITIES: Velocities = (0.0,) * HISTORY
NO_ERRORS: Errors = (0.0,) * ERRORS


@compilable
def _sign(value: float) -> float:
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


@compilable
def _crossing(velocity: float, acceleration: float, horizon: float) -> float:
    """Rule 1: direction after a crossing that is at most `horizon` (s) ahead at constant
    acceleration, else 0."""
    if velocity * acceleration >= 0.0:
        return 0.0
    return -_sign(velocity) if -velocity / acceleration < horizon else 0.0


@compilable
def expected(settings: Settings, velocities: Velocities, filtered: float, period: float) -> float:
    """The direction of motion that is about to begin, of two estimates of the acceleration: a
    parabola through three filtered velocities carried forward, which leads, and the filtered
    derivative, which lags and is quieter (thesis §4.5.1)."""
    now, before, earlier = velocities[0], velocities[SPACING], velocities[2 * SPACING]
    span = SPACING * period
    bend = (now - 2.0 * before + earlier) / span**2
    slope = (3.0 * now - 4.0 * before + earlier) / (
        2.0 * span
    ) + settings.crossing_prediction * bend
    leading = _crossing(now, slope, settings.crossing_time)
    return leading if leading != 0.0 else _crossing(now, filtered, settings.crossing_time)


@compilable
def risen(settings: Settings, errors: Errors, direction: float, period: float) -> bool:
    """Rule 2: whether the error rose towards `direction` over the last samples, the first of them
    by anything."""
    least = settings.spike_gradient * period
    samples = int(settings.spike_samples)
    for number in range(samples):
        gradient = direction * (errors[number] - errors[number + 1])
        if gradient < (0.0 if number == samples - 1 and samples > 1 else least):
            return False
    return True


@compilable
def _spike(settings: Settings, window: float, errors: Errors, period: float) -> float:
    """Direction of the friction spike that is seen now, else 0. A positive error is a force too
    small: friction has risen."""
    kind = settings.compensator
    direction = _sign(errors[0])
    if abs(errors[0]) < settings.spike_threshold:
        return 0.0
    if kind == Compensator.FORCE_THRESHOLD:
        return direction
    if not risen(settings, errors, direction, period):
        return 0.0
    if kind == Compensator.FORCE_PROFILE:
        return direction
    return direction if direction == window else 0.0


@compilable
def stepped(
    settings: Settings,
    state: Compensation,
    velocities: Velocities,
    errors: Errors,
    travel: float,
    error: float,
    period: float,
) -> tuple[Compensation, Velocities, Errors]:
    """One tick of the thesis' compensator. travel: of the motor, raw, m; error: force demanded less
    force filtered, N."""
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
    window, open_for = state.window, state.open_for - period
    coming = expected(settings, velocities, acceleration, period)
    if coming != 0.0:
        window, open_for = coming, settings.crossing_extension
    elif open_for <= 0.0:
        window = 0.0
    wait, pending = state.wait - period, state.pending
    level = state.added - pending
    if pending * error < abs(pending) * settings.spike_threshold:
        # The error has fallen below the threshold again: the second step.
        pending = 0.0
    spike = _spike(settings, window, errors, period) if wait <= 0.0 else 0.0
    # Friction cannot rise twice running, so a second spike to the same side makes no step.
    jump = 0.5 * settings.friction_step * spike - level if spike != 0.0 else 0.0
    if jump != 0.0:
        wait = settings.compensation_buffer
        level += jump
        pending = (FIRST_STEP - 1.0) * jump if settings.compensator == Compensator.TWO_STEP else 0.0
    added = level + pending
    steps: Any = (travel, velocity, acceleration, window, open_for, wait, pending, added)
    return Compensation(*(steps + REST[MOTOR:])), velocities, errors


@compilable
def observed(settings: Settings, state: Compensation, sample: float, period: float) -> Compensation:
    """One tick of the observer. sample: of the load cell, raw, N. Friction is what the motor's
    model pushes less what the load cell feels, the mains' hum taken out by a narrow notch.

    While friction is steady that difference is mostly noise and is filtered with `observer_lag`;
    but one that is off by more than `observer_gate` is no noise: friction has changed its sign, and
    it is believed at once. What is added leads by the motor's lag, so that the motor's force has
    changed as much one tick later.
    """
    residual = state.motor - sample
    if math.isnan(state.travel):
        return Compensation(*(NO_STEPS + (0.0, sample) + REST[BEHIND_MOTOR:]))  # noqa: RUF005
    clean = residual
    if settings.observer_notch > 0.0:
        turn = 2.0 * math.cos(2.0 * math.pi * MAINS * period)
        radius = 1.0 - math.pi * settings.observer_notch * period
        scale = (1.0 - radius * turn + radius**2) / (2.0 - turn)
        clean = scale * (residual - turn * state.notch_in + state.notch_before)
        clean += radius * turn * state.notch_out - radius**2 * state.notch_last
    friction = clean
    if abs(clean - state.friction) < settings.observer_gate:
        friction = low_pass(state.friction, clean, settings.observer_lag, period)
    stays = math.exp(-period / MOTOR_LAG)
    added = friction + (friction - state.friction) * stays / (1.0 - stays)
    notch = (residual, state.notch_in, clean, state.notch_out)
    observer: Any = (added, state.motor, friction) + notch  # noqa: RUF005
    return Compensation(*(NO_STEPS + observer))


@compilable
def pushed(state: Compensation, force: float, period: float) -> Compensation:
    """The memory with the motor's model one tick on. force: what the motor is told to push, N."""
    stays = math.exp(-period / MOTOR_LAG)
    motor = stays * state.motor + (1.0 - stays) * force
    return Compensation(*(state[:MOTOR] + (motor,) + state[BEHIND_MOTOR:]))  # noqa: RUF005
