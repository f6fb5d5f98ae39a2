"""A whole study: searched on the rig as it is known, and judged on what the search has not seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controllers import Settings
from rigtwin.machine.posterior import Changes, Posterior
from rigtwin.studies.tuning.bench import Bench, Worth
from rigtwin.studies.tuning.judged import Comparison, compared
from rigtwin.studies.tuning.parameter import with_values
from rigtwin.studies.tuning.scenario import APART, NONE, Rig, diagnosed, drawn, nominal
from rigtwin.studies.tuning.search import Search, Tried, best, front
from rigtwin.studies.tuning.study import Study

NOMINAL, CALIBRATED = "nominal twin", "calibrated twin"
TUNED, BEFORE, TUNED_NOMINAL = "tuned", "before", "tuned on the nominal twin"


@dataclass(frozen=True)
class Outcome:
    """rig: what was tuned on; tried: every candidate, in the order tried; front: with two objectives those that none beats,
    thinned to the study's number of points, else the best alone; chosen: the one to be used, of a front the one nearest to the
    best in both; comparisons: on held-out scenarios; on_front: each point of a front with the settings begun with, likewise;
    alike: whether nothing but noise differs between scenarios."""

    study: Study
    seed: int
    rig: str
    baseline: Worth
    tried: tuple[Tried, ...]
    front: tuple[Tried, ...]
    chosen: Tried
    comparisons: tuple[Comparison, ...]
    on_front: tuple[Comparison, ...]
    alike: bool = False

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
    search, every = _searched(bench, rig, seed)
    chosen, points = _nearest(search, every), _thinned(every, study.points)
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
    tried, same = tuple(search.tried.values()), _alike(study, rig)
    both = tuple(comparisons), tuple(on_front)
    return Outcome(study, seed, name, search.baseline, tried, points, chosen, *both, same)


def searched(bench: Bench, rig: Rig, seed: int) -> Settings:
    """Tuned on a rig, and not judged. Raises RigtwinError if no candidate meets the constraints."""
    return settings_of(bench.study, _nearest(*_searched(bench, rig, seed)))


def _searched(bench: Bench, rig: Rig, seed: int) -> tuple[Search, tuple[Tried, ...]]:
    search = Search(bench, drawn(bench.study, rig, bench.study.roads, 0), seed)
    if len(bench.study.minimise) == 1:
        return search, (best(search),)
    return search, front(search)


def _alike(study: Study, rig: Rig) -> bool:
    """Whether no road, no tolerance and nothing that varies tells one scenario from another."""
    import experiments

    demands = experiments.find(study.experiment).demands
    one, other = drawn(study, rig, 2, APART)
    return np.array_equal(demands(study.searched, 0), demands(study.searched, APART)) and one.plant == other.plant


def _thinned(points: tuple[Tried, ...], most: int) -> tuple[Tried, ...]:
    """Evenly many of a front, both ends among them."""
    if len(points) <= most:
        return points
    return tuple(points[index] for index in np.round(np.linspace(0, len(points) - 1, most)).astype(int).tolist())


def _nearest(search: Search, points: tuple[Tried, ...]) -> Tried:
    """Of a front the point nearest to the best in both objectives, each in shares of what the baseline has."""
    measures = search.study.minimise
    figures = np.array([[point.figure(measure) for measure in measures] for point in points])
    before = np.abs([search.baseline.figures[measure.name] for measure in measures])
    scales = np.where(np.isfinite(before) & (before > 0.0), before, np.maximum(np.ptp(figures, axis=0), 1e-300))
    return points[int(np.argmin(np.linalg.norm((figures - figures.min(axis=0)) / scales, axis=1)))]


def _rigs(study: Study, rig: Rig, name: str, posterior: Posterior | None) -> dict[str, tuple[Rig, Changes]]:
    """What the result is judged on: the rig as known, the nominal one, the other explanations, and the study's own."""
    rigs: dict[str, tuple[Rig, Changes]] = {name: (rig, NONE)}
    if posterior is not None:
        rigs[NOMINAL] = nominal, NONE
        for number, other in enumerate(posterior.otherwise):
            twice = any(one.effect == other.effect for one in posterior.otherwise[:number])
            rigs[f"twin with {other.effect} instead{f' ({number + 1})' if twice else ''}"] = nominal, other.changes
    return rigs | {f"rig with {label}": (rig, changes) for label, changes in study.judge.items()}
