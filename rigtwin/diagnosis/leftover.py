"""Residuals of each stage of the search, and the location of the residual that remains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Estimate, Place, Step
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.localisation import locate
from rigtwin.diagnosis.regressors import describe_correlation
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.diagnosis.units import say, spell
from rigtwin.diagnosis.unknown_input import DisturbanceFit
from rigtwin.diagnosis.words import name_part
from rigtwin.signals.noise import rms


def steps(evidence: Evidence, chain: Sequence[Fit], held_out: Evidence) -> tuple[Step, ...]:
    """Return the residual of each fit of a chain, the nominal plant first.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    chain
        Fits with a growing number of effects.
    held_out
        Recordings on which the residuals are taken.

    Returns
    -------
    tuple of Step
        One step for the nominal plant and one for each fit.
    """
    stages = [Step("nominal", {}, remaining_rms(held_out, evidence.plant))]
    previous: set[str] = set()
    for fit in chain:
        names = {effect.name for effect in fit.effects}
        added = " + ".join(effect.name for effect in fit.effects if effect.name not in previous)
        removed = " and ".join(sorted(previous - names))
        values: dict[str, Estimate] = {}
        for effect, numbers in zip(fit.effects, fit.values, strict=True):
            # Only what is new at this stage: values of earlier effects move a little, and would
            # repeat in every row.
            if effect.name in previous:
                continue
            nominal = effect.nominal(evidence.plant)
            for (name, quantity), value in zip(effect.quantities().items(), numbers, strict=True):
                unit = evidence.machine.unit(effect.group, quantity)
                values[name] = Estimate(value, value, value, nominal[name], unit)
        change = " ".join(
            part
            for part in (
                f"with {added}" if added else "",
                f"without {removed}" if removed else "",
            )
            if part
        )
        stages.append(Step(change, values, remaining_rms(held_out, fit.plant)))
        previous = names
    return tuple(stages)


def remaining_rms(evidence: Evidence, plant: Plant) -> dict[str, float]:
    """Return the rms residual of each signal over all recordings.

    Parameters
    ----------
    evidence
        Recordings.
    plant
        Plant that predicts the signals.

    Returns
    -------
    dict
        Signal → rms of measured minus predicted, in the signal's SI unit.
    """
    rows: dict[str, float] = {}
    predicted = evidence.predict(plant)
    for number, name in enumerate(evidence.names):
        parts = [
            (recorded.measured[number] - model[number])[recorded.counts[number]]
            for recorded, model in zip(evidence.lines, predicted, strict=True)
        ]
        rows[name] = rms(np.concatenate(parts))
    return rows


def leftovers(
    evidence: Evidence,
    plant: Plant,
    disturbances: Sequence[DisturbanceFit],
    thresholds: Thresholds = STANDARD,
) -> list[Place]:
    """Locate the residual of each signal that noise and declared error do not explain.

    Parameters
    ----------
    evidence
        Recordings.
    plant
        Corrected plant.
    disturbances
        Unknown inputs, the component that explains most first; at least one.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    list of Place
        One place for each such signal, the largest share first. Shares are of the residual's power
        in units of the signals' noise.
    """
    differences = evidence.differences(plant)
    levels = remaining_rms(evidence, plant)
    places = []
    # Signals of different units add in units of their noise. That of the first recording stands for
    # all, as it belongs to the sensor.
    total = sum(
        (levels[name] / float(evidence.lines[0].noise[n])) ** 2
        for n, name in enumerate(evidence.names)
    )
    foremost = disturbances[0]
    correlation = (
        f"at the {name_part(foremost.component)}, {describe_correlation(foremost.forms)}"
        if foremost.forms
        else describe_correlation(())
    )
    for number, (name, row) in enumerate(zip(evidence.names, evidence.machine.rows, strict=True)):
        noise = float(evidence.lines[0].noise[number])
        typical = rms(np.concatenate([recorded.measured[number] for recorded in evidence.lines]))
        if levels[name] < max(
            thresholds.localisation_ratio * noise, evidence.machine.form_of(row) * typical
        ):
            continue
        # `locate` takes all rows: the others are set to zero so that this one is chosen.
        isolated = [
            np.where(np.arange(len(rows))[:, None] == number, rows, 0.0) for rows in differences
        ]
        share = (levels[name] / noise) ** 2 / total
        words = (
            f"{say(levels[name], row.unit)} rms, {spell(levels[name] / noise, 3)} "
            f"times its noise; {correlation}"
        )
        places.append(locate(evidence, name, share, isolated, words))
    return sorted(places, key=lambda place: -place.share)
