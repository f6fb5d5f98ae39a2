"""Twin at the card's terminals with a fault in cable or actuator, and a log of its true motion."""

from __future__ import annotations

import numpy as np

from controllers.force import MOTOR_CONSTANT
from rigtwin.description.settings import Safety
from rigtwin.hardware.daq.conversion import conversion, to_values
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.numerics.arrays import Array

SEEN_LVDT, SEEN_FORCE = 0.03, 150.0
"""Errors of a reading, in m and N, from which a fault counts as visible: three times what noise,
tyre and friction explain."""
SEEN_CYLINDER = 0.06
"""Distance of a cylinder's true position from its command, in m, from which a fault counts as
visible. A fast test reaches two thirds of it with a healthy cylinder. The command at which a valve
stuck cannot be measured: the cylinder approaches it with its lag, and yields under its load."""


class FaultyBench:
    """A `Wired` rig with a fault.

    Parameters
    ----------
    terminals : Terminals
        Healthy rig.
    table : ChannelTable
        Channel table by which volts are read.
    kind : str
        Name of a fault in `KINDS`; empty for none.
    at : int
        Tick at which the fault begins.
    place : int
        Index of the faulty input or output.
    seed : int
        Seed of the fault's random numbers.
    ticks : int
        Number of ticks that are logged.

    Attributes
    ----------
    tick : int
        Number of periods that have passed.
    shown : int
        First tick at which the fault is visible, or −1.
    volts : Array
        Voltages at the inputs, shape (4,).
    written, pressure, truth : Array
        Log of the session: output voltages, shape (ticks, 3), presence of pressure, shape
        (ticks,), and true measurements, shape (ticks, 4).
    """

    def __init__(
        self,
        terminals: Terminals,
        table: ChannelTable,
        kind: str,
        at: int,
        place: int,
        seed: int,
        ticks: int,
    ) -> None:
        self._terminals, self._kind, self._at, self._place = terminals, kind, at, place
        self._random = np.random.default_rng(seed)
        self._inputs, self._factor = conversion(table.inputs), conversion(table.outputs).factor
        self._ranges = [line.scaling.range for line in table.inputs]
        self.volts, self._before = terminals.volts.copy(), terminals.volts.copy()
        self._held: float | None = None
        self._direction = float(self._random.choice([-1.0, 1.0]))
        self.tick, self.shown = 0, -1
        self.written, self.pressure = np.zeros((ticks, 3)), np.zeros(ticks, bool)
        self.truth = np.zeros((ticks, 4))
        self._read, self._true = np.empty(4), np.empty(4)

    def advance(self, written: Array, power: bool) -> None:
        """Advance by one period under output voltages, shape (3,)."""
        if self.tick < len(self.written):
            self.written[self.tick], self.pressure[self.tick] = written, power
        acting = written.copy()
        if self.tick >= self._at:
            self._actuate(acting)
        self._terminals.advance(acting, power)
        if self.tick < len(self.truth):
            self.truth[self.tick] = self._terminals.truth
        self.tick += 1
        self._before[:] = self.volts
        self.volts[:] = self._terminals.volts
        if self.tick >= self._at:
            self._sense()

    def _actuate(self, acting: Array) -> None:
        """Apply a fault of an actuator to the voltages that act."""
        place = self._place
        if self._kind == "amplifier dead":
            self._show(abs(acting[2]) * MOTOR_CONSTANT > SEEN_FORCE)
            acting[2] = 0.0
        # The voltage at the moment of the fault stays on the valve.
        elif self._kind == "valve stuck":
            if self._held is None:
                self._held = float(acting[place])
            self._show(self._is_off_command(place))
            acting[place] = self._held
        # An open valve drives the cylinder at full voltage, in either direction.
        elif self._kind == "valve open":
            acting[place] = 10.0 * self._direction
            self._show(self._is_off_command(place))

    def _is_off_command(self, place: int) -> bool:
        """Return whether a cylinder is so far off its command that a fault counts as visible."""
        asked = self.written[min(self.tick, len(self.written) - 1), place] * self._factor[place]
        return abs(self._terminals.truth[place] - asked) > SEEN_CYLINDER

    def _sense(self) -> None:
        """Apply a fault of a sensor to the voltages at the inputs."""
        kind, place, volts = self._kind, self._place, self.volts
        span = self._ranges[place]
        first = self.tick == self._at
        if kind == "dropout":
            volts[place] = 0.0
            self._show(not first)
        elif kind == "stuck":
            # The value of the tick before is repeated for good.
            volts[place] = self._before[place]
            self._show(True)
        elif kind == "spike" and first:
            # A spike lasts one tick and hits anywhere within the range.
            volts[place] += self._direction * span * self._random.uniform(0.1, 0.9)
        elif kind == "not a number":
            volts[place] = np.nan
        elif kind == "wrong sign":
            volts[place] = -volts[place]
        elif kind == "gain x10":
            volts[place] = min(max(10.0 * volts[place], -span), span)
        elif kind == "step":
            volts[place] += self._direction * 0.2 * span
        elif kind == "open input":
            volts[place] = self._random.uniform(-span, span)
        to_values(self._inputs, volts, self._read)
        to_values(self._inputs, self._terminals.volts, self._true)
        # Written so that a reading of NaN counts as visible.
        self._show(
            not abs(self._read[place] - self._true[place])
            <= (SEEN_FORCE if place == 3 else SEEN_LVDT)
        )

    def _show(self, visible: bool) -> None:
        if visible and self.shown < 0:
            self.shown = self.tick

    def find_safe_tick(self) -> int:
        """Return the first tick from which the outputs are safe.

        The motor's voltage is zero for good, and the cylinders are held or without pressure.
        """
        last = min(self.tick, len(self.written))
        # Safe is the state after the last voltage of the motor and the last motion under pressure.
        motor = np.flatnonzero(np.abs(self.written[:last, 2]) > 0.0)
        moving = (
            np.any(np.diff(self.written[:last, :2], axis=0) != 0.0, axis=1) & self.pressure[1:last]
        )
        changes = np.flatnonzero(moving) + 1
        return int(max(motor[-1] + 1 if len(motor) else 0, changes[-1] if len(changes) else 0))

    def peak_share(self, limits: Safety, since: int) -> float:
        """Return the largest true position, travel or force relative to its limit, since a tick."""
        last = min(self.tick, len(self.truth))
        bounds = np.array([limits.ground, limits.structure, limits.travel, limits.force])
        return float(np.max(np.abs(self.truth[since:last]) / bounds)) if last > since else 0.0
