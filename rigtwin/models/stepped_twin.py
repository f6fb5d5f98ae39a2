"""The twin of joints in a test whose commands are not known ahead: it goes tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.conditioning import Actuator, ActuatorState, condition, hold
from rigtwin.components.servo import Push, push
from rigtwin.description.machine import Row
from rigtwin.models.forward_motion import Contacts, State, StepInputs, advance
from rigtwin.models.multibody import Bodies
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class Drive:
    """An actuator that is commanded tick by tick. model: how its command is conditioned; factor,
    limit: of the force that a conditioned command makes; servo, number: whether it is one of the
    servos or of the force actuators, and which."""

    model: Actuator
    factor: float
    limit: float
    servo: bool
    number: int


@dataclass(frozen=True)
class Sensing:
    """What an ideal sensor reads. row: which; along: coordinates that it adds up, shape
    (coordinates,), from `zero`."""

    row: Row
    along: Array
    zero: float


class SteppedTwin:
    """All joints at the beginning of a test."""

    def __init__(
        self,
        bodies: Bodies,
        owner: object,
        contacts: Contacts,
        free: np.ndarray,
        held: np.ndarray,
        state: State,
        inputs: StepInputs,
        laws: Sequence[Push],
        drives: Sequence[Drive],
        sensing: Sequence[Sensing],
        h: float,
        steps: int,
    ) -> None:
        """owner: of the memory that compiled code knows by its address; inputs: of the whole test,
        in which the commands of the drives are not looked at; laws: of the servos; h, steps: s, of
        a step, and steps a tick."""
        self._bodies, self._owner, self._contacts = bodies, owner, contacts
        self._free, self._held, self._state, self._inputs = free, held, state, inputs
        self._laws, self._drives, self._sensing = tuple(laws), tuple(drives), tuple(sensing)
        self._h, self._steps, self.tick = h, steps, 0
        self._states: list[ActuatorState] = []
        size, two = len(state.place), 2 * steps
        # The tick before and this one: what is before that has no influence any more.
        self._window = inputs._replace(
            prescribed=np.zeros((size, two + 1)),
            pushes=np.zeros((len(inputs.pushes), two)),
            besides=np.zeros((size, 2)),
            on=np.zeros((len(inputs.on), 2)),
            servos=inputs.servos._replace(commands=np.zeros((len(inputs.servos.laws), two))),
        )
        self._out = np.zeros((3, size, 2))
        movers = len(inputs.pushes) + len(inputs.servos.laws)
        self._foretold = len(held) > 0 or movers > len(self._drives)

    def sense(self) -> dict[str, float]:
        """What ideal sensors read before the coming tick. Forces are those of the commands until
        then."""
        state, pushed = self._state, None
        found = {}
        for each in self._sensing:
            if each.row.kind == "position":
                value = float(each.along @ state.place) + each.zero
            elif each.row.kind == "velocity":
                value = float(each.along @ state.speed)
            else:
                pushed = self._find_push() if pushed is None else pushed
                value = float(each.along @ pushed) / float(each.along @ each.along)
            found[each.row.name] = value
        return found

    def _find_push(self) -> Array:
        """What the actuators push the coordinates with, shape (coordinates,)."""
        window, last = self._window, 2 * self._steps - 1
        found = window.levers.T @ window.pushes[:, last]
        here = self._state.speed + 0.5 * (self._state.speed - self._state.before)
        servos = window.servos
        for number, law in enumerate(self._laws):
            lever = servos.levers[number]
            at = float(lever @ self._state.place) + float(servos.zero[number])
            found += lever * push(law, servos.commands[number, last], at, float(lever @ here))
        return found

    def step(self, commands: Sequence[float]) -> Array:
        """Goes through a tick.

        Parameters
        ----------
        commands
            Of each drive.

        Returns
        -------
        array
            Positions, velocities and forces at its beginning, shape (3, coordinates).
        """
        window, steps = self._window, self._steps
        servos = window.servos.commands
        if not self._states:
            self._states = [
                hold(drive.model, command)
                for drive, command in zip(self._drives, commands, strict=True)
            ]
        # Of what was before, the last step alone is looked at.
        window.pushes[:, steps - 1] = window.pushes[:, -1]
        servos[:, steps - 1] = servos[:, -1]
        if self._foretold:
            self._look_up()
        for drive, state, command in zip(self._drives, self._states, commands, strict=True):
            signal = (servos if drive.servo else window.pushes)[drive.number]
            for step in range(steps, 2 * steps):
                pushed = drive.factor * condition(drive.model, state, command)
                signal[step] = min(max(pushed, -drive.limit), drive.limit)
        if self.tick == 0:
            window.pushes[:, steps - 1] = window.pushes[:, steps]
            servos[:, steps - 1] = servos[:, steps]
        advance(
            bodies=self._bodies,
            contacts=self._contacts,
            free=self._free,
            held=self._held,
            state=self._state,
            inputs=window,
            h=self._h,
            steps=steps,
            first=1,
            last=2,
            out=self._out,
        )
        self.tick += 1
        return self._out[:, :, 1]

    def _look_up(self) -> None:
        """What of this tick was known before the test."""
        steps, known, window = self._steps, self._inputs, self._window
        first, last = self.tick * steps, (self.tick + 1) * steps
        window.prescribed[:, steps:] = known.prescribed[:, first : last + 1]
        window.pushes[:, steps:] = known.pushes[:, first:last]
        window.servos.commands[:, steps:] = known.servos.commands[:, first:last]
