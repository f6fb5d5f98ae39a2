"""Guide: friction, spring and cogging between a moving part and the frame, and their effects.

Dry friction is set-valued: at rest it bears any force up to the limits that `dry_limits` returns.
The law is Coulomb, Stribeck and viscous friction (Armstrong-Hélouvry, Dupont and Canudas de Wit,
Automatica 30(7), 1994); `Guide` states its equations. `docs/theory.md` says which load counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.effect import (
    Context,
    Kind,
    Points,
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
"""Distance within which a gap counts as taken up, m."""
LEAST_FRICTION = 10.0
"""Smallest unit of friction changes in a search on the suspension rig, N."""
ONE_WAY = 0.05
"""Smallest friction of the weaker direction, as a share of the mean. No guide slides freely one way
and rubs the other way."""
SLOWEST, SLOW = 0.01, 0.35
"""Bounds of the Stribeck velocity, as shares of the highest speed."""
CURVE = ("curve_2", "curve_3", "curve_4", "curve_5")
"""Coefficients of the curve of a position-dependent force."""
FRAME = ("curve_middle", "curve_half_range")
"""Range of positions to which the coefficients refer."""
TOLD = 7
"""Number of positions at which a curve is reported."""
SHORTEST = 1e-9
"""Shortest half range of a curve, m."""
NEARLY = 0.1
"""Share of the half range by which the middle of a range that counts as symmetric may be off."""
WAVES = 3.0
"""Smallest number of cogging waves along the stroke. Fewer are a force that depends on position."""


CONSTANT = ("coulomb", "stribeck_velocity", "stribeck_exponent")
"""Parameters that do not by themselves make friction depend on the motion."""


class Rail(NamedTuple):
    """Friction of the suspension rig's rail guide, with true stiction.

    `Motor` has the same friction parameters. The law is that of `Guide`.
    """

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
    """Force between a moving part and the frame: friction, a damper, a spring.

    With position x, velocity v and transmitted force F_t:

        force        = F_viscous + drag·v·|v| + F_position + F_stop + F_dry
        F_viscous    = (viscous ± ½·viscous_asymmetry)·v, through a first-order lag `relaxation`
        F_position   = stiffness·(x − x_rest) + offset
                       + cogging·sin(2π·x/cogging_pitch + cogging_phase)
                       + Σ_n curve_n·T_n(ξ),  n = 2 … 5
                       + stop_stiffness·s(x)
        F_stop       = stop_damping·v  where s(x) ≠ 0
        |F_dry|      ≤ coulomb + load_coefficient·|F_t|
                       + stribeck·exp(−|v/stribeck_velocity|^stribeck_exponent) ± ½·asymmetry

    The upper sign is for positive v. Dry friction acts through a backlash and a spring of
    `compliance` in series. All of it acts through a spring of `mount_compliance` in series.
    Units are those of a sliding joint; for a turning joint, read rad for m and Nm for N.

    T_n is the Chebyshev polynomial of degree n, and ξ = (x − curve_middle)/curve_half_range, held
    within ±1: beyond the range in which a curve was identified, its force stays as at the end.

    s(x) is how far x lies beyond `stop_high`, or below `stop_low` (negative), and 0 between them.

    The transmitted force is what reaches the guide from the body and the guide's own spring where
    the motion is given, and the actuator's force where the motion follows from a force
    (docs/theory.md, "Load friction").
    """

    # Coulomb friction, viscous friction and spring: the MJCF has values for these.
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
    curve_2: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_3: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_4: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_5: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_middle: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = 0.0
    curve_half_range: Annotated[float, Quantity("m", 1e-9, 1e3, NONE)] = 1.0
    stop_stiffness: Annotated[float, Quantity("N/m", 0.0, 1e12, NONE)] = 0.0
    stop_damping: Annotated[float, Quantity("Ns/m", 0.0, 1e9, NONE)] = 0.0
    stop_low: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = -1.0
    stop_high: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = 1.0


STOPS = ("stop_low", "stop_high")
"""Positions of the end stops."""
SHAPES = (
    "stribeck_velocity",
    "stribeck_exponent",
    "cogging_pitch",
    "cogging_phase",
    *FRAME,
    *STOPS,
)
"""Parameters of a guide that exert no force by themselves."""


def acts(guide: Guide) -> bool:
    """Return whether any parameter of a guide exerts a force."""
    return any(value for name, value in guide._asdict().items() if name not in SHAPES)


class Friction(NamedTuple):
    """Dry friction as compiled code takes it; parameters as in `Guide`."""

    changing: bool  # Whether friction depends on the motion; otherwise it is `coulomb` alone.
    coulomb: float
    stribeck: float
    stribeck_velocity: float
    stribeck_exponent: float
    asymmetry: float
    load_coefficient: float
    backlash: float


def friction(component: Rail | Motor | Guide) -> Friction:
    """Return the dry friction of a rail, motor or guide."""
    # A rail has no load-dependent friction, and a motor none of the guide's other parameters.
    known = component._asdict()
    values = {name: float(known.get(name, 0.0)) for name in Friction._fields[1:]}
    changing = any(v for name, v in values.items() if name not in CONSTANT)
    return Friction(changing, **values)


def friction_size(dry: Friction, load: float) -> float:
    """Return the largest dry friction, N, under a typical load, N."""
    size = dry.coulomb + abs(dry.stribeck) + 0.5 * abs(dry.asymmetry)
    return size + dry.load_coefficient * abs(load)


def gap_at(position: float) -> Array:
    """Return the state of a backlash: the position of its friction element, m, shape (1,)."""
    return np.array([position])


@compilable
def dry_limits(dry: Friction, velocity: float, load: float) -> tuple[float, float]:
    """Return the limits of dry friction.

    F_max = coulomb + load_coefficient·|load| + stribeck·exp(−|v/v_s|^n) ± ½·asymmetry, not below 0.

    Parameters
    ----------
    dry
        Parameters of the friction.
    velocity
        Velocity v of the motion that friction resists, m/s.
    load
        Force that the sliding part transmits, N. The models differ in what they
        count as such a force (docs/theory.md, "Load friction").

    Returns
    -------
    tuple
        Largest forces against positive and against negative motion, N.
    """
    size = dry.coulomb + dry.load_coefficient * abs(load)
    if dry.stribeck != 0.0:
        ratio = abs(velocity / dry.stribeck_velocity)
        exponent = dry.stribeck_exponent
        # Gauss' curve is the usual case: a product is faster than a power.
        power = ratio * ratio if exponent == 2.0 else ratio**exponent
        size += dry.stribeck * math.exp(-power)
    return max(size + 0.5 * dry.asymmetry, 0.0), max(size - 0.5 * dry.asymmetry, 0.0)


@compilable
def breakaway(
    dry: Friction, gap: Array, position: float, velocity: float, load: float
) -> tuple[float, float]:
    """Return the limits of dry friction behind a backlash, and move its friction element.

    Friction acts only where the gap is taken up, and only against motion that pushes the element.

    Parameters
    ----------
    dry
        Parameters of the friction.
    gap
        State of the backlash, m, shape (1,); changed in place.
    position, velocity
        Position and velocity of the motion, m and m/s.
    load
        Force that the sliding part transmits, N.

    Returns
    -------
    tuple
        Largest forces against positive and against negative motion, N.
    """
    forward, backward = dry_limits(dry, velocity, load)
    half = 0.5 * dry.backlash
    if half > 0.0:
        displacement = position - gap[0]
        if displacement >= half - ROUNDING:
            gap[0] = position - half
            return forward, 0.0
        if displacement <= ROUNDING - half:
            gap[0] = position + half
            return 0.0, backward
        return 0.0, 0.0
    return forward, backward


def resists(guide: Guide) -> bool:
    """Return whether friction resists both directions by at least `ONE_WAY` of the mean.

    Otherwise it is a force of one direction and not the friction of a guide.
    """
    most = 2.0 * (1.0 - ONE_WAY)
    dry = guide.coulomb + abs(guide.stribeck)
    if guide.load_coefficient == 0.0 and abs(guide.asymmetry) > most * dry:
        return False
    return abs(guide.viscous_asymmetry) <= most * guide.viscous


@compilable
def stretch(distance: float, half: float) -> float:
    """Return the stretch of the spring behind a backlash of 2·half, m."""
    return distance - half if distance > half else (distance + half if distance < -half else 0.0)


@compilable
def slide(
    distance: float, half: float, spring: float, forward: float, backward: float
) -> tuple[float, float]:
    """Return dry friction and slip of an elastic, perfectly plastic element behind a backlash.

    F = clip(spring·stretch, −backward, forward). Where a limit is reached, the slider follows so
    that the spring holds exactly that limit.

    Parameters
    ----------
    distance
        Distance from the slider to the joint, m.
    half
        Half the backlash, m.
    spring
        Stiffness in series with the friction, N/m.
    forward, backward
        Limits against positive and negative motion, N.

    Returns
    -------
    tuple
        Dry friction, N, and motion of the slider, m.
    """
    force = spring * stretch(distance, half)
    if force > forward:
        return forward, distance - half - forward / spring
    if force < -backward:
        return -backward, distance + half + backward / spring
    return force, 0.0


@compilable
def damping(guide: Guide, velocity: float) -> float:
    """Return the viscous coefficient in the direction of a velocity, m/s: Ns/m."""
    more = 0.5 * guide.viscous_asymmetry
    return guide.viscous + (more if velocity > 0.0 else -more)


@compilable
def has_curve(guide: Guide) -> bool:
    """Return whether the guide exerts a force that is a curve over the stroke."""
    low = guide.curve_2 != 0.0 or guide.curve_3 != 0.0
    return low or guide.curve_4 != 0.0 or guide.curve_5 != 0.0


@compilable
def curve(guide: Guide, position: float) -> float:
    """Return the smooth force over the stroke, N.

    F = Σ_n curve_n·T_n(ξ), n = 2 … 5, with Chebyshev's polynomials T_n of the position ξ relative
    to the range, which is held within ±1. A constant and a linear part are `offset` and
    `stiffness`.
    """
    first = min(max((position - guide.curve_middle) / guide.curve_half_range, -1.0), 1.0)
    # Chebyshev's recurrence: T_{n+1} = 2·ξ·T_n − T_{n−1}.
    second = 2.0 * first * first - 1.0
    third = 2.0 * first * second - first
    fourth = 2.0 * first * third - second
    fifth = 2.0 * first * fourth - third
    even = guide.curve_2 * second + guide.curve_4 * fourth
    return even + guide.curve_3 * third + guide.curve_5 * fifth


@compilable
def curve_size(guide: Guide) -> float:
    """Return an upper bound of the magnitude of the curve's force, N."""
    return abs(guide.curve_2) + abs(guide.curve_3) + abs(guide.curve_4) + abs(guide.curve_5)


