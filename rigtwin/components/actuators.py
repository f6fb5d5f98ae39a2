"""Actuators of a described machine: parameters alone. Units are those of a joint that slides; of
one that turns, read rad for m and Nm for N. What becomes of a command is in `conditioning`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.quantity import MJCF, NONE, UNLIMITED, Quantity


class ForceActuator(NamedTuple):
    """Command to force: limits of the command, delay, deadband, gain, saturation, rate limit, lag,
    `constant`, then the limit of the force, in that order. The gain is larger by the share
    ½·gain_asymmetry of positive commands, and smaller of negative ones; the deadband reaches
    ½·deadband_asymmetry further to positive commands, and less far to negative ones."""

    constant: Annotated[float, Quantity("N/unit of the command", 1e-9, 1e9, MJCF)] = 1.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, MJCF)] = UNLIMITED
    command_low: Annotated[
        float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)
    ] = -UNLIMITED
    command_high: Annotated[float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)] = (
        UNLIMITED
    )
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    gain_asymmetry: Annotated[float, Quantity("1", -2.0, 2.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("unit of the command", 0.0, UNLIMITED, NONE)] = 0.0
    deadband_asymmetry: Annotated[
        float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, NONE)
    ] = 0.0
    saturation: Annotated[float, Quantity("unit of the command", 1e-9, UNLIMITED, NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("unit of the command/s", 1e-9, UNLIMITED, NONE)] = (
        UNLIMITED
    )


class PositionActuator(NamedTuple):
    """Command to position; without any effect it follows at once: limits of the command, delay,
    deadband (a play), gain and offset, saturation, rate limit, then lag and second lag, or a
    resonance."""

    command_low: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = -UNLIMITED
    command_high: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = UNLIMITED
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: follows its command at rest")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    second_lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    natural_frequency: Annotated[float, Quantity("Hz", 1e-3, UNLIMITED, NONE)] = UNLIMITED
    damping_ratio: Annotated[float, Quantity("1", 0.005, 1.0, NONE)] = 0.7
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-9, UNLIMITED, NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("m/s", 1e-9, UNLIMITED, NONE)] = UNLIMITED
