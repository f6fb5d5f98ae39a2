"""Deviations of a controller from its settings, found by replaying it on the recorded inputs.

A controller is deterministic: with the recorded inputs and the operator's settings it gives the
recorded commands up to rounding. Where it does not, missed ticks, delayed samples and another value
of a single setting are tried in turn.
"""

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
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import rms

EXACT = 20.0
"""Error of a replay that counts as exact, in units of a command's rounding. The controller's own
arithmetic rounds too."""
CLOSER = 0.3
"""Largest share of the misfit that another value of a setting may leave to explain the commands of
a controller that is described inexactly."""
NEARLY = 0.1
"""Largest error of the commands with another value of a setting, as a share of their motion."""
DIVERGED = 1e100
"""Misfit of a replay that diverges. It is finite, as the minimisation needs numbers."""
LATE = 4
"""Longest delay of the samples that is recognised, in ticks."""
REPEATED = 0.2
"""Share of ticks that repeat all commands above which the commands are constant, and no ticks were
missed."""
SETTLED = 5
"""Ticks after which the controller's states have forgotten their unknown start."""
GRID = np.array([-2.0, -1.0, -0.75, -0.5, -0.25, -0.05, 0.05, 0.25, 0.5, 1.0, 2.0, 4.0])
"""Differences from a setting at which other values are tried first, in units of its size."""


@dataclass(frozen=True)
class Deviation:
    """Deviation of a controller from its settings.

    Attributes
    ----------
    kind
        `setting`, `missed_ticks` or `delay`; `unknown` if nothing reproduces the commands.
    name
        Name of the setting or of the parameter.
    configured
        Value set by the operator, in `unit`.
    used
        Value that reproduces the commands, in `unit`.
    unit
        Unit of both values.
    consequence
        Change of the most affected command, as a share of its motion.
    """

    kind: str
    name: str
    configured: float
    used: float
    unit: str
    consequence: float = math.inf


