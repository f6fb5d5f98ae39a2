"""Whatever slides along a guide: its friction, springs and waves; their law, and the effects of
them.

Dry friction is set-valued: while nothing moves it bears any force up to the limits that
`dry_limits` gives. `docs/theory.md` has the equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.effect import (
    Context,
    Kind,
    Scales,
    Starts,
    around_nominal,
    fixed_starts,
    shares_of_nominal,
)
from rigtwin.components.motor import Motor
from rigtwin.components.quantity import MJCF, NONE, STRIBECK_EXPONENT, Quantity
from rigtwin.components.tyre import Tyre
from rigtwin.numerics.arrays import Array

ROUNDING = 1e-12
"""m, within which a gap is taken up."""
LEAST_FRICTION = 10.0
"""N; on the suspension rig a change of friction is tried in shares of what there is, or of this."""
ONE_WAY = 0.05
"""Share of the mean friction that its weaker direction has at least: no guide slides freely one way
and rubs the other."""
SLOWEST, SLOW = 0.01, 0.35
"""Shares of the highest speed between which Stribeck friction must fade."""
WAVES = 3.0
"""Waves along the stroke that cogging has at least: fewer are a force that depends on the place."""


CONSTANT = ("coulomb", "stribeck_velocity", "stribeck_exponent")
"""Parameters of friction that alone do not make it depend on the motion."""


class Rail(NamedTuple):
    """Friction of the rail guide, with true stiction. Its friction parameters are those of Motor
    too."""

    coulomb: Annotated[float, Quantity("N", 0.0, 1000.0, "breakaway, thesis §6.1.3")] = 50.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e4, NONE)] = 0.0
    stribeck: Annotated[float, Quantity("N", -500.0, 1000.0, NONE)] = 0.0
    stribeck_velocity: Annotated[
        float, Quantity("m/s", 1e-4, 0.1, "of the order seen in rail guides, assumed")
    ] = 0.01
    stribeck_exponent: Annotated[float, STRIBECK_EXPONENT] = 2.0
    asymmetry: Annotated[float, Quantity("N", -500.0, 500.0, NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0


class Guide(NamedTuple):
    """Whatever acts between the moving part and the frame: a guide's friction, a damper, a spring.

    force = viscous·v ± ½·viscous_asymmetry·|v|, through a lag `relaxation`, + drag·v·|v|
    +
    stiffness·x + offset + cogging·sin(2π·x/cogging_pitch + cogging_phase) + dry friction, which
    is coulomb + load_coefficient·|load| +
    stribeck·exp(−|v/stribeck_velocity|^stribeck_exponent), in positive direction ½·asymmetry more
    and in negative less, and acts through a play of `backlash` and a spring of `compliance` in
    series with it. All of it acts through a spring of `mount_compliance`.

    Where the motion is given, the load is the force that reaches the guide from the body and from
    the guide's own spring. Where the motion follows from a force, it is the actuator's force
    (docs/theory.md, "Load friction").
    """

    coulomb: Annotated[float, Quantity("N", 0.0, 1e7, MJCF)] = 0.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e9, MJCF)] = 0.0
    stiffness: Annotated[float, Quantity("N/m", 0.0, 1e12, MJCF)] = 0.0
    stribeck: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    stribeck_velocity: Annotated[
        float, Quantity("m/s", 1e-6, 100.0, "of the order seen in guides, assumed")
    ] = 0.01
    stribeck_exponent: Annotated[float, STRIBECK_EXPONENT] = 2.0
    asymmetry: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    load_coefficient: Annotated[float, Quantity("1", 0.0, 2.0, NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 10.0, NONE)] = 0.0
    compliance: Annotated[float, Quantity("m/N", 0.0, 1.0, NONE)] = 0.0
    mount_compliance: Annotated[float, Quantity("m/N", 0.0, 1.0, NONE)] = 0.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    viscous_asymmetry: Annotated[float, Quantity("Ns/m", -1e9, 1e9, NONE)] = 0.0
    drag: Annotated[float, Quantity("Ns^2/m^2", -1e9, 1e9, NONE)] = 0.0
    relaxation: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    cogging: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    cogging_pitch: Annotated[float, Quantity("m", 1e-6, 100.0, NONE)] = 0.03
    cogging_phase: Annotated[float, Quantity("rad", -6.3, 6.3, NONE)] = 0.0


class Friction(NamedTuple):
    """Dry friction as compiled code takes it.

    changing: whether it depends on the motion; the rest as in Guide.
    """

    changing: bool
    coulomb: float
    stribeck: float
    stribeck_velocity: float
    stribeck_exponent: float
    asymmetry: float
    load_coefficient: float
    backlash: float


def friction(of: Rail | Motor | Guide) -> Friction:
    """The dry friction of whatever slides."""
    values = {name: float(getattr(of, name, 0.0)) for name in Friction._fields[1:]}
    changing = any(v for name, v in values.items() if name not in CONSTANT)
    return Friction(changing, **values)


def friction_size(dry: Friction, load: float) -> float:
    """How large dry friction may be, N, under a typical load, N."""
    size = dry.coulomb + abs(dry.stribeck) + 0.5 * abs(dry.asymmetry)
    return size + dry.load_coefficient * abs(load)


def gap_at(position: float) -> Array:
    """State of the backlash: where its element is, m; shape (1,)."""
    return np.array([position])


@compilable
def dry_limits(dry: Friction, velocity: float, load: float) -> tuple[float, float]:
    """What dry friction can bear.

    Parameters
    ----------
    dry
        The friction's parameters.
    velocity
        m/s, of the motion that it resists.
    load
        Force that what slides transmits, N. The models differ in what they count as such a force
        (docs/theory.md, "Load friction").

    Returns
    -------
    Greatest forces against positive and against negative motion, N.
    """
    size = dry.coulomb + dry.load_coefficient * abs(load)
    if dry.stribeck != 0.0:
        ratio = abs(velocity / dry.stribeck_velocity)
        exponent = dry.stribeck_exponent
        power = ratio * ratio if exponent == 2.0 else ratio**exponent
        size += dry.stribeck * math.exp(-power)
    return max(size + 0.5 * dry.asymmetry, 0.0), max(size - 0.5 * dry.asymmetry, 0.0)


@compilable
def breakaway(
    dry: Friction, gap: Array, position: float, velocity: float, load: float
) -> tuple[float, float]:
    """What dry friction can bear now, N: against positive and against negative motion.

    Moves the backlash's element, whose friction is felt only where the gap is taken up, and only in
    the direction that pushes it on.
    """
    forward, backward = dry_limits(dry, velocity, load)
    half = 0.5 * dry.backlash
    if half > 0.0:
        apart = position - gap[0]
        if apart >= half - ROUNDING:
            gap[0] = position - half
            return forward, 0.0
        if apart <= ROUNDING - half:
            gap[0] = position + half
            return 0.0, backward
        return 0.0, 0.0
    return forward, backward


def resists(of: Guide) -> bool:
    """Whether friction resists the motion in both directions, in neither by next to nothing: that
    is a force of one direction."""
    most = 2.0 * (1.0 - ONE_WAY)
    if of.load_coefficient == 0.0 and abs(of.asymmetry) > most * (of.coulomb + abs(of.stribeck)):
        return False
    return abs(of.viscous_asymmetry) <= most * of.viscous


@compilable
def stretch(apart: float, half: float) -> float:
    """How far the spring behind a play of 2·half is stretched."""
    return apart - half if apart > half else (apart + half if apart < -half else 0.0)


@compilable
def slide(
    apart: float, half: float, spring: float, forward: float, backward: float
) -> tuple[float, float]:
    """(dry friction, how far the slider slid) for a distance between the joint and its slider."""
    force = spring * stretch(apart, half)
    if force > forward:
        return forward, apart - half - forward / spring
    if force < -backward:
        return -backward, apart + half + backward / spring
    return force, 0.0


@compilable
def damping(guide: Guide, velocity: float) -> float:
    """Viscous friction's coefficient in the direction of a velocity, Ns/m."""
    more = 0.5 * guide.viscous_asymmetry
    return guide.viscous + (more if velocity > 0.0 else -more)


