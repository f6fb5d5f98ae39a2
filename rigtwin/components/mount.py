"""Compliant mount of a guide: a spring in series with all forces of the guide.

Behind the mount, the guide's own position p differs from the measured position x:

    x = p + c·f(p),   with the mount's compliance c and the guide's force f(p)

The force is monotonic in p but for cogging and a curve, so the equilibrium is unique. It is
computed case by case for piecewise linear friction, and refined by a bracketed secant search
otherwise. Cogging that is steeper than the mount is stiff, 2π·cogging·mount_compliance >
cogging_pitch, has several equilibria; one of them is returned. So has such a curve.
"""

from __future__ import annotations

from typing import NamedTuple

from controllers.compiled import compilable
from rigtwin.components.dry_friction import dry_limits, slide
from rigtwin.components.effect import Kind
from rigtwin.components.guide import Guide
from rigtwin.components.guide_force import curve_size, damping, position_force, quick_damping
from rigtwin.components.guide_step import GuideStep
from rigtwin.components.starts import around_nominal

MOST = 60
"""Largest number of search steps. None is needed where only dry friction is nonlinear."""
CLOSE, ROUNDED = 1e-9, 4e-16
"""Tolerance of the equilibrium, as a share of the guide's motion in the step and as a share of the
position (rounding)."""


class MountState(NamedTuple):
    """State of a guide behind its mount between two steps."""

    inner: float  # Position of the guide, m.
    speed: float  # Velocity of the guide in the step before, m/s.
    slider: float  # Position of its friction element, m.
    viscous: float  # Its viscous force, N.


@compilable
def resist_at(
    guide_step: GuideStep, state: MountState, limits: tuple[float, float], position: float
) -> tuple[float, float, float]:
    """Return the force f(p) of a guide at a position p after a step.

    Parameters
    ----------
    guide_step, state
        Guide, and its state before the step.
    limits
        Limits of the dry friction against positive and negative motion, N.
    position
        Position p of the guide after the step, m.

    Returns
    -------
    tuple
        Force, N, motion of the friction element, m, and viscous force, N.
    """
    guide, viscous = guide_step.guide, state.viscous
    v = (position - state.inner) / guide_step.step
    half = 0.5 * guide.backlash
    dry, by = slide(position - state.slider, half, guide_step.spring, limits[0], limits[1])
    relaxed = viscous + guide_step.share * (damping(guide, v) * v - viscous)
    force = position_force(guide, position, guide_step.rest) + dry + relaxed
    return force + quick_damping(guide, position, v) * v, by, relaxed


@compilable
def give_way(
    guide_step: GuideStep, state: MountState, load: float, outer: float
) -> tuple[MountState, float]:
    """Move a guide behind its mount, whose other end is at a given position.

    Parameters
    ----------
    guide_step, state
        Guide, and its state before the step. Its velocity sets the limits of dry friction.
    load
        Force that the guide transmits in addition, N.
    outer
        Position x of the mount's other end, m.

    Returns
    -------
    tuple
        State of the guide after the step, and its force on the mount, N.
    """
    guide = guide_step.guide
    limits = dry_limits(guide_step.dry_friction, state.speed, load)
    compliance = guide.mount_compliance
    position, slope = guess_position(guide_step, state, limits, outer)
    force, by, relaxed = resist_at(guide_step, state, limits, position)
    error = position + compliance * force - outer
    # The mismatch p + c·f(p) − x has a slope of at least 1, so the equilibrium is no further away
    # than the mismatch itself. Only cogging and a curve may fall with p, by twice their amplitudes
    # at most.
    waves = 2.0 * compliance * (guide.cogging + curve_size(guide))
    low, high = min(position, position - error) - waves, max(position, position - error) + waves
    enough = CLOSE * abs(outer - state.inner) + ROUNDED * abs(outer)
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
        force, by, relaxed = resist_at(guide_step, state, limits, following)
        changed = following + compliance * force - outer
        if following != position:
            slope = max((changed - error) / (following - position), 1.0)
        # A falling force can trap the secant on one side: bisect wherever it gains little.
        halve = waves > 0.0 and abs(changed) > 0.5 * abs(error)
        position, error = following, changed
    speed = (position - state.inner) / guide_step.step
    return MountState(position, speed, state.slider + by, relaxed), force


@compilable
def guess_position(
    guide_step: GuideStep, state: MountState, limits: tuple[float, float], outer: float
) -> tuple[float, float]:
    """Return the equilibrium of guide and mount if only dry friction is nonlinear.

    Four cases are tried: the friction element slides forward, slides backward, lies within its
    backlash, or sticks with its spring stretched.

    Parameters
    ----------
    guide_step, state, limits
        Guide, its state and the limits of its dry friction, as in `resist_at`.
    outer
        Position x of the mount's other end, m.

    Returns
    -------
    tuple
        Position of the guide, m, and slope of the mismatch p + c·f(p) − x in p.
    """
    guide, spring, slider = guide_step.guide, guide_step.spring, state.slider
    compliance, half = guide.mount_compliance, 0.5 * guide.backlash
    along = guide_step.share * damping(guide, state.speed) / guide_step.step
    rate = along + guide.stiffness
    # Force without dry friction, linear in the position: least + rate·position.
    least = position_force(guide, state.inner, guide_step.rest)
    least = least + (1.0 - guide_step.share) * state.viscous - rate * state.inner
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
