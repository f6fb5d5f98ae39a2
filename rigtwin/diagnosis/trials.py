"""Where the search for each kind of effect starts, and how fine it steps: of the size that matters on the recorded test."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from rigtwin.components.parameters import Carriage, Computer, Cylinder, LoadCell, Lvdt, Motor, Plant, Rail, Tyre
from rigtwin.diagnosis.joint_trials import JOINT_TRIALS, Scales
from rigtwin.diagnosis.trial import SHARES, Swing, Trials
from rigtwin.machine.effects import Effect

TYPES = (Carriage, Rail, Tyre, Motor, Cylinder, Lvdt, LoadCell, Computer)
"""Components whose nominal values are those of the suspension rig, and so are these trials."""

LEAST_FRICTION = 10.0
"""N; a change of friction is tried in shares of what there is, or of this."""


BELOW = (0.95, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1)
"""Shares of a known limit at which a lower one is looked for."""


SHORTEST_WAVE, LONGEST_WAVE, WAVES = 0.008, 0.1, 20
"""m; of cogging, and how many lengths are tried."""
Searched = Callable[[Effect, Plant, Swing], Trials]


def _single(values: tuple[float, ...], step: float) -> Trials:
    return Trials(tuple((value,) for value in values), (step,))


def _friction(effect: Effect, plant: Plant) -> tuple[float, float]:
    """Coulomb friction there is, and a size to try changes of."""
    there = float(getattr(plant, effect.group).coulomb)
    return there, max(there, LEAST_FRICTION)


def _coulomb(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
    there, base = _friction(effect, plant)
    return _single(tuple(max(there + share * base, 0.0) for share in (-0.7, -0.3, 0.3, 1.0, 3.0)), 0.03 * base)


def _stribeck(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
    _, base = _friction(effect, plant)
    amplitudes = (-0.5 * base, 0.5 * base, 2.0 * base)
    return Trials(tuple(product(amplitudes, (0.003, 0.01, 0.03, 0.08))), (0.05 * base, 0.001))


def _asymmetry(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
    _, base = _friction(effect, plant)
    return _single((-base, -0.3 * base, 0.3 * base, base), 0.03 * base)


def _cogging(_effect: Effect, _plant: Plant, _swing: Swing) -> Trials:
    # Waves that fit a stroke of some 80 mm a different number of times.
    pitches = 1.0 / np.linspace(1.0 / LONGEST_WAVE, 1.0 / SHORTEST_WAVE, WAVES)
    starts = tuple((5.0, float(pitch), phase) for pitch in pitches for phase in (0.0, 0.5 * np.pi))
    return Trials(starts, (0.5, 1e-4, 0.05), quadrature=True)


def _offset(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
    if isinstance(getattr(plant, effect.group), Lvdt):
        return _single((-2e-3, -3e-4, 3e-4, 2e-3), 1e-5)
    return _single((-20.0, -4.0, 4.0, 20.0), 0.1)


def _deadband(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
    if isinstance(getattr(plant, effect.group), Motor):
        return _single((0.02, 0.08, 0.3), 0.004)
    return _single((1e-4, 5e-4, 2e-3, 6e-3), 2e-5)


def _saturation(_effect: Effect, _plant: Plant, swing: Swing) -> Trials:
    return _limits(swing.largest)


def _rate_limit(effect: Effect, plant: Plant, swing: Swing) -> Trials:
    component = getattr(plant, effect.group)
    if isinstance(component, Cylinder):
        known = [share * component.speed_limit for share in BELOW]
        return _limits(tuple(min(pair) for pair in zip(swing.fastest, known, strict=True)))
    return _limits(swing.fastest)


def _limits(values: tuple[float, ...]) -> Trials:
    """A limit at each of these values."""
    tried = tuple(max(value, 1e-3 * max(values), 1e-6) for value in values)
    return _single(tried, 0.004 * max(float(np.median(tried)), 1e-6))


def _nominal(shares: tuple[float, ...], step: float) -> Searched:
    def around(effect: Effect, plant: Plant, _swing: Swing) -> Trials:
        nominal = effect.nominal(plant)[effect.kind.parameters[0]]
        return _single(tuple(nominal * share for share in shares), abs(nominal) * step)

    return around


def _fixed(values: tuple[float, ...], step: float) -> Searched:
    return lambda _effect, _plant, _swing: _single(values, step)


TRIALS: dict[str, Searched] = {
    "coulomb": _coulomb,
    "viscous": _fixed((20.0, 100.0, 400.0, 1500.0), 5.0),
    "stribeck": _stribeck,
    "asymmetry": _asymmetry,
    "backlash": _fixed((1e-4, 3e-4, 1e-3, 3e-3, 8e-3), 3e-5),
    "mass": _nominal((0.85, 0.95, 1.05, 1.15, 1.4), 0.005),
    "stiffness": _nominal((0.7, 0.85, 0.95, 1.05, 1.15, 1.4), 0.005),
    "damping": _fixed((30.0, 150.0, 600.0, 1500.0), 10.0),
    "hardening": lambda _effect, _plant, _swing: Trials(
        tuple(product((-15.0, 5.0, 20.0, 60.0, 150.0), (1.0, 2.0))), (1.0, 0.05)
    ),
    "gain": _fixed((0.8, 0.93, 1.07, 1.2), 0.004),
    "lag": _fixed((5e-4, 2e-3, 6e-3, 2e-2, 5e-2), 1e-4),
    "delay": _fixed((5e-4, 2e-3, 5e-3, 1e-2, 2e-2), 1e-4),
    "saturation": _saturation,
    "deadband": _deadband,
    "rate_limit": _rate_limit,
    "cogging": _cogging,
    "compliance": _fixed((2e-7, 1e-6, 5e-6), 2e-8),
    "offset": _offset,
}
"""Kind → its trials. Kinds that are read off the signals directly (noise, hum, bits, missed ticks) are not searched for."""


def searched(effect: Effect) -> bool:
    """Whether an effect is searched for; others are read off the signals."""
    return (effect.kind.name, effect.of) in JOINT_TRIALS or (effect.kind.name in TRIALS and effect.of in TYPES)


def trials(effect: Effect, plant: Any, swing: dict[str, Swing], scale: Callable[[str], Scales] | None = None) -> Trials:
    """Where to start, and how finely to step. scale: of a component, where it is of a described machine."""
    none = Swing((0.0,) * len(SHARES), (0.0,) * len(SHARES))
    own = swing.get(effect.component, none)
    if scale is not None and (effect.kind.name, effect.of) in JOINT_TRIALS:
        return JOINT_TRIALS[effect.kind.name, effect.of](effect, plant, scale(effect.group), own)
    return TRIALS[effect.kind.name](effect, plant, own)
