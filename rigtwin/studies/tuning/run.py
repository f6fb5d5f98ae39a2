"""One run of one candidate in one scenario, in any process: its measures, how near to its limits it came, any trip."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass

from rigtwin.machine.configuration import Configuration, flattened
from rigtwin.simulation.peaks import peaks
from rigtwin.simulation.runner import Ran, simulated
from rigtwin.simulation.safety import Trip
from rigtwin.studies.tuning.measures import MEASURES, Trial

LIMITS, TRIP = "limits", "trip"
"""Besides the measures: the largest share of a safety limit that was reached, and the number of a Trip."""


@dataclass(frozen=True)
class Run:
    """seed: of road and noise; first: s, from which on it is judged; measures: by name."""

    experiment: str
    configuration: Configuration
    seed: int
    first: float
    measures: tuple[str, ...]

    @property
    def key(self) -> str:
        """The same for the same run, whoever asks."""
        told = [self.experiment, flattened(self.configuration), self.seed, self.first, sorted(self.measures)]
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:32]


def run(asked: Run) -> dict[str, float]:
    """Name → figure. A run that tripped has no measures: they are not a number."""
    import experiments

    demands = experiments.find(asked.experiment).demands(asked.configuration, asked.seed)
    return figures(asked, simulated(asked.configuration, demands, asked.seed))


def figures(asked: Run, ran: Ran) -> dict[str, float]:
    """The same of a run that was made."""
    configuration = asked.configuration
    reached = max(1.0 - peak.margin for peak in peaks(ran.commands, ran.measurements, configuration))
    found = {LIMITS: reached, TRIP: float(ran.trip)}
    if ran.trip != Trip.NONE:
        return found | dict.fromkeys(asked.measures, math.nan)
    test = Trial(configuration, ran.commands, ran.truth, round(asked.first / configuration.timing.period))
    return found | {name: float(MEASURES[name].of(test)) for name in asked.measures}
