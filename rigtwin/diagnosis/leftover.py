"""What each effect changed as they were found one after another, and what is left in the end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Estimate, Place, Step
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.units import say, spell
from rigtwin.diagnosis.unknown_input import DisturbanceFit
from rigtwin.diagnosis.words import enumerate_words, name_part
from rigtwin.signals.noise import rms


def steps(evidence: Evidence, chain: Sequence[Fit], held_out: Evidence) -> tuple[Step, ...]:
    """The signals' rms left by each fit of a chain on the data that it is judged on, the nominal
    plant first."""
    found = [Step("nominal", {}, remaining_rms(held_out, evidence.plant))]
    before: set[str] = set()
    for fit in chain:
        names = {effect.name for effect in fit.effects}
        added = " + ".join(effect.name for effect in fit.effects if effect.name not in before)
        gone = " and ".join(sorted(before - names))
        values: dict[str, Estimate] = {}
        for effect, numbers in zip(fit.effects, fit.values, strict=True):
            if effect.name in before:
                continue
            nominal = effect.nominal(evidence.plant)
            for (name, quantity), value in zip(effect.quantities().items(), numbers, strict=True):
                unit = evidence.machine.unit(effect.group, quantity)
                values[name] = Estimate(value, value, value, nominal[name], unit)
        said = " ".join(
            part
            for part in (f"with {added}" if added else "", f"without {gone}" if gone else "")
            if part
        )
        found.append(Step(said, values, remaining_rms(held_out, fit.plant)))
        before = names
    return tuple(found)


def remaining_rms(evidence: Evidence, plant: Plant) -> dict[str, float]:
    """rms of what each signal has left, over all recordings."""
    rows: dict[str, float] = {}
    predicted = evidence.predict(plant)
    for number, name in enumerate(evidence.names):
        parts = [
            (each.measured[number] - model[number])[each.fade[number] > 0.5]
            for each, model in zip(evidence.lines, predicted, strict=True)
        ]
        rows[name] = rms(np.concatenate(parts))
    return rows


def leftovers(
    evidence: Evidence,
    plant: Plant,
    disturbed: Sequence[DisturbanceFit],
    thresholds: Thresholds = STANDARD,
) -> list[Place]:
    """Where what is left lies, signal by signal, and what it goes with at the component that
    explains it best."""
    differences = evidence.differences(plant)
    levels = remaining_rms(evidence, plant)
    found = []
    total = sum(
        (levels[name] / float(evidence.lines[0].noise[n])) ** 2
        for n, name in enumerate(evidence.names)
    )
    foremost = disturbed[0]
    goes_with = (
        f"at the {name_part(foremost.component)} it goes with {enumerate_words(foremost.forms)}"
        if foremost.forms
        else "it has no plain form"
    )
    for number, (name, row) in enumerate(zip(evidence.names, evidence.machine.rows, strict=True)):
        noise = float(evidence.lines[0].noise[number])
        typical = rms(np.concatenate([each.measured[number] for each in evidence.lines]))
        if levels[name] < max(
            thresholds.localisation_ratio * noise, evidence.machine.form_of(row) * typical
        ):
            continue
        own = [np.where(np.arange(len(each))[:, None] == number, each, 0.0) for each in differences]
        share = (levels[name] / noise) ** 2 / total
        words = (
            f"{say(levels[name], row.unit)} rms, {spell(levels[name] / noise, 3)} "
            f"times its noise; {goes_with}"
        )
        found.append(locate(evidence, name, share, own, words))
    return sorted(found, key=lambda place: -place.share)
