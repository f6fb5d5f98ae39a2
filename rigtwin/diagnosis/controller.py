"""Does a controller do what it was told? Its commands are worked out again from what was
recorded."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.quantity import Quantity, fields
from rigtwin.description.control import Control
from rigtwin.diagnosis.residual import rounding
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms

EXACT = 20.0
"""Times a command's rounding within which its replay counts as exact: a controller's own arithmetic
rounds too."""
CLOSER = 0.3
"""Share of what is left that another value must leave at most to be the explanation, of a
controller described inexactly."""
NEARLY = 0.1
"""Share of how far commands move by which those of another value may differ at most."""
RAN_AWAY = 1e100
"""Commands from which a replay is off by that much and no more; whoever looks for the least needs a
number."""
LATE = 4
"""Ticks by which the commands may lag behind, at most, to be recognised."""
REPEATED = 0.2
"""Share of ticks that repeat all commands, above which they are not missed but constant."""
SETTLED = 5
"""Ticks after which what remembers the past has forgotten how it began."""
AWAY = np.array([-2.0, -1.0, -0.75, -0.5, -0.25, -0.05, 0.05, 0.25, 0.5, 1.0, 2.0, 4.0])
"""In sizes of a setting, where another value is looked for first."""


@dataclass(frozen=True)
class Deviation:
    """What a controller did other than told. kind: `setting`, `missed_ticks` or `delay`, or
    `unknown` if nothing reproduces its commands; name: of the setting, or of the parameter; told:
    the operator's value; used: the one that reproduces them; consequence: by how much of itself
    the command that changes most does."""

    kind: str
    name: str
    told: float
    used: float
    unit: str
    consequence: float = math.inf


class ControllerReplay:
    """The commands that some settings give for what was recorded, beside those that were."""

    def __init__(self, control: Control, recording: Recording, settings: Any) -> None:
        """settings: as told, a NamedTuple. Raises RigtwinError if a channel is missing."""
        self._control, self._settings, self._period = control, settings, recording.period
        self.recorded = np.stack([recording.column("/command", name) for name in control.outputs])
        self._inputs = [recording.column(*channel) for channel in control.channels]
        exact = [
            EXACT * rounding(row) if control.exact is None else control.exact
            for row in self.recorded
        ]
        self._exact = np.array(exact)

    def commands(
        self, settings: Any, skipped: NDArray[np.bool_] | None = None, late: int = 0
    ) -> Array:
        """Commands at every tick, shape (outputs, ticks). skipped: ticks at which the controller
        does not run and its outputs stay; late: ticks that its samples are old."""
        inputs = self._inputs
        if late:
            # What was demanded is no sample.
            own = [("/command", name) for name in self._control.outputs]
            inputs = [
                column
                if channel in own
                else np.concatenate([np.full(late, column[0]), column[:-late]])
                for column, channel in zip(inputs, self._control.channels, strict=True)
            ]
        if skipped is None:
            return self._control.replay(settings, inputs, self._period)
        runs = np.nonzero(~skipped)[0]
        own = self._control.replay(settings, [column[runs] for column in inputs], self._period)
        last = np.searchsorted(runs, np.arange(len(skipped)), side="right") - 1
        return np.where(last >= 0, own[:, np.maximum(last, 0)], 0.0)

    def misfit(self, commands: Array, counted: NDArray[np.bool_] | None = None) -> float:
        """rms of what commands differ by, in units of what counts as exact; of the worst
        command."""
        difference = (commands - self.recorded)[:, SETTLED:]
        if counted is not None:
            difference = difference[:, counted[SETTLED:]]
        if not np.max(np.abs(difference), initial=0.0) < RAN_AWAY:
            return RAN_AWAY
        return max(rms(row) / exact for row, exact in zip(difference, self._exact, strict=True))

    def deviation(self) -> Deviation | None:
        """What explains that the commands are not those of the settings; None if they are."""
        commands = self.commands(self._settings)
        left = self.misfit(commands)
        if left <= 1.0:
            return None
        found = (
            self._find_missed_ticks()
            or self._find_delay()
            or self._find_setting(left)
            or Deviation("unknown", "", 0.0, 0.0, "1")
        )
        return replace(found, consequence=self._consequence(commands))

    def _consequence(self, commands: Array) -> float:
        """rms of what commands differ by, as a share of how far they move; of the worst."""
        differs = np.sqrt(np.mean((commands - self.recorded)[:, SETTLED:] ** 2, axis=1))
        moves = np.std(self.recorded[:, SETTLED:], axis=1)
        shares = [
            (one / other if other > 0.0 else math.inf)
            for one, other in zip(differs.tolist(), moves.tolist(), strict=True)
            if one > 0.0
        ]
        return max(shares, default=0.0)

    def _find_missed_ticks(self) -> Deviation | None:
        repeated = np.concatenate([[False], np.all(np.diff(self.recorded, axis=1) == 0.0, axis=0)])
        if not 0 < repeated.sum() < REPEATED * len(repeated):
            return None
        running = self.misfit(self.commands(self._settings), ~repeated)
        skipping = self.misfit(self.commands(self._settings, repeated))
        if min(running, skipping) > 1.0:
            return None
        return Deviation("missed_ticks", "missed_ticks", 0.0, float(repeated.mean()), "1")

    def _find_delay(self) -> Deviation | None:
        for late in range(1, LATE + 1):
            if self.misfit(self.commands(self._settings, late=late)) <= 1.0:
                return Deviation("delay", "delay", 0.0, late * self._period, "s")
        return None

    def _find_setting(self, left: float) -> Deviation | None:
        """The one setting that, at another value, reproduces the commands."""
        found: list[tuple[float, Deviation]] = []
        for name, meaning in fields(type(self._settings)).items():
            told = float(getattr(self._settings, name))
            if name == "mode" or (told == 0.0 and self._control.exact is not None):
                continue

            def misfit(value: Any, name: str = name) -> float:
                settings = self._settings._replace(**{name: value})
                try:
                    commands = self.commands(settings)
                except RigtwinError:
                    # Of such settings no controller can be made.
                    return RAN_AWAY
                return self.misfit(commands)

            if isinstance(meaning, Quantity):
                best, value = _minimise(misfit, told, meaning)
                found.append((best, Deviation("setting", name, told, value, meaning.unit)))
            else:
                best, value = min((misfit(choice), float(choice)) for choice in meaning)
                found.append((best, Deviation("setting", name, told, value, "1")))
        enough = 1.0 if self._control.exact is None else max(1.0, CLOSER * left)
        return min(
            (each for each in found if each[0] <= enough and self._reproduces(each[1])),
            key=lambda each: each[0],
            default=(0.0, None),
        )[1]

    def _reproduces(self, found: Deviation) -> bool:
        """Whether commands with another setting are nearly those recorded, and not merely smaller
        than those with the told one."""
        if self._control.exact is None:
            return True
        settings = self._settings._replace(**{found.name: found.used})
        return self._consequence(self.commands(settings)) < NEARLY


def _minimise(
    misfit: Callable[[float], float], told: float, meaning: Quantity
) -> tuple[float, float]:
    """Smallest misfit over one setting, and where: a coarse look around the told value, then a
    bounded search."""
    from scipy.optimize import minimize_scalar  # Late: it takes its time.

    size = max(abs(told), 0.01 * min(meaning.high, 1.0))
    # Some settings matter only relative to nothing (a skyhook that is off), so the grid is wide.
    grid = np.unique(np.clip(told + size * AWAY, meaning.low, meaning.high))
    ends = misfit(grid[0]), misfit(grid[-1])
    if len(grid) == 1 or ends[0] == ends[1] == misfit(grid[len(grid) // 2]):
        # It changes nothing: a part of the controller that is off.
        return ends[0], told
    values = [ends[0], *(misfit(value) for value in grid[1:-1]), ends[1]]
    place = int(np.argmin(values))
    near = np.append(grid, told)
    low = near[near < grid[place]].max(initial=meaning.low)
    high = near[near > grid[place]].min(initial=meaning.high)
    options = {"xatol": 1e-9 * size, "maxiter": 80}
    found = minimize_scalar(misfit, bounds=(low, high), method="bounded", options=options)
    return min((float(found.fun), float(found.x)), (values[place], float(grid[place])))
