"""Tunes a compensator of the benchmark on some plants, and judges it on others.

What a compensator is designed from, the nominal plant, stays; its weights, gains and rates are
looked for. The criterion weighs what it does without noise on the worst plant and what it makes of
noise on the nominal one; the search is Nelder's and Mead's simplex over the logarithms (The
Computer Journal 7 (1965) 308).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from controllers.adaptive_law import adaptive_model, adaptive_time_series
from controllers.inverse_model import inverse_model
from controllers.kalman_inverse import kalman_inverse
from controllers.smith_predictor import smith_predictor
from experiments.rths.actuator import Plant, draw_plants
from experiments.rths.building import PERIOD, Case, find_case
from experiments.rths.compensators import KALMAN, SMITH, nominal_actuator, nominal_inverse
from experiments.rths.ground_motion import ground_motion
from experiments.rths.hybrid_test import BENCHMARK, METRES, Law, run_test
from rigtwin.errors import RigtwinError

Array = np.ndarray
REACH = 3.0
"""Factor of the simplex' first steps."""
WORST = 1e3
"""%, of a test that runs away or ends beyond a limit."""
TUNED_SECONDS = 25.0
"""Of the earthquake while it is tuned: the strong part is over then."""


@dataclass(frozen=True)
class Knob:
    """A number that is looked for. start: by default; low, high: between which."""

    name: str
    start: float
    low: float
    high: float


@dataclass(frozen=True)
class Tunable:
    """A compensator as a function of its knobs."""

    knobs: tuple[Knob, ...]
    make: Callable[..., Law]


def _weighed(**weights: float) -> Law:
    return kalman_inverse(nominal_actuator(), PERIOD, KALMAN._replace(**weights))


TUNABLE: Mapping[str, Tunable] = {
    "adaptive-model": Tunable(
        (Knob("rate", 2.0, 0.02, 200.0), Knob("size", 1e-4, 1e-7, 1e-2)),
        lambda rate, size: adaptive_model(nominal_inverse(3), PERIOD, rate=rate, size=size),
    ),
    "adaptive-time-series": Tunable(
        (Knob("window", 1.0, 0.05, 50.0), Knob("hold", 1e-6, 1e-10, 1e-2)),
        lambda window, hold: adaptive_time_series(
            nominal_inverse(2), PERIOD, window=window, hold=hold
        ),
    ),
    "inverse": Tunable(
        (Knob("proportional", 1.0, 0.01, 10.0), Knob("integral", 40.0, 0.1, 500.0)),
        lambda proportional, integral: inverse_model(
            nominal_inverse(4), PERIOD, proportional=proportional, integral=integral
        ),
    ),
    "smith": Tunable(
        (Knob("proportional", SMITH[-2], 0.01, 20.0), Knob("integral", SMITH[-1], 0.1, 1000.0)),
        lambda proportional, integral: smith_predictor(*SMITH[:-2], proportional, integral, PERIOD),
    ),
    "kalman-inverse": Tunable(
        (
            Knob("effort", KALMAN.effort, 1e-8, 1e-1),
            Knob("decay", KALMAN.decay, 0.1, 100.0),
            Knob("sensor_noise", KALMAN.sensor_noise, 1e-8, 1e-3),
            Knob("state_noise", KALMAN.state_noise, 1e-8, 1e-2),
        ),
        _weighed,
    ),
}
"""Compensators by name."""


@dataclass(frozen=True)
class TunedCompensator:
    """What came of it.

    Parameters
    ----------
    name : str
        Of the compensator.
    before, after : dict
        Knob → value.
    criterion : tuple of float
        On the plants that it was tuned on, before and after.
    judged : tuple of float
        J2 in % without noise, the worst of the plants that it was not tuned on, before and after.
    noisy : tuple of float
        J2 in % with the benchmark's noise on the nominal plant, above its floor, before and after.
    tests : int
        That were run.
    """

    name: str
    before: Mapping[str, float]
    after: Mapping[str, float]
    criterion: tuple[float, float]
    judged: tuple[float, float]
    noisy: tuple[float, float]
    tests: int


