"""Suspension model: spring, damper and preload; force in N, positive in compression."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings


@compilable
def suspension_force(settings: Settings, travel: float, velocity: float) -> float:
    """Return the suspension force F = F_0 − k_s x − b_s ẋ, N (thesis §3.3).

    travel, velocity: filtered travel x, m, and its rate, m/s; F_0 is the preload.
    """
    return (
        settings.preload
        - settings.suspension_stiffness * travel
        - settings.suspension_damping * velocity
    )
