"""One run of one candidate in one scenario, in any process."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass

from rigtwin.description.configuration import Configuration, flatten
from rigtwin.simulation.experiment import Experiment
from rigtwin.simulation.peaks import peaks
from rigtwin.simulation.runner import SimulationResult, simulate
from rigtwin.simulation.safety import Trip
from rigtwin.studies.tuning.measures import MEASURES, Trial

LIMITS, TRIP = "limits", "trip"
"""Besides the measures: the largest share of a safety limit reached, and the number of a Trip."""


@dataclass(frozen=True)
class Run:
    """A run to be made.

    Parameters
    ----------
    experiment : Experiment
        The test.
    configuration : Configuration
        What it is run with.
    seed : int
        Of road and noise.
    first : float
        s, from which on it is measured.
    measures : tuple of str
        Names of `MEASURES`.
    """

    experiment: Experiment
    configuration: Configuration
    seed: int
    first: float
    measures: tuple[str, ...]

    @property
    def key(self) -> str:
        """The same for the same run, whoever asks."""
        told = [
            self.experiment.name,
            flatten(self.configuration),
            self.seed,
            self.first,
            sorted(self.measures),
        ]
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:32]


def run(job: Run) -> dict[str, float]:
    """Make a run on the twin.

    Returns
    -------
    dict
        Name → figure, of the measures, LIMITS and TRIP. The measures of a run that tripped are
        not numbers.
    """
    demands = job.experiment.demands(job.configuration, job.seed)
    return figures(job, simulate(job.configuration, demands, job.seed))


def figures(job: Run, ran: SimulationResult) -> dict[str, float]:
    """Name → figure of a run that was made, as `run` gives it."""
    configuration = job.configuration
    shares = (1.0 - peak.margin for peak in peaks(ran.commands, ran.measurements, configuration))
    found = {LIMITS: max(shares), TRIP: float(ran.trip)}
    if ran.trip != Trip.NONE:
        return found | dict.fromkeys(job.measures, math.nan)
    first = round(job.first / configuration.timing.period)
    trial = Trial(configuration, ran.commands, ran.truth, first)
    return found | {name: float(MEASURES[name].of(trial)) for name in job.measures}
