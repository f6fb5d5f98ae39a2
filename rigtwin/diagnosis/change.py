"""What several recordings of one machine say together, as frozen data and as JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from rigtwin.diagnosis.finding import Interval, Name
from rigtwin.diagnosis.homogeneity import Trend
from rigtwin.diagnosis.result import Diagnosis

Sameness = Literal["same", "changed", "cannot tell"]


@dataclass(frozen=True)
class Parameter:
    """One parameter in every recording. values: with 95 % intervals, in `unit`; statistic:
    Cochran's Q; probability: of one as large if nothing changed, corrected for the number of
    parameters; verdict: whether it is the same; why: in words where nobody can tell; trends: what a
    change may go with, the likeliest first; named: whether the first is it; instead: effects whose
    change would explain as much."""

    name: Name
    parameter: str
    unit: str
    values: tuple[Interval, ...]
    statistic: float
    probability: float
    verdict: Sameness
    why: str = ""
    trends: tuple[Trend, ...] = ()
    named: bool = False
    instead: tuple[Name, ...] = ()


@dataclass(frozen=True)
class Changes:
    """What changed between recordings. parameters: those that changed first, then those that the
    diagnosis of all together names; unseen: effects of which these cannot tell; zeros: of sensors
    that differ, which is no change of the machine; covariates: quantity → its value in each
    recording; together: the diagnosis of all, their zeros taken off."""

    recordings: tuple[str, ...]
    sentence: str
    parameters: tuple[Parameter, ...]
    unseen: tuple[Name, ...]
    zeros: dict[str, tuple[float, ...]]
    covariates: dict[str, tuple[float, ...]]
    tested: int
    seconds: float
    together: Diagnosis

    @property
    def changed(self) -> tuple[Parameter, ...]:
        """The parameters that are not the same in all recordings."""
        return tuple(each for each in self.parameters if each.verdict == "changed")

    def document(self) -> dict[str, Any]:
        """What JSON has of it."""
        return {
            "sentence": self.sentence,
            "recordings": list(self.recordings),
            "parameters": [asdict(each) for each in self.parameters],
            "cannot_tell": [asdict(each) for each in self.unseen],
            "zeros": {name: list(values) for name, values in self.zeros.items()},
            "covariates": {name: list(values) for name, values in self.covariates.items()},
            "tested": self.tested,
            "seconds": self.seconds,
            "together": self.together.document(),
        }

    def __str__(self) -> str:
        from rigtwin.diagnosis.changes_text import describe_changes  # Late: it knows this type.

        return describe_changes(self)
