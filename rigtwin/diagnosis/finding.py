"""What a diagnosis says, as frozen data and as the JSON that other programs read."""

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
    """A parameter's value with its 95 % interval, and what it is nominally, in its unit."""

    value: float
    low: float
    high: float
    nominal: float
    unit: str


@dataclass(frozen=True)
class Name:
    """A kind of effect at a component."""

    component: str
    kind: str

    def __str__(self) -> str:
        return f"{self.kind}@{self.component}"


@dataclass(frozen=True)
class Rival:
    """An effect that the data cannot tell from a named one.

    Parameters
    ----------
    name
        Kind and component.
    parameters
        Values that it has in the place of the named effect.
    probability
        Weight of all hypotheses with it.
    """

    name: Name
    parameters: dict[str, Estimate]
    probability: float


@dataclass(frozen=True)
class Finding:
    """An effect that is named.

    Parameters
    ----------
    name
        Kind and component.
    parameters
        Values with their intervals.
    confidence
        Probability that it is this effect.
    alternatives
        Effects that the data cannot tell from it, itself first (`class` in JSON).
    share
        Share of the gap that would come back without it. Of an effect that is read off a sensor or
        the controller alone, share of that one's own gap.
    title
        Its kind in a sentence.
    support
        What the confidence rests on; None where the effect is read off a signal.
    rivals
        The alternatives with the values that they would have.
    """

    name: Name
    parameters: dict[str, Estimate]
    confidence: float
    alternatives: tuple[Name, ...]
    share: float
    title: str = ""
    support: Support | None = None
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True)
class Place:
    """Where a gap lies. band_hz: where the middle 80 % of its power lies; region: of operation;
    evidence: in words."""

    component: str
    share: float
    band_hz: tuple[float, float]
    region: str
    evidence: str


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Level:
    """A gap before and after the correction, and what noise alone leaves."""

    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class Gap:
    """before, after, floor: rms of all sensors less what the twin predicts from the commands, in
    units of their white noise. shrinkage: share of the gap above the floor that the correction
    closes, predicted from the data of the fit, and achieved on data held out of it. replays: each
    component's own; closed_loop: dB between the spectra of the recording and of the twin's own run,
    which no phase of a limit cycle changes."""

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
    """The test that would separate the explanations that remain best. command: ready to run;
    separates: χ² between them."""

    experiment: str
    command: str
    separates: float
    between: tuple[str, ...]


@dataclass(frozen=True)
class Unobservable:
    """An effect that these data could not show, and why."""

    component: str
    kind: str
    why: str


@dataclass(frozen=True)
class Nearest:
    """The explanation that comes nearest where none is good enough to be named.

    Parameters
    ----------
    names
        Its effects.
    left, without
        Residual with and without it, in units of the signals' standard deviation.
    """

    names: tuple[Name, ...]
    left: float
    without: float


@dataclass(frozen=True)
class Step:
    """One effect more. added: its name, or of all that changed; values: of its parameters then;
    left: rms of what each signal has left, in its unit, on the data that it is judged on."""

    added: str
    values: dict[str, Estimate]
    left: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The whole answer. ranking: explanations with their probability, the likeliest first; notes:
    what people should know; steps: what each effect changed as they were found one after another,
    the nominal machine first; units: of their signals; leftovers: where what is still left lies;
    traces: effects that close a little more of the gap, too small to be claimed; nearest: of an
    unknown, what comes nearest to it; energy: recording of a hybrid test → what its loop put in."""

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
    nearest: Nearest | None = None
    energy: dict[str, EnergyError] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """The JSON document."""
        gap = None
        if self.gap is not None:
            gap = asdict(self.gap)
        return {
            "verdict": self.verdict,
            "machine": self.machine,
            "sentence": self.sentence,
            "effects": [_finding(effect) for effect in self.effects],
            "traces": [_finding(effect) for effect in self.traces],
            "where": [asdict(place) for place in self.where],
            "gap": gap,
            "ranking": [
                {"explanation": name, "probability": probability}
                for name, probability in self.ranking
            ],
            "next_test": None if self.next_test is None else asdict(self.next_test),
            "not_observable": [asdict(each) for each in self.not_observable],
            "faults": list(self.faults),
            "notes": list(self.notes),
            "steps": [asdict(step) for step in self.steps],
            "units": dict(self.units),
            "leftovers": [asdict(place) for place in self.leftovers],
            "nearest": None if self.nearest is None else asdict(self.nearest),
            "energy": {
                name: {**asdict(each), "share": each.share if math.isfinite(each.share) else None}
                for name, each in self.energy.items()
            },
            "recordings": list(self.recordings),
            "seconds": self.seconds,
        }


def _finding(effect: Finding) -> dict[str, Any]:
    return {
        "component": effect.name.component,
        "kind": effect.name.kind,
        "parameters": {name: asdict(value) for name, value in effect.parameters.items()},
        "confidence": effect.confidence,
        "class": [asdict(name) for name in effect.alternatives],
        "share": effect.share,
        "support": None if effect.support is None else asdict(effect.support),
        "rivals": [
            {
                "component": rival.name.component,
                "kind": rival.name.kind,
                "parameters": {name: asdict(value) for name, value in rival.parameters.items()},
                "probability": rival.probability,
            }
            for rival in effect.rivals
        ],
    }
