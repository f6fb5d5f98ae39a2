"""End stops of a guide: springs and dampers that act only beyond the ends of its stroke.

The law is that of `Guide`; this module says how a search for stops begins. Stops are where a
recorded motion ends, so it begins a little within the ends of the measured range.
"""

from __future__ import annotations

from rigtwin.components.effect import Context, Kind, Starts
from rigtwin.components.guide import STOPS, Guide

INSETS = (0.01, 0.05, 0.15)
"""Distances of the first guesses from either end of the range, as shares of it."""
ONE_SIDED = 0.05
"""Distance of the first guess of a single stop, as a share of the range."""
DEEPEST = 0.3
"""Largest distance of a stop from its end of the range, as a share of it."""
DAMPING = 0.5
"""First guess of the damping, in units of force per speed."""


def soften_stops(guide: Guide, mass: float, step: float) -> Guide:
    """Return a guide whose end stops are no stiffer than an integration step resolves.

    A stop's force is explicit in the position, which is stable up to a stiffness of 4·m/h² with the
    mass m and the step h. Stiffer stops end the motion within a step or two all the same.

    Parameters
    ----------
    guide
        Guide with its stops.
    mass
        Inertia that meets the stop, kg.
    step
        Integration step, s.
    """
    return guide._replace(stop_stiffness=min(guide.stop_stiffness, mass / step**2))


def _starts(context: Context) -> Starts:
    scales = context.scales
    low, high = scales.span
    stroke = max(high - low, 1e-9)
    damping = DAMPING * scales.force / scales.speed

    def guess(below: float, above: float) -> tuple[float, ...]:
        # The stop bears the typical force at the end of the range.
        stiffness = scales.force / (stroke * min(abs(below), abs(above)))
        return stiffness, damping, low + below * stroke, high - above * stroke

    # A stop one stroke away is never reached.
    starts = [guess(inset, inset) for inset in INSETS]
    starts += [guess(ONE_SIDED, -1.0), guess(-1.0, ONE_SIDED)]
    steps = (
        0.02 * scales.force / (ONE_SIDED * stroke),
        0.02 * scales.force / scales.speed,
        0.002 * stroke,
        0.002 * stroke,
    )
    # Stops that meet would be a linear spring.
    lower = (low - stroke, low + DEEPEST * stroke)
    upper = (high - DEEPEST * stroke, high + stroke)
    return Starts(tuple(starts), steps, bounds=((0.0, 1e12), (0.0, 1e9), lower, upper))


KINDS = (
    Kind(
        "end_stops",
        "end stop",
        ("stop_stiffness", "stop_damping", *STOPS),
        "a spring and a damper beyond the ends of the stroke",
        {Guide: _starts},
    ),
)
