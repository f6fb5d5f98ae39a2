"""One run of one candidate in one scenario, in any process."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from controllers import Commands, Measurements
from rigtwin.description.catalogue import find
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.limits import largest_reach
from rigtwin.description.machine import Machine
from rigtwin.models.machine_twin import RunsAway, simulate_machine
from rigtwin.numerics.arrays import RUNAWAY, Array
from rigtwin.simulation.experiment import Experiment
from rigtwin.simulation.peaks import peaks
from rigtwin.simulation.runner import SimulationResult
from rigtwin.simulation.safety import Trip
from rigtwin.simulation.structure_motion import models_output
from rigtwin.studies.tuning.measures import Measure, RigTrial, Trial

LIMITS, TRIP = "limits", "trip"
"""Besides the measures: the largest share of a safety limit reached, and the number of a Trip."""


@dataclass(frozen=True)
class Run:
    """A run to be made.

    Parameters
    ----------
    machine : str
        Path of the description of that whose twin is run.
    experiment : Experiment
        The test.
    configuration : Configuration
        What it is run with.
    seed : int
        Of road and noise.
    first : float
        s, from which on it is measured.
    measures : tuple of Measure
        What it is measured by.
    """

    machine: str
    experiment: Experiment
    configuration: Configuration
    seed: int
    first: float
    measures: tuple[Measure, ...]

    @property
    def key(self) -> str:
        """The same for the same run, whoever asks."""
        told = [
            self.experiment.name,
            flatten(self.configuration),
            self.seed,
            self.first,
            sorted(f"{measure.name} {measure.told}" for measure in self.measures),
        ]
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:32]


find_once = lru_cache(maxsize=4)(find)
"""A machine by name or path, read once a process."""


def run(job: Run) -> dict[str, float]:
    """Make a run on the twin.

    Returns
    -------
    dict
        Name → figure, of the measures, LIMITS and TRIP. The measures of a run that tripped, or of a
        machine that ran away, are not numbers.
    """
    machine = find_once(job.machine)
    demands = job.experiment.demands(job.configuration, job.seed)
    return machine.physics.figures(machine, job, demands)


def figures(job: Run, ran: SimulationResult) -> dict[str, float]:
    """Name → figure of a run of the suspension rig, as `run` gives it."""
    shares = (
        1.0 - peak.margin for peak in peaks(ran.commands, ran.measurements, job.configuration)
    )
    found = {LIMITS: max(shares), TRIP: float(ran.trip)}
    if ran.trip != Trip.NONE:
        return found | _nothing(job)
    asked = models_output(job.configuration, ran.commands, ran.measurements)
    trial = rig_trial(job.configuration, asked, ran.truth, _first(job))
    return found | _measure(job, trial)


def rig_trial(
    configuration: Configuration, commands: Array, sensed: Array, first: int = 0
) -> RigTrial:
    """A test of the suspension rig. commands: what its models asked for; sensed: both of shape
    (ticks, 4), columns of `controllers.Commands` and `.Measurements`."""
    columns = {
        "/command": dict(zip(Commands._fields, commands.T, strict=True)),
        "/sensor": dict(zip(Measurements._fields, sensed.T, strict=True)),
    }
    return RigTrial(configuration, columns, first)


def figures_of_joints(machine: Machine, job: Run, demands: Mapping[str, Array]) -> dict[str, float]:
    """Return name → figure of a run of a machine made of joints, as `run` gives it."""
    try:
        columns, trip = simulate_machine(machine, job.configuration, demands, job.seed)
    except RunsAway:
        return {LIMITS: RUNAWAY, TRIP: 1.0} | _nothing(job)
    found = {
        LIMITS: largest_reach(machine, job.configuration, columns),
        TRIP: float(trip is not None),
    }
    if trip is not None:
        return found | _nothing(job)
    return found | _measure(job, Trial(job.configuration, columns, _first(job)))


def _first(job: Run) -> int:
    return round(job.first / job.configuration.timing.period)


def _nothing(job: Run) -> dict[str, float]:
    return {measure.name: math.nan for measure in job.measures}


def _measure(job: Run, trial: Trial) -> dict[str, float]:
    return {measure.name: float(measure.of(trial)) for measure in job.measures}
