"""Tuning of a compensator of the benchmark on some plants, and its validation on held-out ones.

The compensator is always designed from the nominal plant; its weights, gains and rates are tuned.
The criterion is the sum of J2 without noise on the worst plant, and J2 above its floor with noise
on the nominal one. The search is the simplex of Nelder and Mead (The Computer Journal 7 (1965)
308) over the logarithms of the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from scipy.optimize import minimize

from controllers.adaptive_law import adaptive_model, adaptive_time_series
from controllers.inverse_model import inverse_model
from controllers.kalman_inverse import kalman_inverse
from controllers.smith_predictor import smith_predictor
from experiments.rths.actuator import ActuatorPlant, draw_plants
from experiments.rths.building import PERIOD, BuildingCase, find_case
from experiments.rths.compensators import KALMAN, SMITH, nominal_actuator, nominal_inverse
from experiments.rths.ground_motion import ground_motion
from experiments.rths.hybrid_test import METRES, Law, run_test
from experiments.rths.noise import BENCHMARK
from rigtwin.errors import RigtwinError

Array = np.ndarray
REACH = 3.0
"""Factor by which the first steps of the simplex change a parameter."""
WORST = 1e3
"""J2 assigned to a test that diverges, %."""
TUNED_SECONDS = 25.0
"""Part of the earthquake used for tuning, s. The strong motion is over by then."""


@dataclass(frozen=True)
class TunedParameter:
    """A parameter to tune.

    Attributes
    ----------
    name : str
        Name of the argument of `Tunable.make`.
    start : float
        Default value, at which the search starts.
    low, high : float
        Bounds of the search.
    """

    name: str
    start: float
    low: float
    high: float


@dataclass(frozen=True)
class Tunable:
    """A compensator as a function of its parameters.

    Attributes
    ----------
    knobs : tuple of TunedParameter
        Parameters to tune.
    make : callable
        Function of the parameters, by name, that returns the law.
    """

    knobs: tuple[TunedParameter, ...]
    make: Callable[..., Law]

    def start(self) -> np.ndarray:
        """Return the logarithms of the default values, shape (knobs,)."""
        return np.log([knob.start for knob in self.knobs])

    def values(self, point: np.ndarray) -> dict[str, float]:
        """Return the parameters at a point of logarithms, shape (knobs,), moved into the bounds."""
        lows, highs = np.log([(knob.low, knob.high) for knob in self.knobs]).T
        # The simplex knows no bounds: a point outside counts as its projection.
        inside = np.exp(np.clip(point, lows, highs))
        return {knob.name: float(value) for knob, value in zip(self.knobs, inside, strict=True)}


def _weighed(**weights: float) -> Law:
    """Return the Kalman inverse of the nominal plant with other weights."""
    return kalman_inverse(nominal_actuator(), PERIOD, KALMAN._replace(**weights))


TUNABLE: Mapping[str, Tunable] = {
    "adaptive-model": Tunable(
        (TunedParameter("rate", 2.0, 0.02, 200.0), TunedParameter("size", 1e-4, 1e-7, 1e-2)),
        lambda rate, size: adaptive_model(nominal_inverse(3), PERIOD, rate=rate, size=size),
    ),
    "adaptive-time-series": Tunable(
        (TunedParameter("window", 1.0, 0.05, 50.0), TunedParameter("hold", 1e-6, 1e-10, 1e-2)),
        lambda window, hold: adaptive_time_series(
            nominal_inverse(2), PERIOD, window=window, hold=hold
        ),
    ),
    "inverse": Tunable(
        (
            TunedParameter("proportional", 1.0, 0.01, 10.0),
            TunedParameter("integral", 40.0, 0.1, 500.0),
        ),
        lambda proportional, integral: inverse_model(
            nominal_inverse(4), PERIOD, proportional=proportional, integral=integral
        ),
    ),
    "smith": Tunable(
        (
            TunedParameter("proportional", SMITH[-2], 0.01, 20.0),
            TunedParameter("integral", SMITH[-1], 0.1, 1000.0),
        ),
        lambda proportional, integral: smith_predictor(*SMITH[:-2], proportional, integral, PERIOD),
    ),
    "kalman-inverse": Tunable(
        (
            TunedParameter("effort", KALMAN.effort, 1e-8, 1e-1),
            TunedParameter("decay", KALMAN.decay, 0.1, 100.0),
            TunedParameter("sensor_noise", KALMAN.sensor_noise, 1e-8, 1e-3),
            TunedParameter("state_noise", KALMAN.state_noise, 1e-8, 1e-2),
        ),
        _weighed,
    ),
}
"""Tunable compensators by name."""


@dataclass(frozen=True)
class TunedCompensator:
    """Result of a tuning.

    Attributes
    ----------
    name : str
        Name of the compensator.
    before, after : dict
        Values of the parameters by name.
    criterion : tuple of float
        Criterion on the plants of the tuning, %, before and after.
    judged : tuple of float
        J2 without noise of the worst held-out plant, %, before and after.
    noisy : tuple of float
        J2 with the benchmark's noise on the nominal plant above its floor, %, before and after.
    tests : int
        Number of hybrid tests run.
    """

    name: str
    before: Mapping[str, float]
    after: Mapping[str, float]
    criterion: tuple[float, float]
    judged: tuple[float, float]
    noisy: tuple[float, float]
    tests: int


class _TestSeries:
    """Hybrid tests of one building and earthquake on a set of plants."""

    def __init__(self, case: BuildingCase, ground: Array, plants: Sequence[ActuatorPlant]) -> None:
        self._case, self._ground, self._plants, self.tests = case, ground, list(plants), 0

    def worst_tracking(self, law: Law) -> float:
        """Return J2 of the worst plant without noise, %."""
        worst = 0.0
        for plant in self._plants:
            test = run_test(self._case, self._ground, law, plant)
            self.tests += 1
            # The worst plant counts, not the mean: one unstable plant must not pass.
            worst = max(worst, test.criteria.j2 if test.stable else WORST)
        return worst

    def objective(
        self, tunable: Tunable, progress: Callable[[int], object]
    ) -> Callable[[np.ndarray], float]:
        """Return the function that the search minimises, %, of the logarithms of the parameters."""

        def criterion(point: np.ndarray) -> float:
            progress(1)
            law = tunable.make(**tunable.values(point))
            return self.worst_tracking(law) + self.noise_response(law)

        return criterion

    def noise_response(self, law: Law) -> float:
        """Return J2 with noise on the nominal plant, above that of the noise alone, %."""
        test = run_test(self._case, self._ground, law, noise=BENCHMARK)
        self.tests += 1
        if not test.stable:
            return WORST
        floor = 100.0 * BENCHMARK.position * METRES / float(np.std(test.desired))
        return max(test.criteria.j2 - floor, 0.0)


def _find_tunable(name: str) -> Tunable:
    """Return a tunable compensator. Raises RigtwinError, listing the names, for another one."""
    if name not in TUNABLE:
        raise RigtwinError(f"compensator {name}: expected one with knobs, {', '.join(TUNABLE)}")
    return TUNABLE[name]


def _check_counts(**counts: tuple[int, int]) -> None:
    """Raise RigtwinError for a count outside its range; counts: name → (count, smallest)."""
    for name, (count, least) in counts.items():
        if not isinstance(count, int) or not least <= count <= 1000:
            raise RigtwinError(f"{name} = {count!r:.40}: expected a whole number from {least}")


def _descend(
    objective: Callable[[np.ndarray], float], start: np.ndarray, evaluations: int
) -> tuple[np.ndarray, float]:
    """Return the point that the simplex of Nelder and Mead ends at, and its value."""
    # The default simplex steps by 5 % of a coordinate, which is nothing for a logarithm near 0.
    steps = np.log(REACH) * np.vstack([np.zeros(len(start)), np.eye(len(start))])
    optimum = minimize(
        objective,
        start,
        method="Nelder-Mead",
        options={"maxfev": evaluations, "initial_simplex": start + steps, "fatol": 1e-3},
    )
    return optimum.x, float(optimum.fun)


def _improve(
    objective: Callable[[np.ndarray], float], start: np.ndarray, evaluations: int
) -> tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]:
    """Return the start and the best point, each with its value."""
    # Gains and weights act by their order of magnitude: the search runs over logarithms.
    first = start, objective(start)
    # In this order: a simplex that found nothing better must not change the compensator.
    return first, min(first, _descend(objective, start, evaluations), key=itemgetter(1))


def tune_compensator(
    name: str,
    case: int = 4,
    *,
    quake: str = "elcentro",
    plants: int = 8,
    held_out_plants: int = 12,
    evaluations: int = 60,
    seed: int = 1,
    progress: Callable[[int], object] = lambda _: None,
) -> TunedCompensator:
    """Tune a compensator and validate it on held-out plants.

    Parameters
    ----------
    name : str
        Compensator, one of `TUNABLE`.
    case : int
        Case of the building, 1 to 4. Defaults to 4.
    quake : str
        Earthquake: elcentro, kobe or morgan. Defaults to elcentro.
    plants, held_out_plants : int
        Numbers of plants in the criterion, the nominal one included, and in the validation, each
        1 to 1000. Default to 8 and 12.
    evaluations : int
        Largest number of evaluations of the criterion, 3 to 1000. Defaults to 60.
    seed : int
        Seed of the random plants. Defaults to 1.
    progress : callable
        Function called with 1 after every evaluation.

    Returns
    -------
    TunedCompensator
        Parameters and figures before and after.

    Raises
    ------
    RigtwinError
        If an argument is unknown or out of range.
    """
    _check_counts(plants=(plants, 1), held_out_plants=(held_out_plants, 1))
    _check_counts(evaluations=(evaluations, 3))
    tunable, building, ground = _find_tunable(name), find_case(case), ground_motion(quake)
    drawn = draw_plants(plants + held_out_plants, seed)
    tuning = _TestSeries(building, ground[: round(TUNED_SECONDS / PERIOD)], drawn[:plants])
    validation = _TestSeries(building, ground, drawn[plants:])
    objective = tuning.objective(tunable, progress)
    (start, first), (best, last) = _improve(objective, tunable.start(), evaluations)
    values = tunable.values(start), tunable.values(best)
    before, after = (tunable.make(**parameters) for parameters in values)
    return TunedCompensator(
        name,
        *values,
        criterion=(first, last),
        judged=(validation.worst_tracking(before), validation.worst_tracking(after)),
        noisy=(validation.noise_response(before), validation.noise_response(after)),
        tests=tuning.tests + validation.tests,
    )
