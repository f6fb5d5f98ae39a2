"""Findings of a diagnosis as frozen data: effects with their estimates, places and leftovers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rigtwin.diagnosis.support import Support


@dataclass(frozen=True)
class Estimate:
    """Estimated value of a parameter with its interval.

    The interval spans `Thresholds.wider` standard errors to either side. How often such an interval
    holds the true value was measured and is published in docs/confidence.md.

    Attributes
    ----------
    value
        Best estimate, in `unit`.
    low, high
        Ends of the interval, in `unit`.
    nominal
        Value that the uncorrected twin uses, in `unit`.
    unit
        SI unit of all four numbers; "1" for a ratio.
    """

    value: float
    low: float
    high: float
    nominal: float
    unit: str


@dataclass(frozen=True)
class Name:
    """A kind of effect at a component, written `kind@component`."""

    component: str
    kind: str

    def __str__(self) -> str:
        return f"{self.kind}@{self.component}"


@dataclass(frozen=True)
class Rival:
    """An effect that the data cannot distinguish from a named one.

    Attributes
    ----------
    name
        Kind and component of the rival.
    parameters
        Values that the rival takes when it replaces the named effect.
    probability
        Weight of all hypotheses that contain the rival.
    beside
        Other named effects whose values differ beside the rival, and these values.
    """

    name: Name
    parameters: dict[str, Estimate]
    probability: float
    beside: tuple[tuple[Name, dict[str, Estimate]], ...] = ()


@dataclass(frozen=True)
class Finding:
    """A named effect.

    Attributes
    ----------
    name
        Kind and component of the effect.
    parameters
        Parameter name → estimated value with its interval.
    confidence
        Calibrated probability that the effect is present.
    alternatives
        Effects that the data cannot distinguish, the named one first (`class` in JSON).
    share
        Share of the gap's power that would return if the effect were removed from the correction.
        For an effect that is read off one sensor or off the controller alone, it is the share of
        that signal's own gap.
    title
        Kind of the effect in words, for use in a sentence.
    support
        Evidence behind the confidence. None where the effect is read off a signal directly.
    rivals
        The alternatives without the named effect, with the values that they would have.
    curve
        Positions and forces, SI, where the effect is a curve over the stroke.
    """

    name: Name
    parameters: dict[str, Estimate]
    confidence: float
    alternatives: tuple[Name, ...]
    share: float
    title: str = ""
    support: Support | None = None
    rivals: tuple[Rival, ...] = ()
    curve: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Confounded:
    """Declared value that the data determine only together with fitted ones.

    Attributes
    ----------
    assumed
        Kind and component of the declared value.
    value, unit
        Declared value and its unit.
    exponents
        Named effect and its exponent e: it changes as the declared value to the power of e.
    """

    assumed: Name
    value: float
    unit: str
    exponents: tuple[tuple[Name, float], ...]

    def document(self) -> dict[str, Any]:
        """Return the entry as JSON has it."""
        # The key `with` is a keyword of Python, so the field has another name.
        exponents = [{**asdict(name), "exponent": power} for name, power in self.exponents]
        return {**asdict(self.assumed), "value": self.value, "unit": self.unit, "with": exponents}


@dataclass(frozen=True)
class Place:
    """Location of a difference between the twin and the machine.

    Attributes
    ----------
    component
        Component, or sensor, at which the difference arises.
    share
        Share of the gap's power.
    band_hz
        Frequencies, Hz, between which the middle 80 % of the power lies.
    region
        Operating region that holds most of the power, such as "velocity reversal".
    evidence
        Observation that supports the location, as a clause of a sentence.
    """

    component: str
    share: float
    band_hz: tuple[float, float]
    region: str
    evidence: str


@dataclass(frozen=True)
class NextTest:
    """Test that would best separate the remaining explanations.

    Attributes
    ----------
    experiment
        Name of the experiment.
    command
        Command line that runs it.
    separates
        Smallest χ² between the prediction of the likeliest explanation and that of another.
    between
        Names of the explanations that the test separates.
    """

    experiment: str
    command: str
    separates: float
    between: tuple[str, ...]


@dataclass(frozen=True)
class Unobservable:
    """Effect that the recordings could not show at any size, and the reason (`why`)."""

    component: str
    kind: str
    why: str


@dataclass(frozen=True)
class Nearest:
    """Best explanation of a gap for which no effect is good enough to be named.

    Attributes
    ----------
    names
        Effects of the explanation.
    residual
        Rms residual with these effects, as a share of the signals' standard deviation (`left` in
        JSON).
    without
        The same without them.
    """

    names: tuple[Name, ...]
    residual: float
    without: float


@dataclass(frozen=True)
class Tolerated:
    """Parameter whose declared tolerance the correction uses up.

    Attributes
    ----------
    component, parameter
        Parameter and its component.
    estimate
        Value that fits best. Its interval is the declared tolerance.
    """

    component: str
    parameter: str
    estimate: Estimate


@dataclass(frozen=True)
class Step:
    """One stage of the search: the model with one more effect, and its residual.

    Attributes
    ----------
    added
        Effects that were added and removed at this stage, in words.
    values
        Parameter name → value when its effect was added. The final values may differ.
    residual
        Signal → rms of measured minus predicted, in the signal's SI unit, on the data that judge
        the correction (`left` in JSON).
    """

    added: str
    values: dict[str, Estimate]
    residual: dict[str, float]

    def document(self) -> dict[str, Any]:
        """Return the stage as JSON has it."""
        values = {name: asdict(estimate) for name, estimate in self.values.items()}
        return {"added": self.added, "values": values, "left": dict(self.residual)}
