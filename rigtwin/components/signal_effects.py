"""Effects on commands and sensors."""

from __future__ import annotations

import math
from itertools import product

from rigtwin.components.actuators import ForceActuator, PositionActuator
from rigtwin.components.computer import Computer
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.effect import Context, Guess, Kind, Starts
from rigtwin.components.motor import Motor
from rigtwin.components.sensors import (
    DECLARED,
    ForceSensor,
    LoadCell,
    Lvdt,
    PositionSensor,
    VelocitySensor,
)
from rigtwin.components.servo import Servo, VelocityServo
from rigtwin.components.starts import at_limits, fixed_starts, late_or_early_starts, late_starts

ACTS_LATE = "the force acts later than it is recorded, as that of an actuator behind its command"
ECCENTRIC = Starts(tuple(product((0.01, 0.04), (-2.0, 0.0, 2.0))), (1e-3, 0.05))
"""Starts of amplitude and phase of an error once a turn, rad."""
BELOW = (0.95, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1)
"""Starting values of a lower limit, as shares of the known limit."""


def _speed_limit(context: Context) -> Starts:
    known = [share * context.component(Cylinder).speed_limit for share in BELOW]
    return at_limits([min(pair) for pair in zip(context.swing.fastest, known, strict=True)], 1e-6)


def _deadband(context: Context) -> Starts:
    placed = context.effect.of in (PositionActuator, Servo)
    size = context.scales.stroke if placed else max(context.swing.largest[0], 1e-12)
    return Starts.single([share * size for share in (0.003, 0.01, 0.03, 0.1, 0.3)], 0.001 * size)


def _uneven_deadband(context: Context) -> Starts:
    """Return starts of a deadband that lies on one side only."""
    size = max(context.swing.largest[0], 1e-12)
    starts = [
        (2.0 * sign * share * size, share * size)
        for share in (0.01, 0.03, 0.1, 0.3)
        for sign in (-1.0, 1.0)
    ]
    return Starts(tuple(starts), (0.001 * size, 0.001 * size))


def _curvature(context: Context) -> Starts:
    """Return starts of a curved characteristic that agrees with the straight one at a command."""
    full = max(context.swing.largest[0], 1e-12)
    starts = [
        (share, 1.0 / (1.0 - share + share * command / full), full)
        for share in (0.5, 1.0)
        for command in sorted({max(size, 0.1 * full) for size in context.swing.largest})
    ]
    # A step of 0 keeps the largest command at the value of the start.
    return Starts(tuple(starts), (0.01, 0.004, 0.0))


def _yielding(context: Context) -> Starts:
    # A plate's zero was set without load, or under about the load that it bears in the test.
    starts = tuple(product((2e-7, 1e-6, 5e-6), (0.0, 0.005), (0.0, context.scales.force)))
    return Starts(starts, (2e-8, 2e-4, 20.0))


def _offset(context: Context) -> Starts:
    sizes = {ForceSensor: context.scales.force, VelocitySensor: context.scales.speed}
    size = sizes.get(context.effect.of, context.scales.stroke)
    return Starts.single([share * size for share in (-0.2, -0.02, 0.02, 0.2)], 0.002 * size)


def _drift(context: Context) -> Starts:
    sizes = {ForceSensor: context.scales.force, VelocitySensor: context.scales.speed}
    size = sizes.get(context.effect.of, context.scales.stroke) / context.scales.time
    return Starts.single([share * size for share in (-2e-3, -2e-4, 2e-4, 2e-3)], 2e-5 * size)


def _two_lags(context: Context) -> Starts:
    time = context.scales.time
    sizes = [share * time for share in (0.005, 0.02, 0.06, 0.2)]
    starts = tuple((long, ratio * long) for long in sizes for ratio in (0.2, 0.7))
    return Starts(starts, (0.002 * time, 0.002 * time))


def _resonance(context: Context) -> Starts:
    # Natural frequencies are tried from about that of the motion upwards.
    slowest = 1.0 / (2.0 * math.pi * context.scales.time)
    speeds = [slowest * ratio for ratio in (1.5, 4.0, 10.0, 30.0, 80.0)]
    return Starts(tuple(product(speeds, (0.15, 0.5, 0.9))), (0.02 * slowest, 0.01))


def _for_types(guess: Guess | None, *types: type) -> dict[type, Guess | None]:
    """Return the same starts for several types of component; None: read off the signals."""
    return dict.fromkeys(types, guess)