@compilable
def beyond_stop(guide: Guide, position: float) -> float:
    """Return how far a position lies beyond an end stop, m; 0 between the stops."""
    return max(position - guide.stop_high, 0.0) + min(position - guide.stop_low, 0.0)


@compilable
def quick_damping(guide: Guide, position: float, velocity: float) -> float:
    """Return the coefficient of the damping that follows the velocity at once, Ns/m.

    It is drag·|v|, and that of an end stop where the position is beyond it.
    """
    coefficient = guide.drag * abs(velocity)
    if guide.stop_damping != 0.0 and beyond_stop(guide, position) != 0.0:
        coefficient += guide.stop_damping
    return coefficient


@compilable
def position_force(guide: Guide, position: float, rest: float) -> float:
    """Return spring, constant force, cogging, curve and end stops at a position, N.

    F = stiffness·(x − rest) + offset + cogging·sin(2π·x/cogging_pitch + cogging_phase) + curve
    + stop_stiffness·s(x), with the way s(x) beyond an end stop.
    """
    force = guide.stiffness * (position - rest) + guide.offset
    if has_curve(guide):
        force += curve(guide, position)
    if guide.cogging != 0.0:
        force += guide.cogging * math.sin(
            2.0 * math.pi * position / guide.cogging_pitch + guide.cogging_phase
        )
    if guide.stop_stiffness != 0.0:
        force += guide.stop_stiffness * beyond_stop(guide, position)
    return force


