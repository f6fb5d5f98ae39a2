"""Compliant mount of a guide: a spring in series with all forces of the guide.

Behind the mount, the guide's own position p differs from the measured position x:

    x = p + c·f(p),   with the mount's compliance c and the guide's force f(p)

The force is monotonic in p but for cogging and a curve, so the equilibrium is unique. It is
computed case by case for piecewise linear friction, and refined by a bracketed secant search
otherwise. Cogging that is steeper than the mount is stiff, 2π·cogging·mount_compliance >
cogging_pitch, has several equilibria; one of them is returned. So has such a curve.
"""

from __future__ import annotations

from controllers.compiled import compilable
from rigtwin.components.effect import Kind, around_nominal
from rigtwin.components.guide import (
    Friction,
    Guide,
    curve_size,
    damping,
    dry_limits,
    position_force,
    slide,
)

MOST = 60
"""Largest number of search steps. None is needed where only dry friction is nonlinear."""
CLOSE, ROUNDED = 1e-9, 4e-16
"""Tolerance of the equilibrium, as a share of the guide's motion in the step and as a share of the
position (rounding)."""


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
    """Return the force f(p) of a guide at a position p after a step.

    Parameters
    ----------
    guide
        Parameters of the guide.
    spring
        Stiffness in series with the dry friction, N/m.
    rest
        Position at which the guide's own spring is slack, m.
    share
        Share by which viscous friction relaxes in a step.
    period
        Length of the step, s.
    inner, slider, viscous
        Position of the guide, m, of its friction element, m, and viscous force, N, before the step.
    limits
        Limits of the dry friction against positive and negative motion, N.
    position
        Position p of the guide after the step, m.

    Returns
    -------
    tuple
        Force, N, motion of the friction element, m, and viscous force, N.
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
    """Move a guide behind its mount, whose other end is at a given position.

    Parameters
    ----------
    guide, spring, rest, share, period, inner, slider, viscous
        Guide and its state, as in `resist_at`.
    dry_friction
        Dry friction of the guide.
    speed
        Velocity of the guide in the step before, m/s; it sets the limits of dry friction.
    load
        Force that the guide transmits in addition, N.
    outer
        Position x of the mount's other end, m.

    Returns
    -------
    tuple
        Position of the guide, m, of its friction element, m, viscous force, N, and force on the
        mount, N.
    """
    # One function on purpose: it runs in every step, and its search would pass all of its dozen
    # arguments on to a part of its own.
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
    # The mismatch p + c·f(p) − x has a slope of at least 1, so the equilibrium is no further away
    # than the mismatch itself. Only cogging and a curve may fall with p, by twice their amplitudes
    # at most.
    waves = 2.0 * compliance * (guide.cogging + curve_size(guide))
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
        # Secant step, or bisection where it leaves the bracket.
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
    """Return the equilibrium of guide and mount if only dry friction is nonlinear.

    Four cases are tried: the friction element slides forward, slides backward, lies within its
    backlash, or sticks with its spring stretched. Arguments are those of `give_way`.

    Returns
    -------
    tuple
        Position of the guide, m, and slope of the mismatch p + c·f(p) − x in p.
    """
    compliance, half = guide.mount_compliance, 0.5 * guide.backlash
    along = share * damping(guide, speed) / period
    rate = along + guide.stiffness
    # Force without dry friction, linear in the position: least + rate·position.
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
