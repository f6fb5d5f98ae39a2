"""What to tune, for what, and under which circumstances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.simulation.experiment import Experiment
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import Parameter

Changes = Mapping[str, Mapping[str, object]]
"""Group → name → value."""


@dataclass(frozen=True)
class Constraint:
    """No more of a measure than a bound; of one of which more is better, no less.

    Parameters
    ----------
    measure : Measure
        What is bounded.
    bound : float
        In the measure's unit; not a number if `share` says it.
    share : float, optional
        The bound as a share of what the baseline has.
    """

    measure: Measure
    bound: float
    share: float = math.nan


@dataclass(frozen=True)
class Goals:
    """What the settings are tuned for.

    Parameters
    ----------
    minimise : tuple of Measure
        One objective, or two whose front is looked for.
    constraints : tuple of Constraint
        What the settings are held to besides.
    limits : float
        Share of any safety limit that no run may exceed.
    report : tuple of Measure, optional
        Measures that are told besides.
    """

    minimise: tuple[Measure, ...]
    constraints: tuple[Constraint, ...]
    limits: float
    report: tuple[Measure, ...] = ()

    @property
    def measures(self) -> tuple[Measure, ...]:
        """All that a run is measured by, the objectives first."""
        constrained = (each.measure for each in self.constraints)
        return tuple(dict.fromkeys((*self.minimise, *constrained, *self.report)))


@dataclass(frozen=True)
class Budget:
    """How much is run.

    Parameters
    ----------
    roads : int
        Scenarios of the search.
    held_out : int
        Scenarios of the evaluation.
    evaluations : int
        Candidates that the search may try, about.
    points : int
        Of a front that are evaluated, at most.
    """

    roads: int
    held_out: int
    evaluations: int
    points: int


@dataclass(frozen=True)
class Variation:
    """How a rig differs from scenario to scenario, uniformly about its values.

    Parameters
    ----------
    tolerances : float
        Half widths of the machine's tolerances.
    shares : mapping
        `component.parameter` → share of its value.
    """

    tolerances: float = 0.0
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """What to tune, for what, and under which circumstances.

    Parameters
    ----------
    name, title : str
        What it is called, and what it is in words.
    machine : Machine
        Whose twin is run.
    experiment : Experiment
        The test that is run.
    configuration : Configuration
        Of every run.
    search_changes : mapping
        What the search runs differently.
    baseline_changes : mapping
        What the settings that are compared with have differently.
    parameters : tuple of Parameter
        What is tuned.
    goals : Goals
        What it is tuned for.
    budget : Budget
        How much is run.
    first : float
        s, from which on a run is measured.
    quantile : float
        Of a measure over scenarios: what settings are scored by.
    variation : Variation, optional
        How the rig differs from scenario to scenario.
    other_rigs : mapping, optional
        Name → changes of the rig to evaluate on besides.
    """

    name: str
    title: str
    machine: Machine
    experiment: Experiment
    configuration: Configuration
    search_changes: Changes
    baseline_changes: Changes
    parameters: tuple[Parameter, ...]
    goals: Goals
    budget: Budget
    first: float
    quantile: float
    variation: Variation = Variation()
    other_rigs: Mapping[str, Changes] = field(default_factory=dict)

    @property
    def baseline_settings(self) -> Any:
        """The settings of the controller that is compared with, a NamedTuple."""
        return override(self.configuration, self.baseline_changes).controller

    @property
    def search_configuration(self) -> Configuration:
        """What a search runs: perhaps shorter or coarser than what is evaluated."""
        return override(self.configuration, self.search_changes)
