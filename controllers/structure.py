"""Structure model: the vehicle's body as a point mass under the suspension force and gravity."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings


@compilable
def point_mass(
    settings: Settings, position: float, velocity: float, force: float, period: float
) -> tuple[float, float]:
    """One semi-implicit Euler step; position m, velocity m/s, force N. Returns (position,
    velocity); thesis §3.3."""
    velocity = velocity + (force / settings.sprung_mass - settings.gravity) * period
    return position + velocity * period, velocity
