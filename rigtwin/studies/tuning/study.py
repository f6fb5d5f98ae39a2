"""Definition of a tuning study: parameters, goals, budget, and variation of the rig."""

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
from rigtwin.studies.tuning.parameter import TuningParameter

Changes = Mapping[str, Mapping[str, object]]
"""Group → name → value of changed settings."""


@dataclass(frozen=True)
class Constraint:
    """Upper bound on a measure; a lower bound if more of it is better.

    Parameters
    ----------
    measure : Measure
        Measure with the bound.
    bound : float
        Bound in the measure's unit; NaN if `share` defines it.
    share : float, optional
        Bound as a share of the baseline's figure.
    """

    measure: Measure
    bound: float
    share: float = math.nan


@dataclass(frozen=True)
class Goals:
    """Goals of a study.

    Parameters
    ----------
    minimise : tuple of Measure
        One objective, or two whose Pareto front is computed.
    constraints : tuple of Constraint
        Constraints on other measures.
    limits : float
        Share of any safety limit that no run may exceed.
    report : tuple of Measure, optional
        Further measures that are reported.
    """

    minimise: tuple[Measure, ...]
    constraints: tuple[Constraint, ...]
    limits: float
    report: tuple[Measure, ...] = ()

    @property
    def measures(self) -> tuple[Measure, ...]:
        """All measures of a run, the objectives first, without repetition."""
        constrained = (constraint.measure for constraint in self.constraints)
        return tuple(dict.fromkeys((*self.minimise, *constrained, *self.report)))


@dataclass(frozen=True)
class Budget:
    """Numbers of runs.

    Parameters
    ----------
    roads : int
        Number of scenarios of the search.
    held_out : int
        Number of scenarios of the evaluation.
    evaluations : int
        Approximate number of candidates the search may try.
    points : int
        Maximum number of points of a front that are evaluated.
    """

    roads: int
    held_out: int
    evaluations: int
    points: int


@dataclass(frozen=True)
class Variation:
    """Variation of the rig between scenarios, uniform about its values.

    Parameters
    ----------
    tolerances : float
        Half width of the variation, in half widths of the machine's tolerances.
    shares : mapping
        `component.parameter` → half width as a share of its value.
    """

    tolerances: float = 0.0
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """Tuning study: what is tuned, for which goals, and under which circumstances.

    Parameters
    ----------
    name, title : str
        Name, and title in words.
    machine : Machine
        Machine whose twin is simulated.
    experiment : Experiment
        Experiment that is simulated.
    configuration : Configuration
        Configuration of every run.
    search_changes : mapping
        Settings that differ in the search's runs.
    baseline_changes : mapping
        Settings that differ in the baseline.
    parameters : tuple of Parameter
        Tuning parameters.
    goals : Goals
        Goals of the tuning.
    budget : Budget
        Numbers of runs.
    first : float
        Time at which measuring begins, in s.
    quantile : float
        Quantile of a measure over scenarios that settings are scored by.
    variation : Variation, optional
        Variation of the rig between scenarios.
    other_rigs : mapping, optional
        Name → changes of further rigs to evaluate on.
    """

    name: str
    title: str
    machine: Machine
    experiment: Experiment
    configuration: Configuration
    search_changes: Changes
    baseline_changes: Changes
    parameters: tuple[TuningParameter, ...]
    goals: Goals
    budget: Budget
    first: float
    quantile: float
    variation: Variation = Variation()
    other_rigs: Mapping[str, Changes] = field(default_factory=dict)

    @property
    def baseline_settings(self) -> Any:
        """Settings of the baseline controller, a NamedTuple."""
        # Changes apply to the study's configuration, so the baseline shares all its other
        # settings.
        return override(self.configuration, self.baseline_changes).controller

    @property
    def search_configuration(self) -> Configuration:
        """Configuration of the search's runs, which may be shorter or coarser than evaluation."""

        return override(self.configuration, self.search_changes)
