"""The answer of a diagnosis, as frozen data and as the JSON document that other programs read.

Field names are JSON keys, except where `Answer.document` writes the key explicitly. The schema is
`answer.schema.json`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from rigtwin.diagnosis.support import Support
from rigtwin.simulation.energy import EnergyError

Verdict = Literal["no gap", "explained", "partly explained", "unknown", "unusable"]
VERDICTS: tuple[str, ...] = get_args(Verdict)


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
class Interval:
    """A value and the ends of its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Level:
    """Size of a gap before and after the correction, and the floor that noise alone leaves."""

    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class Gap:
    """Difference between twin and machine before and after the correction.

    Attributes
    ----------
    before, after
        Rms over all sensors of measured minus predicted, in units of the sensors' white noise.
    floor
        The same rms for a perfect twin.
    shrinkage_predicted
        Share of the gap above the floor that the correction closes on the data of the fit.
    shrinkage_held_out
        Share that the correction closes on data held out of the fit, with a bootstrap interval.
    held_out
        Description of the held-out data.
    replays
        Component → gap of the component driven alone by recorded signals.
    closed_loop
        Difference in dB between the spectra of the recording and of the twin's own closed-loop run.
        The spectra hold no phase, so the phase of a limit cycle does not matter. None where the
        machine has no closed loop to run.
    """

    before: float
    after: float
    floor: float
    shrinkage_predicted: float
    shrinkage_held_out: Interval
    held_out: str
    replays: dict[str, Level]
    closed_loop: Level | None


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


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Complete answer of a diagnosis.

    Attributes
    ----------
    verdict
        One of `VERDICTS`.
    sentence
        The answer on one line.
    effects
        Effects that are named.
    where
        Locations of the gap, the largest share first.
    gap
        Gap before and after the correction. None where the data cannot be diagnosed.
    ranking
        Explanations with their probability, the likeliest first.
    next_test
        Test that would separate the remaining explanations. None where none is needed or known.
    not_observable
        Effects that these recordings could not show.
    faults
        Defects of the recordings that forbid a diagnosis.
    notes
        Remarks on the data and on rejected effects, one sentence each.
    recordings
        Paths of the recordings.
    seconds
        Duration of the diagnosis, s.
    machine
        Name of the machine.
    steps
        Residuals as effects were added one after another, the nominal machine first.
    units
        Signal → SI unit of its residual in `steps`.
    leftovers
        Locations of the residual that the corrected twin does not model.
    traces
        Effects that would close a little more of the gap, but too little to be named.
    confounded
        Declared values on which the named ones depend, because the data determine only
        combinations of both.
    nearest
        Best explanation of an unknown gap. None for every other verdict.
    energy
        Recording of a hybrid test → energy that its loop added.
    tolerated
        Tolerances that the correction uses up, where it leaves nothing but noise beside them.
    """

    verdict: Verdict
    sentence: str
    effects: tuple[Finding, ...] = ()
    where: tuple[Place, ...] = ()
    gap: Gap | None = None
    ranking: tuple[tuple[str, float], ...] = ()
    next_test: NextTest | None = None
    not_observable: tuple[Unobservable, ...] = ()
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    recordings: tuple[str, ...]
    seconds: float
    machine: str
    steps: tuple[Step, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    leftovers: tuple[Place, ...] = ()
    traces: tuple[Finding, ...] = ()
    confounded: tuple[Confounded, ...] = ()
    nearest: Nearest | None = None
    energy: dict[str, EnergyError] = field(default_factory=dict)
    tolerated: tuple[Tolerated, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return the JSON document, which keeps to `answer.schema.json`."""
        return {
            "verdict": self.verdict,
            "machine": self.machine,
            "sentence": self.sentence,
            "effects": [_finding_document(effect) for effect in self.effects],
            "traces": [_finding_document(effect) for effect in self.traces],
            "where": [asdict(place) for place in self.where],
            "gap": None if self.gap is None else asdict(self.gap),
            "ranking": [
                {"explanation": name, "probability": probability}
                for name, probability in self.ranking
            ],
            "next_test": None if self.next_test is None else asdict(self.next_test),
            "not_observable": [asdict(effect) for effect in self.not_observable],
            "faults": list(self.faults),
            "notes": list(self.notes),
            "steps": [step.document() for step in self.steps],
            "units": dict(self.units),
            "leftovers": [asdict(place) for place in self.leftovers],
            "confounded": [entry.document() for entry in self.confounded],
            "nearest": None if self.nearest is None else _nearest_document(self.nearest),
            # JSON has no number for an infinite share.
            "energy": {
                name: {
                    **asdict(error),
                    "share": error.share if math.isfinite(error.share) else None,
                }
                for name, error in self.energy.items()
            },
            "tolerated": [asdict(part) for part in self.tolerated],
            "recordings": list(self.recordings),
            "seconds": self.seconds,
        }


def _nearest_document(nearest: Nearest) -> dict[str, Any]:
    return {
        "names": [asdict(name) for name in nearest.names],
        "left": nearest.residual,
        "without": nearest.without,
    }


def _finding_document(effect: Finding) -> dict[str, Any]:
    return {
        "component": effect.name.component,
        "kind": effect.name.kind,
        "parameters": {name: asdict(value) for name, value in effect.parameters.items()},
        "confidence": effect.confidence,
        # `class` is a keyword of Python, so the field has another name.
        "class": [asdict(name) for name in effect.alternatives],
        "share": effect.share,
        "support": None if effect.support is None else asdict(effect.support),
        "rivals": [
            {
                "component": rival.name.component,
                "kind": rival.name.kind,
                "parameters": {name: asdict(value) for name, value in rival.parameters.items()},
                "probability": rival.probability,
                "beside": [
                    {
                        **asdict(name),
                        "parameters": {key: asdict(value) for key, value in values.items()},
                    }
                    for name, values in rival.beside
                ],
            }
            for rival in effect.rivals
        ],
        **({"curve": [list(point) for point in effect.curve]} if effect.curve else {}),
    }
