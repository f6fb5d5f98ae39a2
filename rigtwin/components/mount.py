"""What a guide is mounted on: a spring in series with everything the guide does.

Behind a yielding mount the guide moves less than what is measured. All that resists is monotonic in
the guide's own position, so its equilibrium with the spring is one number, found between bounds.
"""

from __future__ import annotations

from controllers.compiled import compilable
from rigtwin.components.effect import Kind, around_nominal
from rigtwin.components.guide import Friction, Guide, damping, dry_limits, position_force, slide

MOST = 60
"""Steps of the search for an equilibrium; it needs about five."""
CLOSE = 1e-12
"""Share of the distance to the equilibrium at which it is found."""


@compilable
def resist_at(
    guide: Guide,
    spring: float,
    rest: float,
    share: float,
    period: float,
    inner: float,
    slider: float,
    viscous: float,
    limits: tuple[float, float],
    position: float,
) -> tuple[float, float, float]:
    """What a guide resists with if it is at a position after this step.

    Parameters
    ----------
    guide
        Its parameters.
    spring
        In series with the dry friction, N/m.
    rest
        Where the guide's own spring is slack, m.
    share
        Of the way that viscous friction relaxes in a step.
    period
        s, of a step.
    inner, slider, viscous
        Its position m, its slider's m and its viscous force N before the step.
    limits
        What dry friction can bear, N.
    position
        m.

    Returns
    -------
    Force N, how far the slider slides m, and the viscous force N.
    """
    v = (position - inner) / period
    dry, by = slide(position - slider, 0.5 * guide.backlash, spring, limits[0], limits[1])
    relaxed = viscous + share * (damping(guide, v) * v - viscous)
    force = position_force(guide, position, rest) + dry + relaxed + guide.drag * v * abs(v)
    return force, by, relaxed


@compilable
def give_way(
    guide: Guide,
    dry_friction: Friction,
    spring: float,
    rest: float,
    share: float,
    period: float,
    inner: float,
    speed: float,
    slider: float,
    viscous: float,
    load: float,
    outer: float,
) -> tuple[float, float, float, float]:
    """The guide behind its mount, whose other end is moved to a position.

    Parameters
    ----------
    guide, spring, rest, share, period, inner, slider, viscous
        As of `resist_at`.
    dry_friction
        Of the guide.
    speed
        m/s, of the guide in the step before; it decides what dry friction can bear.
    load
        N, what else the guide transmits.
    outer
        m, where the mount's other end is.

    Returns
    -------
    The guide's position m, its slider's m, its viscous force N, and the force on the mount N.
    """
    limits = dry_limits(dry_friction, speed, load)
    compliance = guide.mount_compliance
    force, by, relaxed = resist_at(
        guide, spring, rest, share, period, inner, slider, viscous, limits, inner
    )
    error = inner + compliance * force - outer
    # What resists grows with the position, so the guide is no further off than the error is large.
    low, high = min(inner, inner - error), max(inner, inner - error)
    position, slope = inner, 1.0
    enough = CLOSE * abs(error)
    for _ in range(MOST):
        if abs(error) <= enough:
            break
        if error > 0.0:
            high = position
        else:
            low = position
        following = position - error / slope
        if not low < following < high:
            following = 0.5 * (low + high)
        force, by, relaxed = resist_at(
            guide, spring, rest, share, period, inner, slider, viscous, limits, following
        )
        changed = following + compliance * force - outer
        if following != position:
            slope = max((changed - error) / (following - position), 1.0)
        position, error = following, changed
    return position, slider + by, relaxed, force


KINDS = (
    Kind(
        "mount",
        "compliance of the mount",
        ("mount_compliance",),
        "a spring in series with all that the guide does: what it is mounted on yields",
        {Guide: around_nominal(lambda s: s.stroke / s.force, (0.002, 0.01, 0.05, 0.2, 0.8), 0.002)},
    ),
)
