"""What a guide is mounted on: a spring in series with everything the guide does.

Behind a yielding mount the guide moves less than what is measured. All that resists is monotonic in
the guide's own position but for waves (cogging), so its equilibrium with the spring is one number,
found case by case and then between bounds. Waves that are steeper than the mount is stiff,
2π·cogging·mount_compliance > cogging_pitch, have several equilibria; one of them is returned.
"""

from __future__ import annotations

from controllers.compiled import compilable
from rigtwin.components.effect import Kind, around_nominal
from rigtwin.components.guide import Friction, Guide, damping, dry_limits, position_force, slide

MOST = 60
"""Steps of the search for an equilibrium; where only dry friction is nonlinear it needs none."""
CLOSE, ROUNDED = 1e-9, 4e-16
"""Share of the distance to the equilibrium, and of the place, at which it is found."""


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
    position, slope = guess_position(
        guide=guide,
        spring=spring,
        rest=rest,
        share=share,
        period=period,
        inner=inner,
        speed=speed,
        slider=slider,
        viscous=viscous,
        limits=limits,
        outer=outer,
    )
    force, by, relaxed = resist_at(
        guide=guide,
        spring=spring,
        rest=rest,
        share=share,
        period=period,
        inner=inner,
        slider=slider,
        viscous=viscous,
        limits=limits,
        position=position,
    )
    error = position + compliance * force - outer
    # What resists grows with the position, so the guide is no further off than the error is large.
    # Only waves may fall while the position grows, by twice their amplitude at most.
    waves = 2.0 * compliance * guide.cogging
    low, high = min(position, position - error) - waves, max(position, position - error) + waves
    enough = CLOSE * abs(outer - inner) + ROUNDED * abs(outer)
    halve = False
    for _ in range(MOST):
        if abs(error) <= enough:
            break
        if error > 0.0:
            high = position
        else:
            low = position
        following = position - error / slope
        if halve or not low < following < high:
            following = 0.5 * (low + high)
        force, by, relaxed = resist_at(
            guide=guide,
            spring=spring,
            rest=rest,
            share=share,
            period=period,
            inner=inner,
            slider=slider,
            viscous=viscous,
            limits=limits,
            position=following,
        )
        changed = following + compliance * force - outer
        if following != position:
            slope = max((changed - error) / (following - position), 1.0)
        halve = waves > 0.0 and abs(changed) > 0.5 * abs(error)
        position, error = following, changed
    return position, slider + by, relaxed, force


@compilable
def guess_position(
    guide: Guide,
    spring: float,
    rest: float,
    share: float,
    period: float,
    inner: float,
    speed: float,
    slider: float,
    viscous: float,
    limits: tuple[float, float],
    outer: float,
) -> tuple[float, float]:
    """Where the guide is in equilibrium with its mount if nothing but its dry friction is
    nonlinear: case by case. Arguments as of `give_way`.

    Returns
    -------
    Position m, and how fast the mismatch with the mount grows with it.
    """
    compliance, half = guide.mount_compliance, 0.5 * guide.backlash
    along = share * damping(guide, speed) / period
    rate = along + guide.stiffness
    # All that resists but dry friction is `least` + rate·position.
    least = position_force(guide, inner, rest) + (1.0 - share) * viscous - rate * inner
    slope = 1.0 + compliance * rate
    up = (outer - compliance * (least + limits[0])) / slope
    if up - slider >= half + limits[0] / spring:
        return up, slope
    down = (outer - compliance * (least - limits[1])) / slope
    if slider - down >= half + limits[1] / spring:
        return down, slope
    free = (outer - compliance * least) / slope
    if abs(free - slider) <= half:
        return free, slope
    edge = slider + (half if free > slider else -half)
    stuck = slope + compliance * spring
    return (outer - compliance * (least - spring * edge)) / stuck, stuck


KINDS = (
    Kind(
        "mount",
        "compliance of the mount",
        ("mount_compliance",),
        "a spring in series with all that the guide does: what it is mounted on yields",
        {Guide: around_nominal(lambda s: s.stroke / s.force, (0.002, 0.01, 0.05, 0.2, 0.8), 0.002)},
    ),
)
