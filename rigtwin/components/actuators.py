"""Parameters of a described machine's actuators.

Units are those of a sliding joint; for a turning joint, read rad for m and Nm for N. The law from
command to force is in `conditioning`, that from command to position in `models.following`.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.quantity import MJCF, NONE, UNLIMITED, Quantity


class ForceActuator(NamedTuple):
    """Actuator whose command becomes a force.

    Order of operations: limits of the command, delay, deadband, gain, saturation, rate limit, lag,
    `constant`, limit of the force. With the upper sign for positive commands u:

        effective gain     = gain·(1 ± ½·gain_asymmetry)·(1 − c + c·|u|/full_command)
        effective deadband = deadband ± ½·deadband_asymmetry

    with the curvature c. The thrust of a propeller grows with the square of its command: c = 1.
    """

    # Static law and limits, read from the MJCF: force = constant · conditioned command.
    constant: Annotated[float, Quantity("N/unit of the command", -1e9, 1e9, MJCF)] = 1.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, MJCF)] = UNLIMITED
    command_low: Annotated[
        float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)
    ] = -UNLIMITED
    command_high: Annotated[float, Quantity("unit of the command", -UNLIMITED, UNLIMITED, MJCF)] = (
        UNLIMITED
    )
    # Conditioning of the command; neutral in the nominal machine.
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    gain_asymmetry: Annotated[float, Quantity("1", -2.0, 2.0, NONE)] = 0.0
    curvature: Annotated[float, Quantity("1", -1.0, 1.5, NONE)] = 0.0
    full_command: Annotated[
        float, Quantity("unit of the command", 1e-9, UNLIMITED, "1: of a normalised command")
    ] = 1.0
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
    # Play between motor and joint, whose position is measured.
    backlash: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    rotor_share: Annotated[float, Quantity("1", 0.005, 0.995, "0.5: as much as the joint")] = 0.5
    rotor_friction: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    play_compliance: Annotated[float, Quantity("m/N", 0.0, 1e3, NONE)] = 0.0


class PositionActuator(NamedTuple):
    """Actuator whose command becomes a position, whatever force resists it.

    Order of operations: limits of the command, delay, deadband (a backlash), gain and offset,
    saturation, rate limit, first and second lag, resonance. Without any effect it follows its
    command at once.
    """

    # Limits of the command, read from the MJCF.
    command_low: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = -UNLIMITED
    command_high: Annotated[float, Quantity("m", -UNLIMITED, UNLIMITED, MJCF)] = UNLIMITED
    # Static response: gain · command + offset.
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: follows its command at rest")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, NONE)] = 0.0
    # Dynamics: 1/(T1·s + 1) · 1/(T2·s + 1) · ω²/(s² + 2ζω·s + ω²).
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    second_lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    natural_frequency: Annotated[float, Quantity("Hz", 1e-3, UNLIMITED, NONE)] = UNLIMITED
    damping_ratio: Annotated[float, Quantity("1", 0.005, 1.0, NONE)] = 0.7
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 100.0, NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-9, UNLIMITED, NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("m/s", 1e-9, UNLIMITED, NONE)] = UNLIMITED
