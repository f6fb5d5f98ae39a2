"""The answer of a diagnosis, as frozen data and as the JSON document that other programs read.

Field names are JSON keys, except where `Answer.document` writes the key explicitly. The schema is
`answer.schema.json`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from rigtwin.diagnosis.finding import (
    Confounded,
    Finding,
    Nearest,
    NextTest,
    Place,
    Step,
    Tolerated,
    Unobservable,
)
from rigtwin.diagnosis.gap import Gap
from rigtwin.simulation.energy import EnergyError

Verdict = Literal["no gap", "explained", "partly explained", "unknown", "unusable"]
VERDICTS: tuple[str, ...] = get_args(Verdict)


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
