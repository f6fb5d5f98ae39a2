"""The benefit of a diagnosis for tuning a controller.

Rigs with a withheld friction are diagnosed from one recording. The controller is tuned on the
corrected twin and on the nominal one, and both results are evaluated on the rig itself.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from controllers import Settings
from referee.defect import Defect
from referee.draw import draw_tolerated, friction
from referee.referee import write
from referee.reference_drive import drive
from referee.reference_rig import Law, run
from referee.reference_truth import Truth
from referee.test_signals import draw_demands
from rigtwin.console import table
from rigtwin.description.posterior import Posterior, load_posterior
from rigtwin.studies.sweep import run_jobs
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.evaluation import SettingsComparison, compare
from rigtwin.studies.tuning.result import BEFORE, TUNED_NOMINAL, find_settings
from rigtwin.studies.tuning.run import Run, figures
from rigtwin.studies.tuning.scenario import APART, NOMINAL, Scenario, calibrated_rig
from rigtwin.studies.tuning.study import Study
from rigtwin.studies.tuning.text import change, percent
from rigtwin.studies.tuning.text import number as number_text

KINDS = ("coulomb", "viscous", "stribeck", "asymmetry")
"""Kinds of friction at the motor, which disturb a force loop most."""
TUNED_CALIBRATED = "tuned on the calibrated twin"


@dataclass(frozen=True)
class TuningCase:
    """One rig, and the benefit of its diagnosis.

    Attributes
    ----------
    number : int
        Number of the rig, from 0.
    defect, sentence : str
        Withheld defect, and the sentence of the diagnosis.
    against_nominal, against_before : SettingsComparison
        Settings tuned on the calibrated twin, compared on the rig with those tuned on the nominal
        twin, and with the baseline.
    """

    number: int
    defect: str
    sentence: str
    against_nominal: SettingsComparison
    against_before: SettingsComparison


@dataclass(frozen=True)
class RigRun:
    """A run on a rig of the referee.

    Attributes
    ----------
    truth : Truth
        Rig.
    run : Run
        Run, as it would be made on the twin.
    """

    truth: Truth
    run: Run

    @property
    def key(self) -> str:
        """Hash of rig and run, under which the result is stored."""
        # The repr of a NamedTuple holds every parameter to the last digit.
        return hashlib.sha256(f"{self.truth!r} {self.run.key}".encode()).hexdigest()[:32]


def draw_rig(seed: int, number: int) -> tuple[Truth, Defect, np.random.Generator]:
    """Draw a rig within its tolerances, with a defect of the motor's friction.

    Returns
    -------
    tuple
        Rig, defect, and the random generator, which continues with the rig's recording.
    """
    random = np.random.default_rng([seed, 6, number])
    # Tolerances differ from rig to rig, as they would in a laboratory.
    plain = draw_tolerated(random)
    drawn = [make() for make in friction("motor", random)]
    # All are drawn, in a fixed order: the random numbers of the recording then do not depend on the
    # kind.
    options = [defect for defect in drawn if defect.kind in KINDS]
    defect = options[number % len(options)]
    truth, _ = defect.change(plain, Law())
    return truth, defect, random


def diagnose_rig(case: tuple[int, int]) -> tuple[str, str]:
    """Diagnose a rig from one recording alone.

    Parameters
    ----------
    case : (int, int)
        Seed and number, as `draw_rig` takes them.

    Returns
    -------
    str, str
        Sentence of the diagnosis, and the file of the corrected twin as text.
    """
    from machines import DEFAULT_MACHINE
    from rigtwin.description.catalogue import find
    from rigtwin.diagnosis.calibrated import toml
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.recording import load

    truth, _, random = draw_rig(*case)
    law, demands = draw_demands("imposed", random)
    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "recording.mcap"
        write(path, law, *run(truth, law, demands, random))
        diagnosis = diagnose(find(DEFAULT_MACHINE), [load(path)])
    return diagnosis.sentence, toml(diagnosis)


def run_on_rig(job: RigRun) -> dict[str, float]:
    """Make a run on a rig and return its measures by name, as for a run on the twin."""
    run, configuration = job.run, job.run.configuration
    demands = run.experiment.demands(configuration, run.seed)
    return figures(run, drive(job.truth, configuration, demands, run.seed))


def check(
    bench: Bench,
    cases: int,
    seed: int,
    stage: Callable[[str], object] = lambda _: None,
    show: Callable[[TuningCase], object] = lambda _: None,
) -> list[TuningCase]:
    """Run the whole check.

    Parameters
    ----------
    bench : Bench
        Workplace of the study's runs.
    cases : int
        Number of rigs.
    seed : int
        Seed of the rigs.
    stage : callable, optional
        Function called with a description of every stage.
    show : callable, optional
        Function called with every finished case.

    Returns
    -------
    list of TuningCase
        All cases.

    Raises
    ------
    RigtwinError
        If a tuning fails.
    """
    stage("tuning on the nominal twin")
    nominal = find_settings(bench, NOMINAL, seed)
    stage("diagnosing")
    jobs = [(f"diagnosis {seed} {number}", (seed, number)) for number in range(cases)]
    run_jobs(bench.store, bench.workers, diagnose_rig, jobs, bench.progress)
    checked = []
    for number, (key, _) in enumerate(jobs):
        sentence, toml = bench.store[key]
        stage(f"rig {number + 1}: tuning on its calibrated twin")
        corrected = find_settings(bench, calibrated_rig(_posterior(toml)), seed)
        truth, defect, _ = draw_rig(seed, number)
        settings = [bench.study.baseline_settings, nominal, corrected]
        before, on_nominal, on_calibrated = _run_all(bench, truth, settings)
        rig, measures = f"rig {number + 1}", bench.study.goals.measures
        after = (TUNED_CALIBRATED, on_calibrated)
        values = f"{number_text(defect.value)}, nominal {number_text(defect.nominal)}"
        case = TuningCase(
            number=number,
            defect=f"{defect.kind}@{defect.component} {values}",
            sentence=sentence,
            against_nominal=compare(measures, rig, (TUNED_NOMINAL, on_nominal), after),
            against_before=compare(measures, rig, (BEFORE, before), after),
        )
        checked.append(case)
        show(case)
    return checked


def _posterior(toml: str) -> Posterior:
    """Return the posterior that a corrected twin's file holds."""
    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "calibrated.toml"
        path.write_text(toml)
        return load_posterior(path)


