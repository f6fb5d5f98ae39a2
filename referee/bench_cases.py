"""Random benches for the referee, and the effects that a diagnosis should name."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from referee.benches import (
    ActuatorTruth,
    Array,
    DamperTruth,
    actuator_position,
    damper_force,
    sample,
    wander,
)

SECONDS = 20.0
"""Length of a recording, s."""


@dataclass(frozen=True)
class BenchCase:
    """A random bench.

    Attributes
    ----------
    machine : str
        `actuator` or `damper`.
    names : frozenset of str
        Kinds of the effects in the bench; empty for one without effects.
    truth : ActuatorTruth or DamperTruth
        True parameters.
    period : float
        Sample period, s.
    seed : int
        Seed of the recordings.
    """

    machine: str
    names: frozenset[str]
    truth: ActuatorTruth | DamperTruth
    period: float
    seed: int


@dataclass(frozen=True)
class BenchRecording:
    """Readings of a bench's sensors.

    Attributes
    ----------
    first : ndarray
        Command of the actuator or displacement of the damper, m, shape (ticks,).
    second : ndarray
        Position of the actuator, m, or force of the damper, N, shape (ticks,).
    """

    first: Array
    second: Array


ACTUATORS = (
    "none",
    "lag",
    "two_lags",
    "delay",
    "lag delay",
    "resonance",
    "lag gain",
    "lag rate_limit",
    "lag deadband",
)
DAMPERS = (
    "none",
    "viscous",
    "coulomb",
    "coulomb compliance",
    "coulomb backlash",
    "coulomb compliance backlash",
    "viscous coulomb",
    "viscous viscous_asymmetry",
    "viscous drag",
    "viscous stiffness offset",
    "viscous coulomb compliance",
)


def draw_case(number: int, seed: int) -> BenchCase:
    """Return a case by its number: every sort in turn, with random magnitudes."""
    random = np.random.default_rng([seed, number])
    period = float(random.choice([5e-4, 1e-3, 2e-3]))
    # Even numbers are actuators, odd ones dampers; each walks through its own list of sorts.
    if number % 2:
        sort = DAMPERS[number // 2 % len(DAMPERS)]
        return BenchCase(
            "damper", frozenset(sort.split()) - {"none"}, _damper(sort, random), period, number
        )
    sort = ACTUATORS[number // 2 % len(ACTUATORS)]
    return BenchCase(
        "actuator", frozenset(sort.split()) - {"none"}, _actuator(sort, random), period, number
    )


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _actuator(sort: str, random: np.random.Generator) -> ActuatorTruth:
    """Draw the parameters of an actuator with the effects of a sort."""
    parts = sort.split()
    lags: tuple[float, ...] = ()
    if "lag" in parts:
        lags = (_spread(random, 0.008, 0.05),)
    if "two_lags" in parts:
        first = _spread(random, 0.015, 0.05)
        # The second lag is clearly shorter: two equal lags could be one of another kind.
        lags = (first, first * random.uniform(0.25, 0.8))
    return ActuatorTruth(
        lags=lags,
        delay=_spread(random, 0.006, 0.03) if "delay" in parts else 0.0,
        resonance=(_spread(random, 3.0, 15.0), float(random.uniform(0.15, 0.7)))
        if "resonance" in parts
        else None,
        gain=float(1.0 + random.choice([-1, 1]) * random.uniform(0.02, 0.1))
        if "gain" in parts
        else 1.0,
        speed_limit=float(random.uniform(0.08, 0.13)) if "rate_limit" in parts else math.inf,
        play=_spread(random, 5e-4, 4e-3) if "deadband" in parts else 0.0,
    )


def _damper(sort: str, random: np.random.Generator) -> DamperTruth:
    """Draw the parameters of a damper with the effects of a sort."""
    parts = sort.split()
    slip = _spread(random, 30.0, 300.0) if "coulomb" in parts else 0.0
    out = _spread(random, 400.0, 3000.0) if "viscous" in parts else 0.0
    back = out * random.uniform(0.3, 0.75) if "viscous_asymmetry" in parts else out
    return DamperTruth(
        slip=slip,
        spring=slip / _spread(random, 8e-4, 4e-3) if "compliance" in parts else math.inf,
        play=_spread(random, 8e-4, 5e-3) if "backlash" in parts else 0.0,
        viscous=(out, back),
        stiffness=_spread(random, 1e3, 6e3) if "stiffness" in parts else 0.0,
        preload=_spread(random, 40.0, 200.0) if "offset" in parts else 0.0,
        quadratic=_spread(random, 0.3, 1.0) * out / 0.15 if "drag" in parts else 0.0,
    )


def record(case: BenchCase, again: int = 0) -> BenchRecording:
    """Record a test of a bench; again: number of the repetition, with another motion and noise."""
    random = np.random.default_rng([case.seed, 77, again])
    reach = float(random.uniform(0.02, 0.04))
    if isinstance(case.truth, ActuatorTruth):
        command = wander(random, SECONDS, case.period, reach, 0.1, 8.0)
        position = sample(random, actuator_position(case.truth, command, case.period), 2e-5, 1e-6)
        return BenchRecording(command, position)
    # The stop operator needs steps that are short beside the play.
    substeps = 4
    motion = wander(random, SECONDS, case.period / substeps, reach, 0.1, 3.0)
    force = damper_force(case.truth, motion, np.gradient(motion, case.period / substeps))[
        ::substeps
    ]
    return BenchRecording(
        sample(random, motion[::substeps], 5e-6, 1e-6),
        sample(random, force, 0.01 * float(np.std(force)) + 0.3, 0.05),
    )
