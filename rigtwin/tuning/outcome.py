"""A whole study: searched on the rig as it is known, and judged on what the search has not seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controllers import Settings
from rigtwin.posterior import Changes, Posterior
from rigtwin.tuning.bench import Bench, Worth
from rigtwin.tuning.judged import Comparison, compared
from rigtwin.tuning.parameter import with_values
from rigtwin.tuning.scenario import APART, NONE, Rig, diagnosed, drawn, nominal
from rigtwin.tuning.search import Search, Tried, best, front
from rigtwin.tuning.study import Study

NOMINAL, CALIBRATED = "nominal twin", "calibrated twin"
TUNED, BEFORE, TUNED_NOMINAL = "tuned", "before", "tuned on the nominal twin"


@dataclass(frozen=True)
class Outcome:
    """rig: what was tuned on; tried: every candidate, in the order tried; front: with two objectives those that none beats,
    thinned to the study's number of points, else the best alone; chosen: the one to be used, of a front the one nearest to the
    best in both; comparisons: on held-out scenarios; on_front: each point of a front with the settings begun with, likewise."""

    study: Study
    seed: int
    rig: str
    baseline: Worth
    tried: tuple[Tried, ...]
    front: tuple[Tried, ...]
    chosen: Tried
    comparisons: tuple[Comparison, ...]
    on_front: tuple[Comparison, ...]

    @property
    def settings(self) -> Settings:
        """The controller as tuned."""
        return settings_of(self.study, self.chosen)

    @property
    def found(self) -> Comparison:
        """The tuned settings against those begun with, on the rig that they were tuned on."""
        return self.comparisons[0]


def settings_of(study: Study, candidate: Tried) -> Settings:
    return with_values(study.configuration.controller, study.parameters, candidate.values)


def tuned(
    bench: Bench, seed: int, posterior: Posterior | None = None, stage: Callable[[str], object] = lambda _: None
) -> Outcome:
    """Tunes and judges. posterior: of a diagnosis of the rig; the tuning is then done on the nominal twin too, so that what
    the diagnosis is worth, and what it would cost if it were wrong, is known. stage: called with what begins.

    Raises RigtwinError if no candidate meets the constraints.
    """
    study = bench.study
    rig, name = (nominal, NOMINAL) if posterior is None else (diagnosed(posterior), CALIBRATED)
    stage(f"tuning on the {name}")
    search, points = _searched(bench, rig, seed)
    chosen = _nearest(study, points)
    after = (TUNED, settings_of(study, chosen))
    rivals = [(BEFORE, study.reference)]
    if posterior is not None:
        stage(f"tuning on the {NOMINAL}")
        rivals.append((TUNED_NOMINAL, searched(bench, nominal, seed)))
    comparisons = []
    for where, (of, certain) in _rigs(study, rig, name, posterior).items():
        stage(f"judging on the {where}")
        scenarios = drawn(study, of, study.held_out, APART, certain)
        comparisons += [compared(bench, where, scenarios, rival, after) for rival in rivals]
    on_front = []
    if len(study.minimise) == 2:
        stage("judging the front")
        scenarios = drawn(study, rig, study.held_out, APART)
        for number, point in enumerate(points, start=1):
            on_front.append(compared(bench, name, scenarios, rivals[0], (f"point {number}", settings_of(study, point))))
    tried = tuple(search.tried.values())
    return Outcome(study, seed, name, search.baseline, tried, points, chosen, tuple(comparisons), tuple(on_front))


def searched(bench: Bench, rig: Rig, seed: int) -> Settings:
    """Tuned on a rig, and not judged. Raises RigtwinError if no candidate meets the constraints."""
    return settings_of(bench.study, _nearest(bench.study, _searched(bench, rig, seed)[1]))


def _searched(bench: Bench, rig: Rig, seed: int) -> tuple[Search, tuple[Tried, ...]]:
    search = Search(bench, drawn(bench.study, rig, bench.study.roads, 0), seed)
    if len(bench.study.minimise) == 1:
        return search, (best(search),)
    return search, _thinned(front(search), bench.study.points)


def _thinned(points: tuple[Tried, ...], most: int) -> tuple[Tried, ...]:
    """Evenly many of a front, both ends among them."""
    if len(points) <= most:
        return points
    return tuple(points[index] for index in np.round(np.linspace(0, len(points) - 1, most)).astype(int).tolist())


def _nearest(study: Study, points: tuple[Tried, ...]) -> Tried:
    """Of a front the point nearest to the best in both objectives, each in shares of its range on the front."""
    figures = np.array([[point.figure(measure) for measure in study.minimise] for point in points])
    spans = np.maximum(np.ptp(figures, axis=0), 1e-300)
    return points[int(np.argmin(np.linalg.norm((figures - figures.min(axis=0)) / spans, axis=1)))]


def _rigs(study: Study, rig: Rig, name: str, posterior: Posterior | None) -> dict[str, tuple[Rig, Changes]]:
    """What the result is judged on: the rig as known, the nominal one, the other explanations, and the study's own."""
    rigs: dict[str, tuple[Rig, Changes]] = {name: (rig, NONE)}
    if posterior is not None:
        rigs[NOMINAL] = nominal, NONE
        rigs |= {f"twin with {other.effect} instead": (nominal, other.changes) for other in posterior.otherwise}
    return rigs | {f"rig with {label}": (rig, changes) for label, changes in study.judge.items()}