def _rig_friction(context: Context) -> tuple[float, float]:
    """Return the nominal Coulomb friction and the unit of its changes, N."""
    nominal = float(context.component(Rail, Motor).coulomb)
    return nominal, max(nominal, LEAST_FRICTION)


def _rig_coulomb(context: Context) -> Starts:
    nominal, base = _rig_friction(context)
    values = [max(nominal + share * base, 0.0) for share in (-0.7, -0.3, 0.3, 1.0, 3.0)]
    return Starts.single(values, 0.03 * base)


def _rig_stribeck(context: Context) -> Starts:
    _, base = _rig_friction(context)
    amplitudes = (-0.5 * base, 0.5 * base, 2.0 * base)
    starts = tuple(product(amplitudes, (0.003, 0.01, 0.03, 0.08), (1.4,)))
    return Starts(starts, (0.05 * base, 0.001, 0.1))


def _rig_asymmetry(context: Context) -> Starts:
    _, base = _rig_friction(context)
    return Starts.single((-base, -0.3 * base, 0.3 * base, base), 0.03 * base)


def _rig_cogging(_: Context) -> Starts:
    # The number of waves along the rig's stroke of some 80 mm is spread evenly.
    pitches = 1.0 / np.linspace(1.0 / 0.1, 1.0 / 0.008, 20)
    return _waves(5.0, pitches.tolist(), (0.5, 1e-4, 0.05))


