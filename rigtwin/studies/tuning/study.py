"""What to tune, for what, and under which circumstances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from controllers import Settings
from rigtwin.machine.configuration import Configuration, overridden
from rigtwin.studies.tuning.measures import Measure
from rigtwin.studies.tuning.parameter import Parameter

SHIPPED = Path(str(files("experiments"))) / "tuning"


@dataclass(frozen=True)
class Constraint:
    """No more of a measure than a bound in its unit, or of a measure of which more is better no less. share: the bound is this
    share of what the settings begun with have; bound is then not a number."""

    measure: Measure
    bound: float
    share: float = math.nan


@dataclass(frozen=True)
class Study:
    """experiment: by name; configuration: of every run; search: what the search runs differently; baseline: the settings that
    are compared with; minimise: one objective, or two whose front is looked for; limits: share of any safety limit that no run
    may exceed; first: s, from which on a run is judged; roads, held_out: scenarios of search and judgement; quantile: of a
    measure over scenarios; tolerances: half widths of the machine's that scenarios are drawn within; vary:
    `component.parameter` → share of its value, drawn likewise; judge: name → changes of the rig to judge on besides."""

    name: str
    title: str
    experiment: str
    configuration: Configuration
    search: Mapping[str, Mapping[str, object]]
    baseline: Mapping[str, Mapping[str, object]]
    parameters: tuple[Parameter, ...]
    minimise: tuple[Measure, ...]
    constraints: tuple[Constraint, ...]
    report: tuple[Measure, ...]
    limits: float
    first: float
    roads: int
    held_out: int
    quantile: float
    evaluations: int
    points: int
    tolerances: float
    vary: Mapping[str, float]
    judge: Mapping[str, Mapping[str, Mapping[str, object]]] = field(default_factory=dict)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """All that its runs are judged by, the objectives first."""
        every = (*self.minimise, *(each.measure for each in self.constraints), *self.report)
        return tuple(dict.fromkeys(every))

    @property
    def reference(self) -> Settings:
        """The settings that are compared with."""
        return overridden(self.configuration, self.baseline).controller

    @property
    def searched(self) -> Configuration:
        """What a search runs: perhaps shorter or coarser than what is judged."""
        return overridden(self.configuration, self.search)


def shipped() -> dict[str, Path]:
    """Name → file of the studies that come along."""
    return {path.stem: path for path in sorted(SHIPPED.glob("*.toml"))}
