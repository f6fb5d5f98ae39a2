"""Is a controller written as a formula doing what its description says? Its commands are replayed from what it measured."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from rigtwin.diagnosis.controller import EXACT, LATE, Deviation
from rigtwin.diagnosis.residual import rounding
from rigtwin.machine.machine import Machine
from rigtwin.models.replaying import Setup
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms

SETTLED = 5
"""Ticks after which blocks that remember the past have forgotten how they began."""
CLOSER = 0.3
"""Share of the description's misfit that another value must leave at most to be the explanation."""


class FormulaReplay:
    """The commands that a formula gives for what was measured, beside those recorded."""

    def __init__(self, machine: Machine, recording: Recording, setup: Setup) -> None:
        assert machine.control is not None
        self._control, self._settings, self._period = machine.control, dict(setup.settings), recording.period
        self._recorded = recording.column("/command", machine.control.output)
        columns: list[Array] = [recording.column(*machine.control.inputs[name]) for name in machine.control.formula.inputs]
        self._inputs = columns
        exact = machine.control.exact
        self._exact = EXACT * rounding(self._recorded) if exact is None else exact

    def misfit(self, settings: dict[str, float], late: int = 0) -> float:
        """rms of what the commands differ by, in units of what counts as exact."""
        inputs: list[Array] = self._inputs
        if late:
            inputs = [np.concatenate([np.full(late, column[0]), column[:-late]]) for column in inputs]
        out = self._control.formula.replayed(settings, inputs, self._period)
        return rms((out - self._recorded)[SETTLED:]) / self._exact

    def deviation(self) -> Deviation | None:
        """What explains that the commands are not the description's; None if they are."""
        left = self.misfit(self._settings)
        if left <= 1.0:
            return None
        for late in range(1, LATE + 1):
            if self.misfit(self._settings, late) <= 1.0:
                return Deviation("delay", "delay", 0.0, late * self._period, "s")
        best: tuple[float, Deviation] | None = None
        for name, told in self._settings.items():
            if told == 0.0:
                continue

            def misfit(share: float, name: str = name, told: float = told) -> float:
                return self.misfit({**self._settings, name: share * told})

            grid = np.array([-1.0, 0.0, 0.25, 0.5, 0.8, 0.95, 1.0, 1.05, 1.25, 2.0, 4.0])
            at = int(np.argmin([misfit(share) for share in grid]))
            low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
            found = minimize_scalar(misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-7})
            if best is None or found.fun < best[0]:
                best = float(found.fun), Deviation("setting", name, told, float(found.x) * told, "1")
        if best is not None and best[0] <= max(1.0, CLOSER * left):
            return best[1]
        return Deviation("unknown", "", 0.0, 0.0, "1")


def formula_deviation(machine: Machine, recording: Recording, setup: Setup) -> Deviation | None:
    """What a described controller did other than told; None if it did as told, or if none is described."""
    if machine.control is None or not recording.has("/command", machine.control.output):
        return None
    return FormulaReplay(machine, recording, setup).deviation()
