"""Twin of joints that advances tick by tick, for commands that are not known beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigtwin.components.conditioning import Actuator, ActuatorState, condition, hold
from rigtwin.components.servo import Push, push
from rigtwin.description.replay import Row
from rigtwin.models.bodies import Bodies
from rigtwin.models.forward_arrays import GuideContacts, State, StepInputs, allocate
from rigtwin.models.forward_motion import advance
from rigtwin.numerics.arrays import Array


@dataclass(frozen=True)
class SteppedActuator:
    """Actuator that is commanded tick by tick.

    Attributes
    ----------
    model : Actuator
        Conditioning of the command.
    number : int
        Index among the machine's actuators.
    """

    model: Actuator
    number: int


@dataclass(frozen=True)
class IdealSensor:
    """Ideal sensor of the coordinates.

    Attributes
    ----------
    row : Row
        Name and measured quantity of the sensor.
    along : Array
        Direction of the sensor in the coordinates, shape (coordinates,).
    zero : float
        Position of the sensor at zero coordinates, m.
    """

    row: Row
    along: Array
    zero: float


class SteppedTwin:
    """Joints that advance one tick at a time.

    Parameters
    ----------
    bodies
        Rigid bodies.
    owner
        Owner of the memory whose address `bodies` holds; kept to keep that memory alive.
    contacts
        Guides of the machine.
    free, held
        Indices of the free and of the prescribed coordinates.
    state
        State at the beginning of the test; advanced with each tick.
    inputs
        Inputs of the whole test. The commands of `drives` in it are ignored.
    laws
        Laws of the actuators.
    drives
        Actuators that are commanded tick by tick.
    sensing
        Sensors that are read tick by tick.
    h
        Integration step, s.
    steps
        Integration steps per tick.
    """

    def __init__(
        self,
        bodies: Bodies,
        owner: object,
        contacts: GuideContacts,
        free: np.ndarray,
        held: np.ndarray,
        state: State,
        inputs: StepInputs,
        laws: Sequence[Push],
        drives: Sequence[SteppedActuator],
        sensing: Sequence[IdealSensor],
        h: float,
        steps: int,
    ) -> None:
        self._bodies, self._owner, self._contacts = bodies, owner, contacts
        self._free, self._held, self._state, self._inputs = free, held, state, inputs
        self._laws, self._drives, self._sensing = tuple(laws), tuple(drives), tuple(sensing)
        self._h, self._steps, self.tick = h, steps, 0
        self._states: list[ActuatorState] = []
        size, two = len(state.place), 2 * steps
        # The kernel sees a window of two ticks, the last one and the current one: a step averages
        # its command with the one before it, and looks no further back.
        self._window = inputs._replace(
            prescribed=np.zeros((size, two + 1)),
            disturbance=np.zeros((size, 2)),
            guide_disturbance=np.zeros((len(inputs.guide_disturbance), 2)),
            pushers=inputs.pushers._replace(commands=np.zeros((len(inputs.pushers.laws), two))),
        )
        self._out = np.zeros((3, size, 2))
        self._work = allocate(size, len(free), len(contacts.springs), len(self._laws))
        # Where nothing but commands moves the machine, no input needs to be looked up.
        self._foretold = len(held) > 0 or len(inputs.pushers.laws) > len(self._drives)

    def sense(self) -> dict[str, float]:
        """Return the readings of ideal sensors before the coming tick, by name.

        Forces are those of the commands up to this tick.
        """
        state, pushed = self._state, None
        readings = {}
        for sensing in self._sensing:
            if sensing.row.kind == "position":
                value = float(sensing.along @ state.place) + sensing.zero
            elif sensing.row.kind == "velocity":
                value = float(sensing.along @ state.speed)
            else:
                pushed = self._find_push() if pushed is None else pushed
                value = float(sensing.along @ pushed) / float(sensing.along @ sensing.along)
            readings[sensing.row.name] = value
        return readings

    def _find_push(self) -> Array:
        """Return the actuators' force on each coordinate, N, shape (coordinates,)."""
        window, last = self._window, 2 * self._steps - 1
        forces = np.zeros(len(self._state.place))
        midspeed = self._state.speed + 0.5 * (self._state.speed - self._state.before)
        pushers = window.pushers
        for number, law in enumerate(self._laws):
            lever = pushers.levers[number]
            at = float(lever @ self._state.place) + float(pushers.zero[number])
            rate = float(lever @ midspeed)
            if pushers.plays[number]["half"] > 0.0:
                at, rate = self._state.rotor[number], self._state.spin[number]
            forces += lever * push(law, pushers.commands[number, last], at, rate)
        return forces

    def step(self, commands: Sequence[float]) -> Array:
        """Advance by one tick.

        Parameters
        ----------
        commands
            Command of each drive, in its unit.

        Returns
        -------
        array
            Positions, velocities and forces at the beginning of the tick, shape (3, coordinates).
        """
        window, steps = self._window, self._steps
        signals = window.pushers.commands
        if not self._states:
            self._states = [
                hold(drive.model, command)
                for drive, command in zip(self._drives, commands, strict=True)
            ]
        # Of the tick before, the kernel looks at the last step alone.
        signals[:, steps - 1] = signals[:, -1]
        if self._foretold:
            self._look_up()
        for drive, state, command in zip(self._drives, self._states, commands, strict=True):
            for step in range(steps, 2 * steps):
                signals[drive.number, step] = condition(drive.model, state, command)
        # Before the first tick the actuators held its first command.
        if self.tick == 0:
            signals[:, steps - 1] = signals[:, steps]
        advance(
            bodies=self._bodies,
            contacts=self._contacts,
            free=self._free,
            held=self._held,
            state=self._state,
            inputs=window,
            work=self._work,
            h=self._h,
            steps=steps,
            first=1,
            last=2,
            out=self._out,
        )
        self.tick += 1
        return self._out[:, :, 1]

    def _look_up(self) -> None:
        """Copy the inputs of this tick that were known before the test into the window."""
        steps, known, window = self._steps, self._inputs, self._window
        first, last = self.tick * steps, (self.tick + 1) * steps
        window.prescribed[:, steps:] = known.prescribed[:, first : last + 1]
        window.pushers.commands[:, steps:] = known.pushers.commands[:, first:last]
