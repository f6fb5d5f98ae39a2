"""Is the controller doing what its operator wrote down? Commands are known exactly, so its replay must be exact too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    Measurements,
    Settings,
    controller,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.quantity import Quantity, fields
from rigtwin.diagnosis.residual import rounding
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording
from rigtwin.signals.noise import rms

EXACT = 20.0
"""Roundings of a recorded command within which a replay is exact."""
REPEATED = 0.2
"""Share of ticks above which equal commands are no missed ticks but a command that does not change."""
LATE = 4
"""Ticks by which the controller's samples may be late."""


@kernel
def _replayed(
    controlling: Controller,
    start: Array,
    sensors: Array,
    demands: Array,
    skipped: NDArray[np.bool_],
    out: Array,
) -> None:
    """sensors, demands: shape (ticks, 4) and (ticks, 3); out: commands, shape (ticks, 4). A skipped tick repeats the last."""
    state = unpacked(to_fixed_tuple(start, SIZE))  # type: ignore[call-arg]
    held = Commands(0.0, 0.0, 0.0, 0.0)
    for tick in range(len(sensors)):
        measured = Measurements(sensors[tick, 0], sensors[tick, 1], sensors[tick, 2], sensors[tick, 3])
        demand = Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2])
        if not skipped[tick]:
            state, held = update(controlling, state, measured, demand)
        for column in range(4):
            out[tick, column] = held[column]


@dataclass(frozen=True)
class Deviation:
    """What the controller did other than told. kind: `setting`, `missed_ticks` or `delay`, or `unknown` if nothing reproduces
    its commands; name: of the setting, or of the parameter; told: the operator's value; used: the value that reproduces the
    commands exactly."""

    kind: str
    name: str
    told: float
    used: float
    unit: str


class ControllerReplay:
    """The commands that some settings give for what was measured, beside those recorded."""

    def __init__(self, recording: Recording, settings: Settings) -> None:
        self._settings, self._period = settings, recording.period
        self.recorded = np.column_stack([recording.column("/command", name) for name in Commands._fields])
        self._sensors = np.column_stack([recording.column("/sensor", name) for name in Measurements._fields])
        self._demands = np.ascontiguousarray(self.recorded[:, :3])
        self._floor = np.array([rounding(column) for column in self.recorded.T])
        self._none = np.zeros(len(self.recorded), bool)

    def commands(self, settings: Settings, skipped: NDArray[np.bool_] | None = None, late: int = 0) -> Array:
        """Commands at every tick, shape (ticks, 4), with samples `late` ticks old."""
        out, sensors = np.empty_like(self.recorded), self._sensors
        if late:
            sensors = np.concatenate([np.repeat(sensors[:1], late, axis=0), sensors[:-late]])
        controlling = controller(settings, self._period)
        start = np.array(packed(initial_state(controlling)))
        _replayed(controlling, start, sensors, self._demands, self._none if skipped is None else skipped, out)
        return out

    def misfit(self, commands: Array, counted: NDArray[np.bool_] | None = None) -> float:
        """rms of what commands differ by, in roundings of the recording; of the worst command."""
        difference = commands - self.recorded
        if counted is not None:
            difference = difference[counted]
        if not np.isfinite(difference).all():
            return float("inf")
        return max(rms(column) / floor for column, floor in zip(difference.T, self._floor, strict=True))

    def deviation(self) -> Deviation | None:
        """What explains that the commands are not those of the settings; None if they are."""
        if self.misfit(self.commands(self._settings)) <= EXACT:
            return None
        return self._missed() or self._late() or self._setting() or Deviation("unknown", "", 0.0, 0.0, "1")

    def _missed(self) -> Deviation | None:
        repeated = np.concatenate([[False], np.all(np.diff(self.recorded, axis=0) == 0.0, axis=1)])
        if not 0 < repeated.sum() < REPEATED * len(repeated):
            return None
        running = self.misfit(self.commands(self._settings), ~repeated)
        skipping = self.misfit(self.commands(self._settings, repeated))
        if min(running, skipping) > EXACT:
            return None
        return Deviation("missed_ticks", "missed_ticks", 0.0, float(repeated.mean()), "1")

    def _late(self) -> Deviation | None:
        for late in range(1, LATE + 1):
            if self.misfit(self.commands(self._settings, late=late)) <= EXACT:
                return Deviation("delay", "delay", 0.0, late * self._period, "s")
        return None

    def _setting(self) -> Deviation | None:
        """The one setting that, at another value, reproduces the commands."""
        best: tuple[float, Deviation] | None = None
        for name, meaning in fields(Settings).items():
            if name == "mode":
                continue
            if not isinstance(meaning, Quantity):
                # A choice: each of its labels.
                tries = [(self._with(name, choice), float(choice)) for choice in meaning]
                left, value = min(((self.misfit(self.commands(s)), number) for s, number in tries))
                unit = "1"
            else:
                left, value = self._best(name, meaning)
                unit = meaning.unit
            if best is None or left < best[0]:
                told_value = float(getattr(self._settings, name))
                best = left, Deviation("setting", name, told_value, value, unit)
        if best is None or best[0] > EXACT:
            return None
        return best[1]

    def _with(self, name: str, value: object) -> Settings:
        return self._settings._replace(**{name: value})

    def _best(self, name: str, meaning: Quantity) -> tuple[float, float]:
        """Smallest misfit over one setting, and where: a coarse look around the told value, then a bounded search."""
        told = float(getattr(self._settings, name))
        size = max(abs(told), 0.01 * min(meaning.high, 1.0))
        # Some settings matter only relative to nothing (a skyhook that is off), so the grid is wide.
        away = size * np.array([-2, -1, -0.75, -0.5, -0.25, 0.25, 0.5, 1, 2, 4])
        grid = np.unique(np.clip(told + away, meaning.low, meaning.high))

        def left(value: float) -> float:
            return self.misfit(self.commands(self._with(name, value)))

        values = [left(value) for value in grid]
        if min(values) == max(values):
            # It changes nothing: a part of the controller that is off.
            return values[0], told
        place = int(np.argmin(values))
        near = np.append(grid, told)
        low = near[near < grid[place]].max(initial=meaning.low)
        high = near[near > grid[place]].min(initial=meaning.high)
        found = minimize_scalar(left, bounds=(low, high), method="bounded", options={"xatol": 1e-9 * size, "maxiter": 80})
        return min((float(found.fun), float(found.x)), (values[place], float(grid[place])))
