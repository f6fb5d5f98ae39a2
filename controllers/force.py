"""Force loop of the linear motor: feedforward plus PI with anti-windup."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings

MOTOR_CONSTANT = 186.0
"""N/V: the force per volt that the controller assumes of the amplifier and motor (±10 V ↔ ±1860
N)."""


@compilable
def force_loop(
    settings: Settings,
    integral: float,
    demanded: float,
    measured: float,
    added: float,
    period: float,
) -> tuple[float, float]:
    """One tick. demanded, measured, integral, added (against friction) in N; returns (integral in
    N, voltage in V).

    When the voltage reaches its limit this tick's increment of the integral is discarded.
    """
    error = demanded - measured
    increment = settings.ki * error * period
    voltage = (
        settings.kff * demanded + settings.kp * error + integral + increment + added
    ) / MOTOR_CONSTANT
    limit = settings.voltage_limit
    if abs(voltage) >= limit:
        return integral, min(max(voltage, -limit), limit)
    return integral + increment, voltage
