"""Parameters of the suspension rig's linear motor and its amplifier.

The law is T·F' + F = constant·u for the conditioned voltage u (`conditioning`), less the friction
of the motor's guide (`guide`) and cogging.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.quantity import NONE, STRIBECK_EXPONENT, UNLIMITED, Quantity


class Motor(NamedTuple):
    """Linear motor Dunkermotoren STB3810 and its amplifier."""

    # Amplifier and motor.
    constant: Annotated[float, Quantity("N/V", 1.0, 1e3, "±10 V ↔ ±1860 N, assumed linear")] = 186.0
    time_constant: Annotated[float, Quantity("s", 2e-4, 0.1, "data sheet: 1.26 ms")] = 1.26e-3
    force_limit: Annotated[float, Quantity("N", 1.0, 1e4, "data sheet: peak force")] = 1860.0
    voltage_limit: Annotated[float, Quantity("V", 0.1, 10.0, "amplifier input ±10 V")] = 10.0
    stroke: Annotated[float, Quantity("m", 0.01, 2.0, "data sheet: 0.21 m")] = 0.21
    # Friction between the motor's moving part and the plate; the law is that of `Guide`.
    coulomb: Annotated[
        float, Quantity("N", 0.0, 500.0, "0.15 V step is 2·F_c, thesis §4.4: 0.15·186/2")
    ] = 14.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e4, NONE)] = 0.0
    stribeck: Annotated[float, Quantity("N", -500.0, 500.0, NONE)] = 0.0
    stribeck_velocity: Annotated[
        float, Quantity("m/s", 1e-4, 0.1, "of the order seen in rail guides, assumed")
    ] = 0.01
    stribeck_exponent: Annotated[float, STRIBECK_EXPONENT] = 2.0
    asymmetry: Annotated[float, Quantity("N", -500.0, 500.0, NONE)] = 0.0
    load_coefficient: Annotated[float, Quantity("1", 0.0, 1.0, NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0
    # Conditioning of the command voltage; neutral in the nominal motor.
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: the amplifier as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, NONE)] = 0.0
    deadband: Annotated[float, Quantity("V", 0.0, 5.0, NONE)] = 0.0
    saturation: Annotated[float, Quantity("V", 1e-3, UNLIMITED, NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("V/s", 1e-3, UNLIMITED, NONE)] = UNLIMITED
    # Cogging force of the magnets: cogging·sin(2π·travel/cogging_pitch + cogging_phase).
    cogging: Annotated[float, Quantity("N", 0.0, 200.0, NONE)] = 0.0
    cogging_pitch: Annotated[
        float, Quantity("m", 1e-3, 0.12, "pole pitch of such a motor, assumed")
    ] = 0.03
    cogging_phase: Annotated[float, Quantity("rad", -6.3, 6.3, "0 at zero travel, assumed")] = 0.0