@compilable
def position_force(guide: Guide, position: float, rest: float) -> float:
    """The forces that depend on the position alone."""
    force = guide.stiffness * (position - rest) + guide.offset
    if guide.cogging != 0.0:
        force += guide.cogging * math.sin(
            2.0 * math.pi * position / guide.cogging_pitch + guide.cogging_phase
        )
    return force


def _rig_friction(at: Context) -> tuple[float, float]:
    """Coulomb friction there is, and a size to try changes of."""
    there = float(getattr(at.plant, at.effect.group).coulomb)
    return there, max(there, LEAST_FRICTION)


def _rig_coulomb(at: Context) -> Starts:
    there, base = _rig_friction(at)
    values = [max(there + share * base, 0.0) for share in (-0.7, -0.3, 0.3, 1.0, 3.0)]
    return Starts.single(values, 0.03 * base)


def _rig_stribeck(at: Context) -> Starts:
    _, base = _rig_friction(at)
    amplitudes = (-0.5 * base, 0.5 * base, 2.0 * base)
    starts = tuple(product(amplitudes, (0.003, 0.01, 0.03, 0.08), (1.4,)))
    return Starts(starts, (0.05 * base, 0.001, 0.1))


def _rig_asymmetry(at: Context) -> Starts:
    _, base = _rig_friction(at)
    return Starts.single((-base, -0.3 * base, 0.3 * base, base), 0.03 * base)


