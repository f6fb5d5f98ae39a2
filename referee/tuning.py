"""Whether a diagnosis is worth tuning on: rigs with a friction that is withheld, diagnosed from one recording; the controller
tuned on the twin so corrected, and on the nominal one; both judged on the rig itself."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from controllers import Settings
from referee.draw import Defect, friction, tolerated
from referee.referee import write
from referee.reference_plant import Truth
from referee.reference_rig import Law, run
from referee.test_signals import asked
from rigtwin.console import table
from rigtwin.machine.posterior import load_posterior
from rigtwin.studies.sweep import run_jobs
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.judged import Comparison, comparison
from rigtwin.studies.tuning.outcome import BEFORE, TUNED_NOMINAL, searched
from rigtwin.studies.tuning.run import Run, figures
from rigtwin.studies.tuning.scenario import APART, diagnosed, nominal
from rigtwin.studies.tuning.study import Study
from rigtwin.studies.tuning.text import change

KINDS = ("coulomb", "viscous", "stribeck", "asymmetry")
"""Of friction at the motor, which a force loop feels most."""
TUNED_CALIBRATED = "tuned on the calibrated twin"


@dataclass(frozen=True)
class Case:
    """One rig. defect: what was withheld; found: the diagnosis' sentence; against: the settings tuned on the calibrated twin
    compared on the rig with those tuned on the nominal one, and with those begun with."""

    number: int
    defect: str
    found: str
    against_nominal: Comparison
    against_before: Comparison


def rig(seed: int, number: int) -> tuple[Truth, Defect, np.random.Generator]:
    """A rig within its tolerances with a friction of its own; the random numbers go on to its recording."""
    random = np.random.default_rng([seed, 6, number])
    plain = tolerated(random)
    options = [one for one in (make() for make in friction("motor", random)) if one.kind in KINDS]
    defect = options[number % len(options)]
    truth, _ = defect.change(plain, Law())
    return truth, defect, random


def calibrated(case: tuple[int, int]) -> tuple[str, str]:
    """Of (seed, number): what a diagnosis says that sees one recording alone, and the corrected twin's file."""
    from rigtwin.diagnosis.calibrated import toml
    from rigtwin.diagnosis.diagnose import diagnose
    from rigtwin.machine.configuration import Configuration
    from rigtwin.machine.library import find
    from rigtwin.recording import load
    from rigtwin.recording.channels import SUSPENSION_RIG

    truth, _, random = rig(*case)
    law, demands = asked("imposed", random)
    with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
        path = Path(folder) / "recording.mcap"
        write(path, law, *run(truth, law, demands, random))
        outcome = diagnose(find(SUSPENSION_RIG), [load(path)], Configuration())
    return outcome.diagnosis.sentence, toml(outcome)


@dataclass(frozen=True)
class OnRig:
    """A run to be made on a rig of the referee."""

    truth: Truth
    asked: Run

    @property
    def key(self) -> str:
        return hashlib.sha256(f"{self.truth!r} {self.asked.key}".encode()).hexdigest()[:32]


def on_rig(job: OnRig) -> dict[str, float]:
    """Name → figure, as the twin's runs give it."""
    import experiments
    from referee.reference_drive import driven

    configuration = job.asked.configuration
    demands = experiments.find(job.asked.experiment).demands(configuration, job.asked.seed)
    return figures(job.asked, driven(job.truth, configuration, demands, job.asked.seed))


def checked(
    bench: Bench,
    cases: int,
    seed: int,
    stage: Callable[[str], object] = lambda _: None,
    said: Callable[[Case], object] = lambda _: None,
) -> list[Case]:
    """The whole check; said: called with each case as it is known. Raises RigtwinError where a tuning fails."""
    study = bench.study
    stage("tuning on the nominal twin")
    plain = searched(bench, nominal, seed)
    stage("diagnosing")
    jobs = [(f"diagnosis {seed} {number}", (seed, number)) for number in range(cases)]
    run_jobs(bench.store, bench.workers, calibrated, jobs, bench.progress)
    found = []
    for number, (key, _) in enumerate(jobs):
        sentence, toml = bench.store[key]
        stage(f"rig {number + 1}: tuning on its calibrated twin")
        with TemporaryDirectory(prefix="rigtwin-blindcheck-") as folder:
            path = Path(folder) / "calibrated.toml"
            path.write_text(toml)
            posterior = load_posterior(path)
        corrected = searched(bench, diagnosed(posterior), seed)
        truth, defect, _ = rig(seed, number)
        runs = [[OnRig(truth, run) for run in _runs(study, settings)] for settings in (study.reference, plain, corrected)]
        run_jobs(bench.store, bench.workers, on_rig, ((job.key, job) for row in runs for job in row), bench.progress)
        before, one, other = ([bench.store[job.key] for job in row] for row in runs)
        name = f"rig {number + 1}"
        case = Case(
            number,
            f"{defect.kind}@{defect.component} {defect.value:.4g}, nominal {defect.nominal:.4g}",
            sentence,
            comparison(study.measures, name, (TUNED_NOMINAL, one), (TUNED_CALIBRATED, other)),
            comparison(study.measures, name, (BEFORE, before), (TUNED_CALIBRATED, other)),
        )
        found.append(case)
        said(case)
    return found


def _runs(study: Study, settings: Settings) -> list[Run]:
    names = tuple(measure.name for measure in study.measures)
    configuration = study.configuration._replace(controller=settings)
    return [Run(study.experiment, configuration, APART + road, study.first, names) for road in range(study.held_out)]


def text(study: Study, cases: list[Case]) -> str:
    """All cases as a table, and how many are better for the diagnosis."""
    objective = study.minimise[0]
    rows = [("rig", "withheld", "tuned on nominal", "on calibrated", "change", "95 % of the median", "against before")]
    better = worse = tripped = 0
    for case in cases:
        trips = [*case.against_nominal.trips, case.against_before.trips[0]]
        if max(trips) > 0.0:
            tripped += 1
            shares = " / ".join(f"{100.0 * share:.0f} %" for share in trips)
            said = f"trips on nominal / calibrated / before: {shares}"
            rows.append((str(case.number + 1), case.defect, said, "", "", "", ""))
            continue
        one, begun = case.against_nominal.of(objective.name), case.against_before.of(objective.name)
        better, worse = better + one.improved, worse + (one.low > 0.0)
        figures = f"{one.before.median:.4g} {objective.unit}", f"{one.after.median:.4g} {objective.unit}"
        rows.append((str(case.number + 1), case.defect, *figures, *change(one), change(begun)[0]))
    said = f"{objective.title} on the rigs themselves: better for the diagnosis on {better} of {len(cases)}, worse on {worse}"
    left = len(cases) - better - worse - tripped
    return f"{table(rows)}\n{said}, no difference to be told on {left}, tripped on {tripped}"


def document(study: Study, cases: list[Case]) -> list[dict[str, object]]:
    """All cases for other programs."""
    name = study.minimise[0].name
    return [
        {
            "defect": case.defect,
            "diagnosed": case.found,
            **{
                label: asdict(replace(each.of(name), measure=None)) if each.changes else None  # type: ignore[arg-type]
                for label, each in (("against_nominal", case.against_nominal), ("against_before", case.against_before))
            },
        }
        for case in cases
    ]
