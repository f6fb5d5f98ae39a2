"""Result of a comparison of several recordings of one machine, as frozen data and as JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from rigtwin.diagnosis.finding import Name
from rigtwin.diagnosis.gap import Interval
from rigtwin.diagnosis.homogeneity import Trend
from rigtwin.diagnosis.result import Diagnosis

Sameness = Literal["same", "changed", "cannot tell"]


@dataclass(frozen=True)
class ComparedParameter:
    """One parameter of an effect in every recording.

    Attributes
    ----------
    name
        Effect that has the parameter.
    parameter
        Name of the parameter.
    unit
        SI unit of the values.
    values
        Value in each recording, with an interval of `Thresholds.wider` standard errors to either
        side. Empty where the recordings do not determine it.
    statistic
        Cochran's Q of the values.
    probability
        Probability of a Q as large if all values are equal, corrected for the number of parameters.
    verdict
        Whether the parameter is the same in all recordings.
    why
        Reason where that cannot be decided.
    trends
        Quantities that a change may follow, the likeliest first.
    named
        Whether the first trend is clearly the best.
    alternatives
        Effects whose change would explain the recordings equally well (`instead` in JSON).
    """

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
    alternatives: tuple[Name, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return the parameter as JSON has it."""
        document = asdict(self)
        document["instead"] = document.pop("alternatives")
        return document


@dataclass(frozen=True)
class Changes:
    """Changes between recordings of one machine.

    Attributes
    ----------
    recordings
        Paths of the recordings, in the order of time.
    sentence
        The answer on one line.
    parameters
        Parameters that changed, then those of the effects that the joint diagnosis names.
    undetermined
        Effects for which these recordings cannot show a change (`cannot_tell` in JSON).
    zeros
        Sensor → deviation of its zero from the mean in each recording, SI. A zero that differs is
        no change of the machine.
    covariates
        Quantity that a change may follow → its value in each recording.
    tested
        Number of parameters that were tested.
    seconds
        Duration of the comparison, s.
    together
        Joint diagnosis of all recordings, with the zeros of the sensors subtracted.
    """

    recordings: tuple[str, ...]
    sentence: str
    parameters: tuple[ComparedParameter, ...]
    undetermined: tuple[Name, ...]
    zeros: dict[str, tuple[float, ...]]
    covariates: dict[str, tuple[float, ...]]
    tested: int
    seconds: float
    together: Diagnosis

    @property
    def changed(self) -> tuple[ComparedParameter, ...]:
        """Parameters that are not the same in all recordings."""
        return tuple(each for each in self.parameters if each.verdict == "changed")

    def document(self) -> dict[str, Any]:
        """Return the JSON document."""
        return {
            "sentence": self.sentence,
            "recordings": list(self.recordings),
            "parameters": [parameter.document() for parameter in self.parameters],
            "cannot_tell": [asdict(name) for name in self.undetermined],
            "zeros": {name: list(values) for name, values in self.zeros.items()},
            "covariates": {name: list(values) for name, values in self.covariates.items()},
            "tested": self.tested,
            "seconds": self.seconds,
            "together": self.together.document(),
        }

    def __str__(self) -> str:
        # Imported here, because that module needs this class.
        from rigtwin.diagnosis.changes_text import describe_changes

        return describe_changes(self)