def _rig_cogging(_: Context) -> Starts:
    # Waves that fit a stroke of some 80 mm a different number of times.
    pitches = 1.0 / np.linspace(1.0 / 0.1, 1.0 / 0.008, 20)
    return _waves(5.0, pitches.tolist(), (0.5, 1e-4, 0.05))


def _waves(
    size: float,
    pitches: Sequence[float],
    steps: tuple[float, float, float],
    bounds: tuple[tuple[float, float], ...] | None = None,
) -> Starts:
    starts = tuple((size, pitch, phase) for pitch in pitches for phase in (0.0, 0.5 * math.pi))
    return Starts(starts, steps, quadrature=True, bounds=bounds)


def _stribeck(at: Context) -> Starts:
    scales = at.scales
    amplitudes = [share * scales.force for share in (-0.3, 0.1, 0.4)]
    speeds = [share * scales.fastest for share in (0.02, 0.06, 0.2)]
    # What does not fade well below the highest speed cannot be told from Coulomb and viscous.
    bounds = ((-1e7, 1e7), (SLOWEST * scales.fastest, SLOW * scales.fastest))
    steps = (0.005 * scales.force, 0.005 * scales.fastest)
    return Starts(tuple(product(amplitudes, speeds)), steps, bounds=bounds)


def _cogging(at: Context) -> Starts:
    force, stroke = at.scales.force, at.scales.stroke
    # Waves that fit the stroke three to forty times: a longer one is no wave.
    pitches = 2.0 * stroke / np.geomspace(WAVES, 40.0, 24)
    bounds = ((0.0, 1e7), (0.02 * stroke, 2.0 * stroke / WAVES), (-6.3, 6.3))
    return _waves(0.03 * force, pitches.tolist(), (0.003 * force, 0.002 * stroke, 0.05), bounds)


def late_starts(at: Context) -> Starts:
    """Times of a few ticks, and of a share of the motion's own."""
    scales = at.scales
    times = {ticks * scales.period for ticks in (0.5, 2.0, 6.0)} | {
        share * scales.time for share in (0.012, 0.05, 0.15)
    }
    return Starts.single(sorted(times), min(0.001 * scales.time, 0.25 * scales.period))


def late_or_early_starts(at: Context) -> Starts:
    """The same, and their negatives: a force that acts later than it is recorded."""
    late = late_starts(at)
    times = [time for (time,) in late.values]
    return Starts.single([*(-time for time in times[:3]), *times], late.steps[0])


def _drag(at: Context) -> Starts:
    unit, there = at.scales.force / at.scales.speed**2, at.nominal
    values = [there + share * unit for share in (0.02, 0.05, 0.15, 0.4)]
    # It takes energy away; a negative one stands for a nominal viscous friction that is too high.
    return Starts(tuple((v,) for v in values), (0.005 * unit,), bounds=((min(there, 0.0), 1e9),))


def _force(scales: Scales) -> float:
    return scales.force


def _damping(scales: Scales) -> float:
    return scales.force / scales.speed


