"""The parameters that may differ between recordings: of effects, zeros of sensors, tolerances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect, measures
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.by_recording import Column
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import is_possible
from rigtwin.diagnosis.fitter import LIMITS, Fitter

WIDE = 3.0
"""Times the steps of a search at which responses are taken: what sticks answers small ones by
chance."""


def columns_of(
    fitter: Fitter, named: Sequence[Effect], others: Sequence[Effect], plant: Plant
) -> list[Column]:
    """Everything that may be another in each recording.

    Parameters
    ----------
    fitter
        Of the recordings.
    named
        Effects that the plant has.
    others
        That it may have.
    plant
        About which responses are taken.

    Returns
    -------
    list of Column
        Effects first, then zeros of sensors, then tolerances.
    """
    evidence = fitter.evidence
    found = [*_of_effects(fitter, named, others, plant), *_of_zeros(evidence)]
    taken = [evidence.machine.tolerance_of(each.group, each.parameter) for each in found]
    found += [
        Column("tolerance", each.group, each.parameter, evidence.width(each))
        for each in evidence.machine.tolerances
        if each not in taken and evidence.width(each) > 0.0
    ]
    return found


def _of_effects(
    fitter: Fitter, named: Sequence[Effect], others: Sequence[Effect], plant: Plant
) -> list[Column]:
    found = []
    for effect in (*named, *others):
        zero = measures(effect.of()) and effect.kind.name == "offset"
        starts = fitter.starts(effect)
        there = effect in named
        if zero or effect.kind.name in LIMITS or (starts.quadrature and not there):
            continue
        if not there and not is_possible((*named, effect), plant):
            continue
        steps = dict(zip(effect.kind.parameters, starts.steps, strict=True))
        first, *rest = effect.kind.parameters
        if there:
            found += [
                Column("effect", effect.group, name, WIDE * step, effect)
                for name, step in steps.items()
            ]
        else:
            given = dict(zip(effect.kind.parameters, starts.values[0], strict=True))
            more = tuple((name, given[name]) for name in rest)
            found.append(Column("effect", effect.group, first, WIDE * steps[first], effect, more))
    return [column for column in found if column.step > 0.0]


def _of_zeros(evidence: Evidence) -> list[Column]:
    found = []
    for name in sensors_of(evidence.machine):
        component = evidence.machine.components[name]
        assert component.channel is not None
        spread = max(
            float(np.std(recording.column(*component.channel))) for recording in evidence.recordings
        )
        if spread > 0.0:
            found.append(Column("zero", name, "offset", 0.02 * spread))
    return found


def sensors_of(machine: Machine) -> list[str]:
    """Sensors that may have another zero in each recording."""
    return [
        name
        for name, component in machine.components.items()
        if component.channel is not None
        and measures(part := getattr(machine.plant, name, None))
        and hasattr(part, "offset")
    ]
