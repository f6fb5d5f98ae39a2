"""Skyhook damping (thesis §7.1): none, an ideal active force, or a dissipative damper."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings, Skyhook


@compilable
def semi_active_damping(
    settings: Settings, sprung_velocity: float, travel_velocity: float
) -> float:
    """Return the coefficient of the semi-active damper, Ns/m.

    It is b_sky·v_s/v within [b_min, b_max] while v_s·v > 0, else b_min: a damper cannot push.
    Velocities of the body, v_s, and of the travel, v, are in m/s.
    """
    if sprung_velocity * travel_velocity <= 0.0:
        return settings.damping_min
    wanted = settings.skyhook_damping * sprung_velocity / travel_velocity
    return min(max(wanted, settings.damping_min), settings.damping_max)


@compilable
def skyhook_force(settings: Settings, sprung_velocity: float, travel_velocity: float) -> float:
    """Return the force to subtract from the suspension force, N; velocities: m/s."""
    if settings.skyhook == Skyhook.ACTIVE:
        return settings.skyhook_damping * sprung_velocity
    if settings.skyhook == Skyhook.SEMI_ACTIVE:
        return semi_active_damping(settings, sprung_velocity, travel_velocity) * travel_velocity
    return 0.0