LESS_AT_REST = "dry friction smaller near standstill, which presliding looks like too"
KINDS = (
    Kind(
        "coulomb",
        "Coulomb friction",
        ("coulomb",),
        "dry friction, the same at any speed",
        {
            Rail: _rig_coulomb,
            Motor: _rig_coulomb,
            Guide: around_nominal(_force, (-0.1, 0.03, 0.1, 0.3, 0.8), 0.005),
        },
    ),
    Kind(
        "viscous",
        "viscous friction",
        ("viscous",),
        "friction in proportion to the speed",
        {
            **dict.fromkeys((Rail, Motor), fixed_starts((20.0, 100.0, 400.0, 1500.0), 5.0)),
            Guide: around_nominal(_damping, (-0.3, -0.05, 0.05, 0.3, 0.9), 0.005),
        },
    ),
    Kind(
        "stribeck",
        "Stribeck friction",
        ("stribeck", "stribeck_velocity", "stribeck_exponent"),
        "dry friction greater near standstill",
        {Rail: _rig_stribeck, Motor: _rig_stribeck},
        LESS_AT_REST,
    ),
    Kind(
        "stribeck",
        "Stribeck friction",
        ("stribeck", "stribeck_velocity"),
        "dry friction greater near standstill",
        {Guide: _stribeck},
        LESS_AT_REST,
    ),
    Kind(
        "asymmetry",
        "asymmetry of friction",
        ("asymmetry",),
        "dry friction greater in positive direction than in negative",
        {
            Rail: _rig_asymmetry,
            Motor: _rig_asymmetry,
            Guide: around_nominal(_force, (-0.5, -0.1, 0.1, 0.5), 0.005),
        },
        "dry friction greater in negative direction than in positive",
    ),
    Kind(
        "load_friction",
        "load-dependent friction",
        ("load_coefficient",),
        "dry friction in proportion to the force that is transmitted",
        dict.fromkeys((Motor, Guide), fixed_starts((0.01, 0.04, 0.15, 0.4), 0.002)),
    ),
    Kind(
        "backlash",
        "backlash",
        ("backlash",),
        "friction felt only once a gap is taken up after each reversal",
        {
            **dict.fromkeys((Rail, Motor), fixed_starts((1e-4, 3e-4, 1e-3, 3e-3, 8e-3), 3e-5)),
            Guide: around_nominal(lambda s: s.stroke, (0.003, 0.01, 0.04, 0.12, 0.4), 0.002),
        },
    ),
    Kind(
        "stiffness",
        "stiffness",
        ("stiffness",),
        "stiffness at small deflection",
        {
            Tyre: shares_of_nominal((0.7, 0.85, 0.95, 1.05, 1.15, 1.4), 0.005),
            # Densely: where little damps, only a stiffness near the right one looks any better.
            Guide: around_nominal(
                lambda s: s.force / s.stroke,
                (-0.3, -0.05, *np.geomspace(0.02, 0.9, 10).tolist()),
                0.005,
            ),
        },
    ),
    Kind(
        "cogging",
        "cogging",
        ("cogging", "cogging_pitch", "cogging_phase"),
        "force that alternates along the stroke",
        {Motor: _rig_cogging, Guide: _cogging},
    ),
    Kind(
        "compliance",
        "compliance",
        ("compliance",),
        "a spring in series with the dry friction",
        {Guide: around_nominal(lambda s: s.stroke / s.force, (0.002, 0.01, 0.05, 0.2, 0.8), 0.002)},
    ),
    Kind(
        "offset",
        "constant force",
        ("offset",),
        "a force that is the same whichever way it moves",
        {Guide: around_nominal(_force, (-0.3, -0.05, 0.05, 0.3), 0.003)},
    ),
    Kind(
        "viscous_asymmetry",
        "asymmetry of viscous friction",
        ("viscous_asymmetry",),
        "viscous friction greater in positive direction than in negative",
        {Guide: around_nominal(_damping, (-0.6, -0.1, 0.1, 0.6), 0.01)},
        "viscous friction greater in negative direction than in positive",
    ),
    Kind(
        "drag",
        "quadratic friction",
        ("drag",),
        "friction with the square of the speed",
        {Guide: _drag},
    ),
    Kind(
        "relaxation",
        "relaxation",
        ("relaxation",),
        "viscous friction through a spring: it lags by this time",
        {Guide: late_starts},
    ),
)
THROUGH_FRICTION = ("stribeck", "asymmetry", "backlash", "compliance")
"""Kinds of a guide that change its dry friction, and do nothing without it."""
