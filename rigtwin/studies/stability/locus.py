"""Root locus: the poles of a model over one swept parameter, and their crossings of the imaginary
axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rigtwin.numerics.arrays import Array
from rigtwin.studies.stability.models import MODELS, ideal_quarter_car, ideal_single_mass
from rigtwin.studies.stability.vehicle import QuarterCar

ROUNDING = 1e-12
"""Relative real part, in shares of the pole's magnitude, that counts as rounding."""
CLOSE = 1e-9
"""Relative accuracy of the swept value at a crossing."""
BODY, WHEEL = "body hop", "wheel hop"


class Setting(NamedTuple):
    """Vehicle and lag, in s, at one value of the swept parameter."""

    car: QuarterCar
    lag: float


class Crossing(NamedTuple):
    """Pair of poles on the imaginary axis.

    Attributes
    ----------
    value
        Value of the swept parameter.
    frequency
        Frequency of the poles, in rad/s.
    mode
        Mode shape of the masses.
    unstable
        Whether the mode becomes unstable as the parameter grows.
    """

    value: float
    frequency: float
    mode: str
    unstable: bool


def mode(car: QuarterCar, pole: complex) -> str:
    """Return the mode shape at a pole (thesis §5.3.1).

    Body hop: both masses move in the same direction; wheel hop: in opposite directions. The
    suspension force f moves both, W x_u = f and m_s s² x_s = −f, so x_u/x_s = −m_s s²/W whatever
    the lags.
    """
    wheel = car.unsprung_mass * pole**2 + car.tyre_damping * pole + car.tyre_stiffness
    return BODY if (-car.sprung_mass * pole**2 / wheel).real > 0.0 else WHEEL


@dataclass(frozen=True)
class Locus:
    """Poles of a model over one swept parameter.

    Attributes
    ----------
    model
        Name in `MODELS`.
    values
        Values of the swept parameter, ascending.
    at
        Function from a value to the vehicle and lag.
    """

    model: str
    values: Array
    at: Callable[[float], Setting]

    @cached_property
    def poles(self) -> np.ndarray:
        """Poles, in 1/s, one row per value."""
        return np.linalg.eigvals(np.array([self._dynamics(value) for value in self.values])).astype(
            complex
        )

    @cached_property
    def ideal(self) -> np.ndarray:
        """Poles without any lag, in 1/s, one row per value."""
        ideal = self._ideal
        return np.linalg.eigvals(
            np.array([ideal(self.at(value).car) for value in self.values])
        ).astype(complex)

    def poles_at(self, value: float) -> np.ndarray:
        """Return the poles at one value, in 1/s."""
        return np.linalg.eigvals(self._dynamics(value)).astype(complex)

    def ideal_at(self, value: float) -> np.ndarray:
        """Return the poles without any lag at one value, in 1/s."""
        return np.linalg.eigvals(self._ideal(self.at(value).car)).astype(complex)

    def unstable_modes(self, value: float) -> tuple[str, ...]:
        """Return the modes of all unstable poles, without repetition."""
        car = self.at(value).car
        poles = (pole for pole in self.poles_at(value) if _is_unstable(pole) and pole.imag >= 0.0)
        return tuple(sorted({self.mode(car, pole) for pole in poles}))

    @cached_property
    def crossings(self) -> list[Crossing]:
        """Crossings of the imaginary axis, in the order of the swept values."""
        # Only intervals where the number of unstable poles changes are searched.
        counts = np.sum(_is_unstable(self.poles), axis=1)
        crossings: list[Crossing] = []
        for i in np.flatnonzero(counts[:-1] != counts[1:]):
            crossings += self._find_crossings(float(self.values[i]), float(self.values[i + 1]))
        return crossings

    def mode(self, car: QuarterCar, pole: complex) -> str:
        """Return the mode shape at a pole; a single mass has only body hop."""
        return BODY if self.model == "single-mass" else mode(car, pole)

    def _find_crossings(self, low: float, high: float) -> list[Crossing]:
        # Bisection on the number of unstable poles, in ratios because sweeps span decades. Both
        # halves are searched, since several pairs can cross in one interval.
        below, above = self._count(low), self._count(high)
        if below == above:
            return []
        if high - low > CLOSE * high:
            middle = float(np.sqrt(low * high))
            return self._find_crossings(low, middle) + self._find_crossings(middle, high)
        before, after = self.poles_at(low), self.poles_at(high)
        # One pole of each complex pair is enough; real poles do not cross with a frequency.
        after = after[after.imag > 0.0]
        # Poles are paired by distance, because eigenvalues come in no particular order.
        nearest = before[np.argmin(np.abs(after[:, None] - before[None, :]), axis=1)]
        car = self.at(high).car
        crossed = after[_is_unstable(after) != _is_unstable(nearest)]
        modes = [(float(pole.imag), self.mode(car, pole)) for pole in crossed]
        return sorted(Crossing(high, frequency, mode, above > below) for frequency, mode in modes)

    def _count(self, value: float) -> int:
        return int(np.sum(_is_unstable(self.poles_at(value))))

    def _dynamics(self, value: float) -> Array:
        setting = self.at(value)
        return np.asarray(MODELS[self.model](setting.car, setting.lag).A)

    @property
    def _ideal(self) -> Callable[[QuarterCar], Array]:
        if self.model == "single-mass":
            return lambda car: np.asarray(ideal_single_mass(car.sprung).A)
        return lambda car: np.asarray(ideal_quarter_car(car).A)


def _is_unstable(poles: np.ndarray) -> np.ndarray:
    """Return which poles lie to the right of the imaginary axis."""
    return poles.real > ROUNDING * np.abs(poles)