def _waves(
    size: float,
    pitches: Sequence[float],
    steps: tuple[float, float, float],
    bounds: tuple[tuple[float, float], ...] | None = None,
) -> Starts:
    # Sine and cosine of each wavelength: a linear combination gives any phase.
    starts = tuple((size, pitch, phase) for pitch in pitches for phase in (0.0, 0.5 * math.pi))
    return Starts(starts, steps, quadrature=True, bounds=bounds)


def _stribeck(context: Context) -> Starts:
    scales = context.scales
    amplitudes = [share * scales.force for share in (-0.3, 0.1, 0.4)]
    speeds = [share * scales.fastest for share in (0.02, 0.06, 0.2)]
    # Friction that does not fade well below the highest speed is confounded with Coulomb and
    # viscous friction.
    bounds = ((-1e7, 1e7), (SLOWEST * scales.fastest, SLOW * scales.fastest))
    steps = (0.005 * scales.force, 0.005 * scales.fastest)
    return Starts(tuple(product(amplitudes, speeds)), steps, bounds=bounds)


def _cogging(context: Context) -> Starts:
    force, stroke = context.scales.force, context.scales.stroke
    # Wavelengths that fit the stroke three to forty times.
    pitches = 2.0 * stroke / np.geomspace(WAVES, 40.0, 24)
    bounds = ((0.0, 1e7), (0.02 * stroke, 2.0 * stroke / WAVES), (-6.3, 6.3))
    return _waves(0.03 * force, pitches.tolist(), (0.003 * force, 0.002 * stroke, 0.05), bounds)


def _curve(context: Context) -> Starts:
    # The force is linear in the coefficients, so one start along each of them suffices.
    low, high = context.scales.span
    size = 0.05 * context.scales.force
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), SHORTEST)
    # A range that is nearly symmetric about zero is centred there, where springs are slack: an odd
    # force then needs no constant force beside it.
    frame = (0.0, half + abs(middle)) if abs(middle) < NEARLY * half else (middle, half)
    starts = tuple((*(size * row).tolist(), *frame) for row in np.eye(len(CURVE)))
    return Starts(starts, (0.1 * size,) * len(CURVE) + (0.0, 0.0), is_linear=True)


def curve_points(values: Mapping[str, float]) -> Points:
    """Return positions and forces along the curve of a position-dependent force, m and N."""
    guide = Guide(**values)
    places = guide.curve_middle + guide.curve_half_range * np.linspace(-1.0, 1.0, TOLD)
    return tuple((float(place), curve(guide, float(place))) for place in places)


def late_starts(context: Context) -> Starts:
    """Return starts of a lag or delay: a few ticks, and shares of the motion's own time."""
    scales = context.scales
    times = {ticks * scales.period for ticks in (0.5, 2.0, 6.0)} | {
        share * scales.time for share in (0.012, 0.05, 0.15)
    }
    return Starts.single(sorted(times), min(0.001 * scales.time, 0.25 * scales.period))


def late_or_early_starts(context: Context) -> Starts:
    """Return starts of either sign: a negative lag is a force that acts later than recorded."""
    late = late_starts(context)
    times = [time for (time,) in late.values]
    return Starts.single([*(-time for time in times[:3]), *times], late.steps[0])


def _drag(context: Context) -> Starts:
    unit, nominal = context.scales.force / context.scales.speed**2, context.nominal
    values = [nominal + share * unit for share in (0.02, 0.05, 0.15, 0.4)]
    # Drag takes energy away, so negative values are excluded: they would only compensate a nominal
    # viscous friction that is too high.
    return Starts(tuple((v,) for v in values), (0.005 * unit,), bounds=((min(nominal, 0.0), 1e9),))


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
            # Dense starts: a lightly damped resonance fits better only close to its stiffness.
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
        "position_force",
        "position-dependent force",
        (*CURVE, *FRAME),
        "a smooth force over the stroke beside a linear spring, as a cable or hardening has it",
        {Guide: _curve},
        magnitudes=len(CURVE),
        constants=FRAME,
        points=curve_points,
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
"""Kinds of effect that change a guide's dry friction and have no effect without it."""