RIG = (Motor, Cylinder, *DECLARED)
LIMITED_COMMANDS = (ForceActuator, VelocityServo, PositionActuator)
DESCRIBED_ACTUATORS = (*LIMITED_COMMANDS, Servo)
DESCRIBED_SENSORS = (PositionSensor, VelocitySensor, ForceSensor)
DESCRIBED = (*DESCRIBED_ACTUATORS, *DESCRIBED_SENSORS)
KINDS = (
    Kind(
        "gain",
        "gain",
        ("gain",),
        "output multiplied by this factor",
        _for_types(fixed_starts((0.8, 0.93, 1.07, 1.2), 0.004), *RIG, *DESCRIBED),
    ),
    Kind(
        "gain_asymmetry",
        "gain that differs by direction",
        ("gain_asymmetry",),
        "output greater for positive commands than for negative, by this share",
        _for_types(fixed_starts((-0.3, -0.07, 0.07, 0.3), 0.004), ForceActuator),
        "output smaller for positive commands than for negative, by this share",
    ),
    Kind(
        "curvature",
        "quadratic share",
        ("curvature", "gain", "full_command"),
        "a force of which this share, at the largest command, grows with the square of the command",
        {ForceActuator: _curvature},
        constants=("full_command",),
    ),
    Kind(
        "lag",
        "lag",
        ("lag",),
        "an additional first-order lag",
        _for_types(fixed_starts((5e-4, 2e-3, 6e-3, 2e-2, 5e-2), 1e-4), *RIG)
        | _for_types(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "delay",
        "delay",
        ("delay",),
        "an additional delay",
        _for_types(fixed_starts((5e-4, 2e-3, 5e-3, 1e-2, 2e-2), 1e-4), *RIG)
        | {Computer: fixed_starts((5e-4, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2), 1e-4)}
        | _for_types(late_starts, *DESCRIBED)
        | {ForceSensor: late_or_early_starts},
        ACTS_LATE,
    ),
    Kind(
        "saturation",
        "saturation",
        ("saturation",),
        "command limited to this magnitude",
        _for_types(lambda context: at_limits(context.swing.largest, 1e-6), Motor, Cylinder)
        | _for_types(lambda context: at_limits(context.swing.largest, 1e-9), *LIMITED_COMMANDS),
    ),
    Kind(
        "deadband",
        "deadband",
        ("deadband",),
        "command without effect within this band",
        {
            Motor: fixed_starts((0.02, 0.08, 0.3), 0.004),
            Cylinder: fixed_starts((1e-4, 5e-4, 2e-3, 6e-3), 2e-5),
            **_for_types(_deadband, *DESCRIBED_ACTUATORS),
        },
    ),
    Kind(
        "deadband_asymmetry",
        "deadband that differs by direction",
        ("deadband_asymmetry", "deadband"),
        "command without effect within a band that reaches further to positive commands",
        _for_types(_uneven_deadband, ForceActuator),
        "command without effect within a band that reaches further to negative commands",
    ),
    Kind(
        "rate_limit",
        "rate limit",
        ("rate_limit",),
        "command's rate limited",
        {
            Motor: lambda context: at_limits(context.swing.fastest, 1e-6),
            **_for_types(
                lambda context: at_limits(context.swing.fastest, 1e-9), *DESCRIBED_ACTUATORS
            ),
        },
    ),
    Kind("rate_limit", "rate limit", ("speed_limit",), "speed limited", {Cylinder: _speed_limit}),
    Kind(
        "compliance",
        "compliance",
        ("compliance", "yield_lag", "zero_load"),
        "yields under load, at once or a little later",
        {Cylinder: _yielding},
        nuisances=("zero_load",),
    ),
    Kind(
        "backlash",
        "backlash",
        ("backlash",),
        "a play between piston and plate",
        {Cylinder: fixed_starts((1e-4, 3e-4, 1e-3, 3e-3, 1e-2), 4e-5)},
    ),
    Kind(
        "two_lags",
        "pair of lags",
        ("lag", "second_lag"),
        "two first-order lags, one after the other",
        {PositionActuator: _two_lags},
    ),
    Kind(
        "resonance",
        "natural frequency",
        ("natural_frequency", "damping_ratio"),
        "follows as an underdamped system of second order",
        {PositionActuator: _resonance},
    ),
    Kind(
        "offset",
        "offset",
        ("offset",),
        "output displaced",
        {
            Lvdt: fixed_starts((-2e-3, -3e-4, 3e-4, 2e-3), 1e-5),
            LoadCell: fixed_starts((-20.0, -4.0, 4.0, 20.0), 0.1),
            **_for_types(_offset, *DESCRIBED_SENSORS, PositionActuator),
        },
    ),
    Kind(
        "drift",
        "drift",
        ("drift",),
        "zero that moves with time, each second",
        {
            Lvdt: fixed_starts((-2e-4, -3e-5, 3e-5, 2e-4), 2e-6),
            LoadCell: fixed_starts((-2.0, -0.3, 0.3, 2.0), 0.02),
            **_for_types(_drift, *DESCRIBED_SENSORS),
        },
    ),
    Kind(
        "eccentricity",
        "eccentricity",
        ("eccentricity", "phase"),
        "an error that repeats once a turn, as that of an encoder off its axis",
        {PositionSensor: lambda _: ECCENTRIC},
    ),
    Kind(
        "hum",
        "mains hum",
        ("hum",),
        "amplitude of the mains line",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "noise",
        "white noise",
        ("white",),
        "white noise, rms",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
    Kind(
        "quantisation",
        "quantisation",
        ("resolution",),
        "size of one bit",
        _for_types(None, *DECLARED, *DESCRIBED_SENSORS),
    ),
)
