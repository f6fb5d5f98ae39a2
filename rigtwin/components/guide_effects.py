"""Effects of a guide: their kinds, and the values from which a search for them starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from rigtwin.components.effect import Context, Kind, Starts
from rigtwin.components.guide import CURVE, FRAME, Guide, Rail
from rigtwin.components.guide_force import curve_points
from rigtwin.components.motor import Motor
from rigtwin.components.scales import Scales
from rigtwin.components.starts import (
    around_nominal,
    fixed_starts,
    late_starts,
    shares_of_nominal,
)
from rigtwin.components.tyre import Tyre

LEAST_FRICTION = 10.0
"""Smallest unit of friction changes in a search on the suspension rig, N."""
SLOWEST, SLOW = 0.01, 0.35
"""Bounds of the Stribeck velocity, as shares of the highest speed."""
SHORTEST = 1e-9
"""Shortest half range of a curve, m."""
NEARLY = 0.1
"""Share of the half range by which the middle of a range that counts as symmetric may be off."""
FEWEST_WAVES, MOST_WAVES = 3.0, 512.0
"""Bounds of the number of cogging waves along the stroke. Fewer than the smallest are a force that
depends on position, more than the largest are not looked for."""
SPREAD_WAVES = 40.0
"""Number of waves up to which pitches are tried whatever the data show."""


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
    shapes: int = 0,
) -> Starts:
    # Sine and cosine of each wavelength: a linear combination gives any phase.
    starts = tuple((size, pitch, phase) for pitch in pitches for phase in (0.0, 0.5 * math.pi))
    return Starts(starts, steps, quadrature=True, shapes=shapes or len(pitches), bounds=bounds)


def _stribeck(context: Context) -> Starts:
    scales = context.scales
    amplitudes = [share * scales.force for share in (-0.3, 0.1, 0.4)]
    speeds = [share * scales.fastest for share in (0.02, 0.06, 0.2)]
    # Friction that does not fade well below the highest speed is confounded with Coulomb and
    # viscous friction.
    bounds = ((-1e7, 1e7), (SLOWEST * scales.fastest, SLOW * scales.fastest))
    steps = (0.005 * scales.force, 0.005 * scales.fastest)
    return Starts(tuple(product(amplitudes, speeds)), steps, bounds=bounds)


def _slack(context: Context) -> Starts:
    # The ends of a spring that is stiff part by little more than its gap.
    low, high = context.scales.span
    travel = max(high - low, SHORTEST)
    return Starts.single([share * travel for share in (0.4, 0.8, 0.95)], 0.002 * travel)


def _cogging(context: Context) -> Starts:
    force, stroke = context.scales.force, context.scales.stroke
    spread = 2.0 * stroke / np.geomspace(FEWEST_WAVES, SPREAD_WAVES, 24)
    pitches = (*spread.tolist(), *context.scales.pitches)
    # The step changes the number of the shortest waves along the stroke by a twentieth.
    step = min(0.002 * stroke, 0.05 * min(pitches) ** 2 / (2.0 * stroke))
    bounds = ((0.0, 1e7), (2.0 * stroke / MOST_WAVES, 2.0 * stroke / FEWEST_WAVES), (-6.3, 6.3))
    shapes = round(MOST_WAVES) if context.scales.pitches else 0
    return _waves(0.03 * force, pitches, (0.003 * force, step, 0.05), bounds, shapes)


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
        "cubic_stiffness",
        "cubic stiffness",
        ("cubic_stiffness",),
        "a spring that hardens, or softens, with the cube of its deflection",
        {
            Guide: around_nominal(
                lambda s: s.force / s.stroke**3, (-3.0, -0.5, -0.05, 0.05, 0.5, 3.0), 0.01
            )
        },
        needs="stiffness",
    ),
    Kind(
        "slack",
        "slack",
        ("slack",),
        "a gap within which a spring bears no force",
        {Guide: _slack},
        needs="stiffness",
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
