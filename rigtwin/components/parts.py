"""What any described machine is made of: one NamedTuple a sort of component, each value with its unit and bounds.

A description (`machines/*.toml`) gives components of these sorts their nominal values. Every other value is neutral, so that
an effect is nothing but another value of a parameter. Units are those of a joint that slides; of one that turns, read rad
for m and Nm for N.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.quantity import Quantity
from rigtwin.components.parameters import UNLIMITED

_NONE = "none unless the description says so"
_MJCF = "the MJCF, unless the description says otherwise"


class Mass(NamedTuple):
    """What moves."""

    mass: Annotated[float, Quantity("kg", 0.0, 1e6, _MJCF)] = 0.0


class Guide(NamedTuple):
    """Whatever acts between the moving part and the frame: a guide's friction, a damper, a spring.

    force = viscous·v ± ½·viscous_asymmetry·|v|, through a lag `relaxation`, + drag·v·|v| + stiffness·x + offset
    + cogging·sin(2π·x/cogging_pitch + cogging_phase) + dry friction. Dry friction acts through a play of `backlash` and a
    spring of `compliance` in series with it.
    """

    coulomb: Annotated[float, Quantity("N", 0.0, 1e7, _MJCF)] = 0.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e9, _MJCF)] = 0.0
    stiffness: Annotated[float, Quantity("N/m", 0.0, 1e12, _MJCF)] = 0.0
    stribeck: Annotated[float, Quantity("N", -1e7, 1e7, _NONE)] = 0.0
    stribeck_velocity: Annotated[float, Quantity("m/s", 1e-6, 100.0, "of the order seen in guides, assumed")] = 0.01
    asymmetry: Annotated[float, Quantity("N", -1e7, 1e7, _NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 10.0, _NONE)] = 0.0
    compliance: Annotated[float, Quantity("m/N", 0.0, 1.0, _NONE)] = 0.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, _NONE)] = 0.0
    viscous_asymmetry: Annotated[float, Quantity("Ns/m", -1e9, 1e9, _NONE)] = 0.0
    drag: Annotated[float, Quantity("Ns^2/m^2", -1e9, 1e9, _NONE)] = 0.0
    relaxation: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    cogging: Annotated[float, Quantity("N", 0.0, 1e7, _NONE)] = 0.0
    cogging_pitch: Annotated[float, Quantity("m", 1e-6, 100.0, _NONE)] = 0.03
    cogging_phase: Annotated[float, Quantity("rad", -6.3, 6.3, _NONE)] = 0.0


class ForceActuator(NamedTuple):
    """Command to force: delay, deadband, gain, saturation, rate limit, lag, then `constant`, in that order."""

    constant: Annotated[float, Quantity("N/unit of the command", 1e-9, 1e9, _MJCF)] = 1.0
    force_limit: Annotated[float, Quantity("N", 1e-9, UNLIMITED, _MJCF)] = UNLIMITED
    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, _NONE)] = 0.0
    deadband: Annotated[float, Quantity("unit of the command", 0.0, UNLIMITED, _NONE)] = 0.0
    saturation: Annotated[float, Quantity("unit of the command", 1e-9, UNLIMITED, _NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("unit of the command/s", 1e-9, UNLIMITED, _NONE)] = UNLIMITED


class PositionActuator(NamedTuple):
    """Command to position; without any effect it follows at once: delay, deadband (a play), gain and offset, saturation, rate
    limit, then lag and second lag, or a resonance."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: follows its command at rest")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, _NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    second_lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    natural_frequency: Annotated[float, Quantity("Hz", 1e-3, UNLIMITED, _NONE)] = UNLIMITED
    damping_ratio: Annotated[float, Quantity("1", 0.005, 1.0, _NONE)] = 0.7
    delay: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 100.0, _NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-9, UNLIMITED, _NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("m/s", 1e-9, UNLIMITED, _NONE)] = UNLIMITED


class PositionSensor(NamedTuple):
    """Position as the recording has it."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, "0: calibrated")] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0


class VelocitySensor(NamedTuple):
    """Velocity as the recording has it."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m/s", -100.0, 100.0, "0: calibrated")] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0


class ForceSensor(NamedTuple):
    """Force that moves the joint, positive where it moves it on, as the recording has it."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, "0: calibrated")] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, _NONE)] = 0.0


JOINT_SENSORS = (PositionSensor, VelocitySensor, ForceSensor)
JOINT_ACTUATORS = (ForceActuator, PositionActuator)
