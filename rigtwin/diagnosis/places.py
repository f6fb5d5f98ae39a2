"""Places of the named effects and of the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigtwin.diagnosis.cross_validation import with_effects
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Finding, Place
from rigtwin.diagnosis.judgement import (
    Judgement,
)
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.readings import SignalReadings
from rigtwin.diagnosis.regressors import describe_correlation
from rigtwin.diagnosis.unknown_input import DisturbanceFit
from rigtwin.numerics.arrays import Array


def locate_findings(
    evidence: Evidence,
    attributed: Sequence[Finding],
    judged: Judgement,
    disturbances: tuple[DisturbanceFit, ...],
    readings: SignalReadings,
) -> list[Place]:
    """Return where the named effects and the residual act, then the controller if it is unknown.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    attributed
        Findings of the named effects, in the order of the fit.
    judged
        Named effects and what remains.
    disturbances
        Unknown inputs that were fitted to the residual, the foremost first.
    readings
        Properties of controller and sensors that were read off signals.
    """
    named, fit = judged.named, judged.explanation.fit
    places: dict[str, Place] = {}
    predicted = evidence.predict(judged.plant)
    for effect, finding in zip(
        [effect for effect in fit.effects if effect in named], attributed, strict=True
    ):
        # An effect acts where removing it alone changes the prediction.
        rest = [other for other in named if other != effect]
        without = evidence.predict(with_effects(evidence.plant, fit, rest))
        change: list[Array] = [a - b for a, b in zip(predicted, without, strict=True)]
        place = locate(evidence, effect.component, finding.share, change)
        places[effect.name] = replace(place, evidence=f"{effect.kind.title}, {place.evidence}")
    if disturbances:
        foremost = disturbances[0]
        # The shares of the findings add up to the explained part of the gap's power
        # (`findings._shares`).
        share = max(1.0 - sum(finding.share for finding in attributed), 0.0)
        correlation = describe_correlation(foremost.forms)
        residual = evidence.differences(judged.plant)
        place = locate(evidence, foremost.component, share, residual, correlation)
        if all(place.component != foremost.component for place in places.values()):
            places["residual"] = place
    ordered = sorted(places.values(), key=lambda place: -place.share)
    if readings.has_unknown_controller:
        mismatch = "its commands are not those of its settings"
        ordered.append(Place("controller", 1.0, (0.0, 0.0), "throughout", mismatch))
    return ordered
