"""Simulation of one candidate in one scenario, in any process."""

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
from rigtwin.simulation.structure_motion import models_output
from rigtwin.simulation.trip import Trip
from rigtwin.studies.tuning.measures import Measure, RigTrial, Trial

LIMITS, TRIP = "limits", "trip"
"""Figures beside the measures: the largest share of a safety limit reached, and the number of a
Trip."""


@dataclass(frozen=True)
class Run:
    """Specification of a run.

    Parameters
    ----------
    machine : str
        Path of the machine's description.
    experiment : Experiment
        Experiment of the run.
    configuration : Configuration
        Configuration of the run.
    seed : int
        Seed of road and noise.
    first : float
        Time at which measuring begins, in s.
    measures : tuple of Measure
        Measures of the run.
    """

    machine: str
    experiment: Experiment
    configuration: Configuration
    seed: int
    first: float
    measures: tuple[Measure, ...]

    @property
    def key(self) -> str:
        """Digest that identifies the run in a store, equal for equal runs."""
        identity = [
            self.experiment.name,
            flatten(self.configuration),
            self.seed,
            self.first,
            sorted(f"{measure.name} {measure.definition}" for measure in self.measures),
        ]
        # Settings are hashed by value, so that equal runs of different studies share a result.
        return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:32]


find_once = lru_cache(maxsize=4)(find)
"""Function that reads a machine by name or path, cached within a process."""


def run(job: Run) -> dict[str, float]:
    """Simulate a run on the twin.

    Returns
    -------
    dict
        Figures by name: measures, LIMITS and TRIP. Measures are NaN if the run tripped or the
        machine diverged.
    """
    machine = find_once(job.machine)
    demands = job.experiment.demands(job.configuration, job.seed)
    return machine.physics.figures(machine, job, demands)


def figures(job: Run, ran: SimulationResult) -> dict[str, float]:
    """Return the figures of a run of the suspension rig, as `run` does."""
    # A margin of 0 is at the limit; the share reached is its complement.
    shares = (
        1.0 - peak.margin for peak in peaks(ran.commands, ran.measurements, job.configuration)
    )
    result = {LIMITS: max(shares), TRIP: float(ran.trip)}
    if ran.trip != Trip.NONE:
        return result | _no_measures(job)
    # The models' output, not the compensated command, is compared with the ideal vehicle.
    asked = models_output(job.configuration, ran.commands, ran.measurements)
    trial = rig_trial(job.configuration, asked, ran.truth, _first(job))
    return result | _measure(job, trial)


def rig_trial(
    configuration: Configuration, commands: Array, sensed: Array, first: int = 0
) -> RigTrial:
    """Return a trial of the suspension rig.

    Parameters
    ----------
    configuration
        Configuration of the test.
    commands
        Output of the rig's models, shape (ticks, 4), in the order of `controllers.Commands`.
    sensed
        Sensors, shape (ticks, 4), in the order of `controllers.Measurements`.
    first
        First tick that is measured.
    """
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
        return {LIMITS: RUNAWAY, TRIP: 1.0} | _no_measures(job)
    result = {
        LIMITS: largest_reach(machine, job.configuration, columns),
        TRIP: float(trip is not None),
    }
    # Figures of an aborted test are of a shorter one, and would look better than complete ones.
    if trip is not None:
        return result | _no_measures(job)
    return result | _measure(job, Trial(job.configuration, columns, _first(job)))


def _first(job: Run) -> int:
    """Return the first tick that is measured."""
    return round(job.first / job.configuration.timing.period)


def _no_measures(job: Run) -> dict[str, float]:
    """Return NaN for every measure of a run that did not complete."""
    return {measure.name: math.nan for measure in job.measures}


def _measure(job: Run, trial: Trial) -> dict[str, float]:
    return {measure.name: float(measure.compute(trial)) for measure in job.measures}
