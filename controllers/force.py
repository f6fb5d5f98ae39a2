"""Force loop of the linear motor: feedforward plus PI with anti-windup."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings

MOTOR_CONSTANT = 186.0
"""Force per volt of amplifier and motor that the controller assumes, N/V (±10 V ↔ ±1860 N)."""


@compilable
def force_loop(
    settings: Settings,
    integral: float,
    demanded: float,
    measured: float,
    added: float,
    period: float,
) -> tuple[float, float]:
    """Return the integral, N, and the voltage, V, of one tick of the force loop.

    u = (K_ff F_d + K_p e + K_i ∫ e dt + F_a)/K_m, e = F_d − F.

    demanded, measured: F_d and F, N; added: F_a against friction, N; period: s.
    """
    # Anti-windup: at the voltage limit this tick's increment of the integral is discarded.
    error = demanded - measured
    increment = settings.ki * error * period
    voltage = (
        settings.kff * demanded + settings.kp * error + integral + increment + added
    ) / MOTOR_CONSTANT
    limit = settings.voltage_limit
    if abs(voltage) >= limit:
        return integral, min(max(voltage, -limit), limit)
    return integral + increment, voltage
