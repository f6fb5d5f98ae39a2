"""Parameters that may differ between recordings: of effects, zeros of sensors, tolerances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components import Effect, measures
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.effect_starts import LIMITS
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import is_possible
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.recording_equations import FreeParameter

STEP_FACTOR = 3.0
"""Ratio of the finite-difference steps to those of a search.

A joint that sticks answers a small step by chance: it starts a tick earlier or later."""
ZERO_STEP = 0.02
"""Finite-difference step of a sensor's zero, in standard deviations of its signal."""


def list_parameters(
    fitter: Fitter, named: Sequence[Effect], candidates: Sequence[Effect], plant: Plant
) -> list[FreeParameter]:
    """List every parameter that may differ between recordings.

    Parameters
    ----------
    fitter
        Fitter of the recordings.
    named
        Effects that the plant has.
    candidates
        Effects that the plant lacks but the machine may have.
    plant
        Plant about which responses are taken.

    Returns
    -------
    list of FreeParameter
        Parameters of effects first, then zeros of sensors, then tolerances.
    """
    evidence = fitter.evidence
    parameters = [*_of_effects(fitter, named, candidates, plant), *_of_zeros(evidence)]
    # A tolerance of a parameter that is listed already would be free twice.
    listed = [evidence.machine.tolerance_of(each.group, each.parameter) for each in parameters]
    parameters += [
        FreeParameter("tolerance", tolerance.group, tolerance.parameter, evidence.width(tolerance))
        for tolerance in evidence.machine.tolerances
        if tolerance not in listed and evidence.width(tolerance) > 0.0
    ]
    return parameters


def _of_effects(
    fitter: Fitter, named: Sequence[Effect], candidates: Sequence[Effect], plant: Plant
) -> list[FreeParameter]:
    parameters = []
    for effect in (*named, *candidates):
        is_zero = measures(effect.of()) and effect.kind.name == "offset"
        starts = fitter.starts(effect)
        is_named = effect in named
        # Zeros are nuisances. Limits, and curves or waves of unknown shape, have no linear response
        # to test.
        has_shape = starts.quadrature or starts.is_linear
        if is_zero or effect.kind.name in LIMITS or (has_shape and not is_named):
            continue
        if not is_named and not is_possible((*named, effect), plant):
            continue
        steps = dict(zip(effect.kind.parameters, starts.steps, strict=True))
        if is_named:
            parameters += [
                FreeParameter("effect", effect.group, name, STEP_FACTOR * step, effect)
                for name, step in steps.items()
            ]
            continue
        # Of an effect that the plant lacks, only the magnitude is free; its shape parameters stand
        # at the values where a search starts.
        first, *shape = effect.kind.parameters
        values = dict(zip(effect.kind.parameters, starts.values[0], strict=True))
        companions = tuple((name, values[name]) for name in shape)
        step = STEP_FACTOR * steps[first]
        parameters.append(FreeParameter("effect", effect.group, first, step, effect, companions))
    return [parameter for parameter in parameters if parameter.step > 0.0]


def _of_zeros(evidence: Evidence) -> list[FreeParameter]:
    zeros = []
    for name in sensors_of(evidence.machine):
        component = evidence.machine.components[name]
        assert component.channel is not None
        spread = max(
            float(np.std(recording.column(*component.channel))) for recording in evidence.recordings
        )
        if spread > 0.0:
            zeros.append(FreeParameter("zero", name, "offset", ZERO_STEP * spread))
    return zeros


def sensors_of(machine: Machine) -> list[str]:
    """Return the sensors whose zero may differ between recordings.

    Parameters
    ----------
    machine
        Machine whose components are searched.

    Returns
    -------
    list of str
        Names of the sensors that are recorded and have an offset.
    """
    return [
        name
        for name, component in machine.components.items()
        if component.channel is not None and component.quantity
    ]