def _run_all(
    bench: Bench, truth: Truth, candidates: list[Settings]
) -> list[list[dict[str, float]]]:
    """Run every candidate on a rig over the held-out roads; return one row per candidate."""
    base, count = bench.study.configuration, bench.study.budget.held_out
    # Numbers from APART on are roads that no tuning has seen.
    roads = [Scenario(APART + road, base.plant) for road in range(count)]
    jobs = [
        [RigRun(truth, bench.plan(base, candidate, road)) for road in roads]
        for candidate in candidates
    ]
    flat = ((job.key, job) for row in jobs for job in row)
    run_jobs(bench.store, bench.workers, run_on_rig, flat, bench.progress)
    return [[bench.store[job.key] for job in row] for row in jobs]


def text(study: Study, cases: list[TuningCase]) -> str:
    """Return all cases as a table, with the number of rigs that the diagnosis improved."""
    objective = study.goals.minimise[0]
    header = ("rig", "withheld", "tuned on nominal", "on calibrated", "change")
    rows: list[tuple[str, ...]] = [(*header, "95 % of the median", "against before")]
    better = worse = tripped = 0
    for case in cases:
        name = str(case.number + 1)
        trips = [*case.against_nominal.trips, case.against_before.trips[0]]
        # A rig that trips has no comparable figures: the trips are reported instead.
        if max(trips) > 0.0:
            tripped += 1
            summary = f"trips on nominal / calibrated / before: {' / '.join(map(percent, trips))}"
            rows.append((name, case.defect, summary, "", "", "", ""))
            continue
        change_on_rig = case.against_nominal.change_of(objective.name)
        change_from_baseline = case.against_before.change_of(objective.name)
        # Worse only if the whole interval of the change lies above zero.
        better, worse = better + change_on_rig.improved, worse + (change_on_rig.low > 0.0)
        spreads, unit = (change_on_rig.before, change_on_rig.after), objective.unit
        medians = [f"{number_text(spread.median)} {unit}" for spread in spreads]
        rows.append(
            (name, case.defect, *medians, *change(change_on_rig), change(change_from_baseline)[0])
        )
    summary = f"{objective.title} on the rigs themselves: better for the diagnosis on {better}"
    undecided = len(cases) - better - worse - tripped
    remainder = f"no difference to be told on {undecided}, tripped on {tripped}"
    return f"{table(rows)}\n{summary} of {len(cases)}, worse on {worse}, {remainder}"


def document(study: Study, cases: list[TuningCase]) -> list[dict[str, object]]:
    """Return all cases as a JSON document."""
    name = study.goals.minimise[0].name

    def describe(comparison: SettingsComparison) -> dict[str, object] | None:
        if not comparison.changes:
            return None
        return asdict(replace(comparison.change_of(name), measure=None))  # type: ignore[arg-type]

    return [
        {
            "defect": case.defect,
            "diagnosed": case.sentence,
            "against_nominal": describe(case.against_nominal),
            "against_before": describe(case.against_before),
        }
        for case in cases
    ]