class ControllerReplay:
    """Replay of a controller on the recorded inputs, compared with the recorded commands."""

    def __init__(self, control: Control, recording: RecordedTest, settings: Any) -> None:
        """Read the inputs and commands of a recording.

        Parameters
        ----------
        control
            Described controller.
        recording
            Recording with the controller's channels.
        settings
            The operator's settings, a NamedTuple.

        Raises
        ------
        RigtwinError
            If a channel is missing.
        """
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
        """Return the commands at every tick.

        Parameters
        ----------
        settings
            Settings of the controller.
        skipped
            Ticks at which the controller does not run and its outputs are held, shape (ticks,).
        late
            Delay of the samples, in ticks.

        Returns
        -------
        array
            Commands, shape (outputs, ticks).
        """
        inputs = self._inputs
        if late:
            # Demands are no samples and are not delayed.
            outputs = [("/command", name) for name in self._control.outputs]
            inputs = [
                column
                if channel in outputs
                else np.concatenate([np.full(late, column[0]), column[:-late]])
                for column, channel in zip(inputs, self._control.channels, strict=True)
            ]
        if skipped is None:
            return self._control.replay(settings, inputs, self._period)
        runs = np.nonzero(~skipped)[0]
        # The controller does not know that ticks were missed: its filters see successive samples
        # and the nominal period.
        executed = self._control.replay(settings, [column[runs] for column in inputs], self._period)
        # Each tick shows the outputs of the last executed tick; before the first one they are 0.
        last = np.searchsorted(runs, np.arange(len(skipped)), side="right") - 1
        return np.where(last >= 0, executed[:, np.maximum(last, 0)], 0.0)

    def misfit(self, commands: Array, counted: NDArray[np.bool_] | None = None) -> float:
        """Return the rms error of the worst command, in units of the error that counts as exact.

        Parameters
        ----------
        commands
            Replayed commands, shape (outputs, ticks).
        counted
            Ticks that are compared, shape (ticks,). Defaults to all of them.

        Returns
        -------
        float
            Misfit; at most 1 for an exact replay, `DIVERGED` where the replay is not finite.
        """
        difference = (commands - self.recorded)[:, SETTLED:]
        if counted is not None:
            difference = difference[:, counted[SETTLED:]]
        # The negated comparison also catches NaN.
        if not np.max(np.abs(difference), initial=0.0) < DIVERGED:
            return DIVERGED
        return max(rms(row) / exact for row, exact in zip(difference, self._exact, strict=True))

    def deviation(self) -> Deviation | None:
        """Return the deviation that explains the commands; None if the settings reproduce them."""
        commands = self.commands(self._settings)
        misfit = self.misfit(commands)
        if misfit <= 1.0:
            return None
        # Missed ticks and delays have an exact signature and are tested first. Another value of a
        # setting might imitate them approximately.
        deviation = (
            self._find_missed_ticks()
            or self._find_delay()
            or self._find_setting(misfit)
            or Deviation("unknown", "", 0.0, 0.0, "1")
        )
        return replace(deviation, consequence=self._consequence(commands))

    def _consequence(self, commands: Array) -> float:
        """Return the rms error of the worst command, as a share of its standard deviation."""
        differs = np.sqrt(np.mean((commands - self.recorded)[:, SETTLED:] ** 2, axis=1))
        moves = np.std(self.recorded[:, SETTLED:], axis=1)
        shares = [
            (error / motion if motion > 0.0 else math.inf)
            for error, motion in zip(differs.tolist(), moves.tolist(), strict=True)
            # A constant command has no motion to relate its error to: it is either reproduced, or
            # off by an infinite share.
            if error > 0.0
        ]
        return max(shares, default=0.0)

    def _find_missed_ticks(self) -> Deviation | None:
        """Return missed ticks: some ticks repeat all commands, and the others are exact.

        The controller may have run during the missed ticks, or not; both are tried.
        """
        # A held output repeats to the last bit, which a controller with noisy inputs hardly ever
        # does for all outputs at once.
        repeated = np.concatenate([[False], np.all(np.diff(self.recorded, axis=1) == 0.0, axis=0)])
        if not 0 < repeated.sum() < REPEATED * len(repeated):
            return None
        running = self.misfit(self.commands(self._settings), ~repeated)
        skipping = self.misfit(self.commands(self._settings, repeated))
        if min(running, skipping) > 1.0:
            return None
        return Deviation("missed_ticks", "missed_ticks", 0.0, float(repeated.mean()), "1")

    def _find_delay(self) -> Deviation | None:
        """Return the delay of the samples that makes the replay exact."""
        for late in range(1, LATE + 1):
            if self.misfit(self.commands(self._settings, late=late)) <= 1.0:
                return Deviation("delay", "delay", 0.0, late * self._period, "s")
        return None

    def _find_setting(self, nominal_misfit: float) -> Deviation | None:
        """Return the single setting that reproduces the commands at another value."""
        trials: list[tuple[float, Deviation]] = []
        for name, meaning in fields(type(self._settings)).items():
            nominal = float(getattr(self._settings, name))
            if name == "mode" or (nominal == 0.0 and self._control.exact is not None):
                continue

            def misfit(value: Any, name: str = name) -> float:
                settings = self._settings._replace(**{name: value})
                try:
                    commands = self.commands(settings)
                except RigtwinError:
                    # Settings from which no controller can be made reproduce nothing.
                    return DIVERGED
                return self.misfit(commands)

            if isinstance(meaning, Quantity):
                best, value = _minimise(misfit, nominal, meaning)
                trials.append((best, Deviation("setting", name, nominal, value, meaning.unit)))
            else:
                best, value = min((misfit(choice), float(choice)) for choice in meaning)
                trials.append((best, Deviation("setting", name, nominal, value, "1")))
        # An inexact description never replays exactly, so there a setting must only come much
        # closer.
        enough = 1.0 if self._control.exact is None else max(1.0, CLOSER * nominal_misfit)
        return min(
            (trial for trial in trials if trial[0] <= enough and self._reproduces(trial[1])),
            key=lambda trial: trial[0],
            default=(0.0, None),
        )[1]

    def _reproduces(self, deviation: Deviation) -> bool:
        """Return whether a deviating setting gives nearly the recorded commands.

        A lower misfit alone does not suffice: any setting that reduces the commands may lower it.
        """
        if self._control.exact is None:
            return True
        settings = self._settings._replace(**{deviation.name: deviation.used})
        return self._consequence(self.commands(settings)) < NEARLY


def _minimise(
    misfit: Callable[[float], float], nominal: float, meaning: Quantity
) -> tuple[float, float]:
    """Return the smallest misfit over one setting, and its value.

    A coarse grid about the nominal value is followed by a bounded search between its neighbours.
    """
    from scipy.optimize import minimize_scalar  # Imported here, as it loads slowly.

    # A setting of 0 has no size of its own, so a hundredth of its upper bound stands for it, at
    # most 0.01.
    size = max(abs(nominal), 0.01 * min(meaning.high, 1.0))
    # A setting may be 0, as the gain of a skyhook that is off, so that the grid is wide.
    grid = np.unique(np.clip(nominal + size * GRID, meaning.low, meaning.high))
    ends = misfit(grid[0]), misfit(grid[-1])
    # Equality to the last bit is meant: a setting that acts at all changes the rounding.
    if len(grid) == 1 or ends[0] == ends[1] == misfit(grid[len(grid) // 2]):
        # The setting has no effect: it belongs to a part of the controller that is off.
        return ends[0], nominal
    values = [ends[0], *(misfit(value) for value in grid[1:-1]), ends[1]]
    place = int(np.argmin(values))
    # The grid leaves the nominal value out, whose misfit is known to be too large. It still narrows
    # the bracket of a minimum beside it.
    near = np.append(grid, nominal)
    low = near[near < grid[place]].max(initial=meaning.low)
    high = near[near > grid[place]].min(initial=meaning.high)
    # Commands are stored with eight digits, so a setting must be found more precisely to replay
    # them exactly.
    options = {"xatol": 1e-9 * size, "maxiter": 80}
    minimum = minimize_scalar(misfit, bounds=(low, high), method="bounded", options=options)
    return min((float(minimum.fun), float(minimum.x)), (values[place], float(grid[place])))
