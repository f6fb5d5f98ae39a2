"""Structure model: the vehicle's body as a point mass under the suspension force and gravity."""

from __future__ import annotations

from controllers.compiled import compilable
from controllers.settings import Settings


@compilable
def point_mass(
    settings: Settings, position: float, velocity: float, force: float, period: float
) -> tuple[float, float]:
    """Return position, m, and velocity, m/s, of the body after a tick: m v̇ = F − m g (thesis §3.3).

    force: of the suspension, N; period: s. Semi-implicit Euler: the velocity first.
    """
    velocity = velocity + (force / settings.sprung_mass - settings.gravity) * period
    return position + velocity * period, velocity
