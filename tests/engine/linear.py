"""A linear model in the place of a machine: its residual is data less responses times values."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from rigtwin.components import Effect, RigPlant
from rigtwin.diagnosis.lines import Lines
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

PLANT = RigPlant()


def tolerance(group: str, parameter: str, ticks: bool = False) -> SimpleNamespace:
    """Return a declared tolerance of a component's parameter."""
    return SimpleNamespace(group=group, parameter=parameter, ticks=ticks)


def space_of(
    responses: Array,
    used: Array | None = None,
    effects: Sequence[Effect] = (),
    tolerances: Sequence[Any] = (),
) -> Space:
    """Return the tolerances whose responses are given, shape (size, tolerances)."""
    listed = list(tolerances) or [tolerance("none", str(n)) for n in range(responses.shape[1])]

    def tolerance_of(group: str, parameter: str) -> Any:
        matching = [t for t in listed if (t.group, t.parameter) == (group, parameter)]
        return matching[0] if matching else None

    machine = SimpleNamespace(tolerances=listed, tolerance_of=tolerance_of)
    evidence: Any = SimpleNamespace(machine=machine, tolerance_responses=lambda plant: responses)
    return Space(evidence, PLANT, used, effects)


def no_tolerances(size: int) -> Space:
    """Return a space without any tolerance beside a residual of a size."""
    return space_of(np.zeros((size, 0)))


class LinearEvidence:
    """White recordings whose prediction is linear in the rail's friction.

    residual(plant) = data − (coulomb − 50) · responses[0] − viscous · responses[1], whitened.
    """

    def __init__(
        self, data: Sequence[Array], responses: Sequence[Sequence[Array]], even: float = 1.0
    ) -> None:
        """Signals in the time domain, shape (signals, ticks) for every recording."""
        self.machine = SimpleNamespace(prior=SimpleNamespace(even=even, error=0.05))
        self.plant = PLANT
        self.lines = [lines_of(signals, np.ones(len(signals))) for signals in data]
        self._data, self._responses = data, responses

    def whiten(self, differences: Sequence[Array]) -> Array:
        parts = []
        for lines, difference in zip(self.lines, differences, strict=True):
            spectrum = np.fft.rfft(lines.fade * difference, lines.length, axis=1)
            spectrum = spectrum[:, 1 : 1 + lines.weight.shape[1]] * lines.weight
            parts += [spectrum.real.ravel(), spectrum.imag.ravel()]
        return np.concatenate(parts)

    def residual(self, plant: RigPlant) -> Array:
        values = (plant.rail.coulomb - 50.0, plant.rail.viscous)
        left = [
            data - sum(value * part for value, part in zip(values, own, strict=True))
            for data, own in zip(self._data, self._responses, strict=True)
        ]
        return self.whiten(left)

    def excess_noise(self, plant: RigPlant) -> list[Array | None]:
        """Return a tenth of the noise more for every newton of the rail's asymmetry."""
        more = 0.1 * plant.rail.asymmetry
        return [np.full(lines.weight.shape, more) if more else None for lines in self.lines]


def lines_of(signals: Array, noise: Array, fade: Array | None = None) -> Lines:
    """Return lines of signals, shape (rows, ticks), with the weight of unit noise."""
    count, ticks = signals.shape
    weight = np.full((count, ticks // 2 - 1), np.sqrt(2.0 / ticks))
    return Lines(
        frequency=np.fft.rfftfreq(ticks, 1e-3)[1 : 1 + weight.shape[1]],
        weight=weight,
        spread=1.0 / weight**2,
        fade=np.ones_like(signals) if fade is None else fade,
        measured=signals,
        noise=noise,
        bit=np.zeros(count),
        length=ticks,
        period=1e-3,
    )
