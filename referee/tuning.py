"""Whether a diagnosis is worth tuning on.

Rigs with a friction that is withheld are diagnosed from one recording; the controller is tuned on
the twin so corrected, and on the nominal one; both are evaluated on the rig itself.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from controllers import Settings
from referee.draw import Defect, draw_tolerated, friction
from referee.referee import write
from referee.reference_drive import drive
from referee.reference_plant import Truth
from referee.reference_rig import Law, run
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
"""Of friction at the motor, which a force loop feels most."""
TUNED_CALIBRATED = "tuned on the calibrated twin"


@dataclass(frozen=True)
class Case:
    """One rig, and what its diagnosis was worth.

    Parameters
    ----------
    number : int
        Which rig.
    defect, found : str
        What was withheld, and the diagnosis' sentence.
    against_nominal, against_before : SettingsComparison
        The settings tuned on the calibrated twin compared on the rig with those tuned on the
        nominal one, and with the baseline.
    """

    number: int
    defect: str
    found: str
    against_nominal: SettingsComparison
    against_before: SettingsComparison


@dataclass(frozen=True)
class RigRun:
    """A run to be made on a rig of the referee.

    Parameters
    ----------
    truth : Truth
        The rig.
    run : Run
        As it would be made on the twin.
    """

    truth: Truth
    run: Run

    @property
    def key(self) -> str:
        """The same for the same run, whoever asks."""
        return hashlib.sha256(f"{self.truth!r} {self.run.key}".encode()).hexdigest()[:32]


def draw_rig(seed: int, number: int) -> tuple[Truth, Defect, np.random.Generator]:
    """Draw a rig within its tolerances with a friction of its own.

    Returns
    -------
    Truth, Defect, Generator
        The random numbers go on to the rig's recording.
    """
    random = np.random.default_rng([seed, 6, number])
    plain = draw_tolerated(random)
    options = [one for one in (make() for make in friction("motor", random)) if one.kind in KINDS]
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
        What the diagnosis says, and the corrected twin's file.
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
        found = diagnose(find(DEFAULT_MACHINE), [load(path)])
    return found.sentence, toml(found)


def run_on_rig(job: RigRun) -> dict[str, float]:
    """Make a run on a rig: name → figure, as the twin's runs give it."""
    asked, configuration = job.run, job.run.configuration
    demands = asked.experiment.demands(configuration, asked.seed)
    return figures(asked, drive(job.truth, configuration, demands, asked.seed))


def check(
    bench: Bench,
    cases: int,
    seed: int,
    stage: Callable[[str], object] = lambda _: None,
    show: Callable[[Case], object] = lambda _: None,
) -> list[Case]:
    """Make the whole check.

    Parameters
    ----------
    bench : Bench
        Where the study's runs are made.
    cases : int
        Rigs.
    seed : int
        That they are drawn from.
    stage : callable, optional
        Called with what begins.
    show : callable, optional
        Called with each case as it is known.

    Raises
    ------
    RigtwinError
        Where a tuning fails.
    """
    stage("tuning on the nominal twin")
    plain = find_settings(bench, NOMINAL, seed)
    stage("diagnosing")
    jobs = [(f"diagnosis {seed} {number}", (seed, number)) for number in range(cases)]
    run_jobs(bench.store, bench.workers, diagnose_rig, jobs, bench.progress)
    found = []
    for number, (key, _) in enumerate(jobs):
        sentence, toml = bench.store[key]
        stage(f"rig {number + 1}: tuning on its calibrated twin")
        corrected = find_settings(bench, calibrated_rig(_posterior(toml)), seed)
        truth, defect, _ = draw_rig(seed, number)
        settings = [bench.study.baseline_settings, plain, corrected]
        before, one, other = _run_all(bench, truth, settings)
        rig, measures = f"rig {number + 1}", bench.study.goals.measures
        after = (TUNED_CALIBRATED, other)
        values = f"{number_text(defect.value)}, nominal {number_text(defect.nominal)}"
        case = Case(
            number=number,
            defect=f"{defect.kind}@{defect.component} {values}",
            found=sentence,
            against_nominal=compare(measures, rig, (TUNED_NOMINAL, one), after),
            against_before=compare(measures, rig, (BEFORE, before), after),
        )
        found.append(case)
        show(case)
    return found


def _posterior(toml: str) -> Posterior:
    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "calibrated.toml"
        path.write_text(toml)
        return load_posterior(path)


def _run_all(
    bench: Bench,
    truth: Truth,
    candidates: list[Settings],
) -> list[list[dict[str, float]]]:
    """Run every candidate on a rig over the study's held-out roads, a row a candidate."""
    base, count = bench.study.configuration, bench.study.budget.held_out
    roads = [Scenario(APART + road, base.plant) for road in range(count)]
    jobs = [[RigRun(truth, bench.plan(base, one, road)) for road in roads] for one in candidates]
    flat = ((job.key, job) for row in jobs for job in row)
    run_jobs(bench.store, bench.workers, run_on_rig, flat, bench.progress)
    return [[bench.store[job.key] for job in row] for row in jobs]


def text(study: Study, cases: list[Case]) -> str:
    """All cases as a table, and how many are better for the diagnosis."""
    objective = study.goals.minimise[0]
    header = ("rig", "withheld", "tuned on nominal", "on calibrated", "change")
    rows: list[tuple[str, ...]] = [(*header, "95 % of the median", "against before")]
    better = worse = tripped = 0
    for case in cases:
        name = str(case.number + 1)
        trips = [*case.against_nominal.trips, case.against_before.trips[0]]
        if max(trips) > 0.0:
            tripped += 1
            said = f"trips on nominal / calibrated / before: {' / '.join(map(percent, trips))}"
            rows.append((name, case.defect, said, "", "", "", ""))
            continue
        one = case.against_nominal.change_of(objective.name)
        begun = case.against_before.change_of(objective.name)
        better, worse = better + one.improved, worse + (one.low > 0.0)
        spreads, unit = (one.before, one.after), objective.unit
        medians = [f"{number_text(each.median)} {unit}" for each in spreads]
        rows.append((name, case.defect, *medians, *change(one), change(begun)[0]))
    said = f"{objective.title} on the rigs themselves: better for the diagnosis on {better}"
    left = len(cases) - better - worse - tripped
    rest = f"no difference to be told on {left}, tripped on {tripped}"
    return f"{table(rows)}\n{said} of {len(cases)}, worse on {worse}, {rest}"


def document(study: Study, cases: list[Case]) -> list[dict[str, object]]:
    """All cases for other programs."""
    name = study.goals.minimise[0].name

    def describe(comparison: SettingsComparison) -> dict[str, object] | None:
        if not comparison.changes:
            return None
        return asdict(replace(comparison.change_of(name), measure=None))  # type: ignore[arg-type]

    return [
        {
            "defect": case.defect,
            "diagnosed": case.found,
            "against_nominal": describe(case.against_nominal),
            "against_before": describe(case.against_before),
        }
        for case in cases
    ]
