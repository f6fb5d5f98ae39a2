"""Suspension model: spring, damper and preload; force in N, positive in compression."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings


@compilable
def suspension_force(settings: Settings, travel: float, velocity: float) -> float:
    """preload − k_s·travel − b_s·velocity, of the filtered travel (m) and its rate (m/s); thesis
    §3.3."""
    return (
        settings.preload
        - settings.suspension_stiffness * travel
        - settings.suspension_damping * velocity
    )