class _Trial:
    """One case and its plants."""

    def __init__(self, case: Case, ground: Array, plants: Sequence[Plant]) -> None:
        self._case, self._ground, self._plants, self.tests = case, ground, list(plants), 0

    def follow(self, law: Law) -> float:
        """J2 in %, the worst of the plants, without noise."""
        worst = 0.0
        for plant in self._plants:
            test = run_test(self._case, self._ground, law, plant)
            self.tests += 1
            worst = max(worst, test.criteria.j2 if test.stable else WORST)
        return worst

    def stir(self, law: Law) -> float:
        """J2 in % with noise on the nominal plant, above that of the noise alone."""
        test = run_test(self._case, self._ground, law, noise=BENCHMARK)
        self.tests += 1
        if not test.stable:
            return WORST
        floor = 100.0 * BENCHMARK.position * METRES / float(np.std(test.desired))
        return max(test.criteria.j2 - floor, 0.0)


def tune_compensator(
    name: str,
    case: int = 4,
    *,
    quake: str = "elcentro",
    plants: int = 8,
    others: int = 12,
    evaluations: int = 60,
    seed: int = 1,
    progress: Callable[[int], object] = lambda _: None,
) -> TunedCompensator:
    """Tunes a compensator.

    Parameters
    ----------
    name
        One of `TUNABLE`.
    case
        Of the building, 1 to 4.
    quake
        elcentro, kobe or morgan.
    plants, others
        On which it is tuned, the nominal one among them, and on which it is judged.
    evaluations
        Of the criterion, at most.
    seed
        Of the plants that are drawn.
    progress
        Called with 1 after each evaluation.

    Raises
    ------
    RigtwinError
        For any mistake in these.
    """
    if name not in TUNABLE:
        raise RigtwinError(f"compensator {name}: expected one with knobs, {', '.join(TUNABLE)}")
    for told, count, least in (
        ("plants", plants, 1),
        ("others", others, 1),
        ("evaluations", evaluations, 3),
    ):
        if not isinstance(count, int) or not least <= count <= 1000:
            raise RigtwinError(f"{told} = {count!r:.40}: expected a whole number from {least}")
    of, ground = TUNABLE[name], ground_motion(quake)
    drawn, building = draw_plants(plants + others, seed), find_case(case)
    tuning = _Trial(building, ground[: round(TUNED_SECONDS / PERIOD)], drawn[:plants])
    judging = _Trial(building, ground, drawn[plants:])
    knobs = of.knobs
    lows, highs = (np.log([getattr(k, end) for k in knobs]) for end in ("low", "high"))

    def values(place: Array) -> dict[str, float]:
        inside = np.exp(np.clip(place, lows, highs))
        return {knob.name: float(value) for knob, value in zip(knobs, inside, strict=True)}

    def criterion(place: Array) -> float:
        law = of.make(**values(place))
        progress(1)
        return tuning.follow(law) + tuning.stir(law)

    start = np.log([knob.start for knob in knobs])
    first = criterion(start)
    steps = np.log(REACH) * np.vstack([np.zeros(len(knobs)), np.eye(len(knobs))])
    found = minimize(
        criterion,
        start,
        method="Nelder-Mead",
        options={"maxfev": evaluations, "initial_simplex": start + steps, "fatol": 1e-3},
    )
    best = found.x if found.fun < first else start
    before, after = of.make(**values(start)), of.make(**values(best))
    return TunedCompensator(
        name=name,
        before=values(start),
        after=values(best),
        criterion=(first, min(float(found.fun), first)),
        judged=(judging.follow(before), judging.follow(after)),
        noisy=(judging.stir(before), judging.stir(after)),
        tests=tuning.tests + judging.tests,
    )
