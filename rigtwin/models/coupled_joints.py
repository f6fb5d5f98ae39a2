"""Simulation of joints that act on each other and of which some are free: forward dynamics.

A coordinate is either prescribed or free. Position sensors and position actuators prescribe motion,
as a road prescribes the motion of a wheel. Free coordinates follow from the equation of motion
(`forward_motion`) under force actuators, servos, guides and the prescribed coordinates, starting
from the state that the sensors show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import pairwise

import mujoco
import numpy as np

from rigtwin.components.plant import Plant, select
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.models.bodies import inertia_at
from rigtwin.models.forward_arrays import GuideContacts, Pushers, State, allocate
from rigtwin.models.forward_motion import advance
from rigtwin.models.initial_state import InitialState
from rigtwin.models.joint_drives import JointDrives, recorded
from rigtwin.models.joint_layout import JointLayout
from rigtwin.models.joint_simulation import KEPT, LIGHTEST
from rigtwin.models.multibody import Multibody
from rigtwin.models.seen import Seen
from rigtwin.models.windows import Sense, Window, WindowStarts, divide
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.numerics.memo import Memo
from rigtwin.recording import Inputs
from rigtwin.signals.motion import smooth
from rigtwin.signals.noise import smallest_step, white_noise


class CoupledJoints:
    """Simulation of all coupled joints under the inputs of one recording."""

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
        quick: bool = False,
        windows: Sequence[Window] | None = None,
        cuts: Sequence[float] | None = None,
    ) -> None:
        """Prepare the model.

        Parameters
        ----------
        machine, replay, inputs, configuration, steps
            As `Physics.model` takes them.
        every
            Ticks of the recording for each tick of `inputs`.
        quick
            Whether errors of the start are linear nuisance parameters instead of being fitted.
        windows
            Windows of the same recording at the same ticks. Default: the recording is divided,
            which takes at least as many predictions as there are free positions and velocities.
        cuts
            Times at which the windows of the same recording end, s. Default: where the machine
            has forgotten its initial state.

        Raises
        ------
        RigtwinError
            If a channel is missing.
        """
        self.every = every
        self._machine, self._replay, self._signals = machine, replay, inputs
        self._configuration, self._steps = configuration, steps
        self._period, self._ticks = inputs.period, inputs.ticks
        self.rows: tuple[Row, ...] = replay.rows
        self._layout = JointLayout(machine, replay)
        self._loose = len(replay.free)
        self._read_motions(inputs)
        loosest = self._find_loosest()
        self._drives = JointDrives(machine, self._layout, inputs, self._read, loosest, steps)
        self._last: Memo[Array] = Memo(KEPT)
        windows = self._divide(cuts) if windows is None else tuple(windows)
        self._starts = WindowStarts(windows, quick, KEPT)

    def _read_motions(self, inputs: Inputs) -> None:
        """Smooth the prescribed motions and collect the sensors that show the initial state."""
        components = self._machine.components
        self._read = {
            name: smooth(self._column(name), self._period)
            for name in self._layout.leaders
            if components[name].quantity == "position"
        }
        self._seen = {
            name: self._seen_by(name, kind)
            for name, component in components.items()
            if (kind := component.quantity) in ("position", "velocity")
            and component.channel in inputs.channels
            and self._layout.along[name].any()
        }

    def _column(self, name: str) -> Array:
        return recorded(self._machine, self._signals, name)

    def _find_loosest(self) -> Array:
        """Return the smallest inertia that each guide can feel at the start, kg, shape (guides,).

        That is 1 / (aᵀ M⁻¹ a), with the guide's direction a and all other coordinates free to move
        (the operational-space inertia; Khatib, IEEE Journal of Robotics and Automation 3(1), 1987).
        """
        plant = self._configuration.plant
        free = len(self._layout.free)
        data = self._layout.bodies.data()
        bodies = self._layout.bodies.bodies(data, self._layout.turning(plant))
        place = self._state_of(0, self._ticks).read(plant)[0]
        inertia = inertia_at(bodies, place)[:free, :free]
        smallest = np.full(len(self._layout.guides), 1.0)
        for number, name in enumerate(self._layout.guides):
            along = self._layout.along[name][:free]
            if along.any():
                smallest[number] = 1.0 / max(along @ np.linalg.solve(inertia, along), 1e-300)
        return np.maximum(smallest, LIGHTEST)

    def _bodies_of(self, plant: Plant) -> Multibody:
        """Return the rigid bodies with the plant's inertial parameters and tilt of the base."""
        return self._layout.bodies_of(plant)

    # Initial states

    def _state_of(self, first: int, last: int) -> InitialState:
        """Return the initial state of a window, not yet judged."""
        seen = {name: each.between(first, last) for name, each in self._seen.items()}
        return InitialState(seen, self._layout.bodies.place(), self._loose, self._period)

    def _divide(self, cuts: Sequence[float] | None) -> tuple[Window, ...]:
        """Divide the recording into windows, and judge whether their states have to be fitted."""
        plant = self._configuration.plant
        rows = {
            number: (row, self._machine.prior.even * self._machine.form_of(row))
            for number, row in enumerate(self.rows)
            if row.kind in ("position", "velocity")
        }
        sense = self._sense_from(plant)

        def judge(first: int, last: int) -> InitialState:
            state = self._state_of(first, last)
            judged = {
                number: (self._seen_by(row.name, row.kind).between(first, last), form)
                for number, (row, form) in rows.items()
            }
            state.judge(plant, judged, lambda start, ticks: sense(start, first, first + ticks))
            return state

        if cuts is None:
            return divide(0, self._ticks, self._period, judge)
        ends = [0, *(round(cut / self._period) for cut in cuts), self._ticks]
        return tuple(Window(first, last, judge(first, last)) for first, last in pairwise(ends))

    @property
    def cuts(self) -> tuple[float, ...]:
        """Times at which all windows but the last end, s."""
        return tuple(window.last * self._period for window in self._starts.windows[:-1])

    def _starts_of(self, plant: Plant) -> Array:
        """Return initial positions and velocities, m and m/s, shape (windows, 2, coordinates)."""
        return self._starts.of(plant, self._key(plant), self._sense_from(plant))

    def _sense_from(self, plant: Plant) -> Sense:
        """Return a function that predicts the rows from an initial state, between two ticks."""
        # Inputs are prepared by the first call: states that are known already need none.
        prepare = cache(lambda: self._prepare(plant, {}))
        return lambda start, first, last: self._sense(
            plant, clip_diverged(prepare()(start, first, last))
        )

    def _seen_by(self, name: str, kind: str) -> Seen:
        measured = self._read[name][0] if name in self._read else self._column(name)
        noise = max(white_noise(measured), smallest_step(measured) / np.sqrt(12.0))
        return Seen(kind, self._layout.along[name], self._layout.zero[name], measured, noise)

    # Motion

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that the motion depends on, as a key of remembered motions."""
        names = {
            *self._layout.guides,
            *self._layout.rotors,
            *self._layout.inertial,
            *self._replay.moved_by,
            *self._seen,
            *(name for name in self._layout.encoders.values() if name is not None),
            "computer",
        }
        return select(plant, sorted(names))

    def _prepare(
        self,
        plant: Plant,
        shifts: Mapping[str, Array],
        disturbance: Array | None = None,
        guide_disturbance: Array | None = None,
    ) -> Callable[[Array, int, int], Array]:
        """Return a function that integrates the machine.

        Its arguments are the initial state, shape (2, coordinates), the first tick, and the tick
        after the last. Shifts and disturbances are those of `move`.
        """
        drives = self._drives.resolve(plant)
        multibody, turning = self._bodies_of(plant), drives.turning(plant)
        inputs = drives.collect(plant, shifts)
        if disturbance is not None:
            inputs = inputs._replace(disturbance=disturbance)
        if guide_disturbance is not None:
            inputs = inputs._replace(guide_disturbance=guide_disturbance)
        contacts, size = drives.contacts(plant), multibody.coordinates
        h = self._period / drives.steps
        # New data take longer than the simulation of a short window. Compiled code knows them by
        # their address only: this name keeps them alive.
        data: mujoco.MjData = multibody.data()
        bodies = multibody.bodies(data, turning)
        # Each window writes its own ticks.
        out = np.zeros((3, size, self._ticks))
        work = allocate(size, self._loose, len(self._layout.guides), len(self._layout.pushers))

        def move(start: Array, first: int, last: int, _: mujoco.MjData = data) -> Array:
            prescribed = inputs.prescribed[:, first * drives.steps :]
            state = begin(contacts, inputs.pushers, start, prescribed, self._layout.held, h)
            advance(
                bodies=bodies,
                contacts=contacts,
                free=self._layout.free,
                held=self._layout.held,
                state=state,
                inputs=inputs,
                work=work,
                h=h,
                steps=drives.steps,
                first=first,
                last=last,
                out=out,
            )
            return out[:, :, first:last].copy()

        return move

    def move(
        self,
        plant: Plant,
        disturbance: Array | None = None,
        guide_disturbance: Array | None = None,
        shifts: Mapping[str, Array] | None = None,
    ) -> Array:
        """Simulate the joints.

        Parameters
        ----------
        plant
            Components of the machine.
        disturbance
            Unmodelled force on each coordinate, N, shape (coordinates, ticks). Default: none.
        guide_disturbance
            Unmodelled force on each guide, N, shape (guides, ticks). Default: none.
        shifts
            Sensor → displacement of its measured motion, m, shape (ticks,). Default: none.

        Returns
        -------
        array
            Positions, velocities and forces of the coordinates, shape (3, coordinates, ticks). The
            force is the one required at a prescribed coordinate, and the actuators' force at a
            free one.
        """

        def compute() -> Array:
            integrate = self._prepare(plant, shifts or {}, disturbance, guide_disturbance)
            parts = [
                integrate(start, window.first, window.last)
                for window, start in zip(self._starts.windows, self._starts_of(plant), strict=True)
            ]
            return clip_diverged(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2))

        plain = disturbance is None and guide_disturbance is None and not shifts
        return self._last.recall(self._key(plant), compute) if plain else compute()

    # Sensors

    def observe(self, row: Row, moved: Array) -> Array:
        """Return what an ideal sensor reads of a motion returned by `move`, shape (ticks,)."""
        along = self._layout.along[row.name]
        if row.kind == "position":
            return along @ moved[0] + self._layout.zero[row.name]
        if row.kind == "velocity":
            return along @ moved[1]
        # Forces of coordinates are projected on the sensor's direction.
        return along @ moved[2] / float(along @ along)

    def _true(self, moved: Array) -> Array:
        return np.stack([self.observe(row, moved) for row in self.rows])

    def _apply_sensors(self, plant: Plant, true: Array) -> Array:
        return np.stack(
            [
                apply_sensor(sensor_of(plant, row.name), signal, self._period)
                for row, signal in zip(self.rows, true, strict=True)
            ]
        )

    def _sense(self, plant: Plant, moved: Array) -> Array:
        return self._apply_sensors(plant, self._true(moved))


def begin(
    contacts: GuideContacts,
    pushers: Pushers,
    start: Array,
    prescribed: Array,
    held: np.ndarray,
    h: float,
) -> State:
    """Return the state of the machine before its first step.

    Parameters
    ----------
    contacts, pushers
        Guides and actuators of the machine.
    start
        Positions and velocities, m and m/s, shape (2, coordinates).
    prescribed
        Prescribed positions at the steps, m, shape (coordinates, steps + 1).
    held
        Indices of the prescribed coordinates.
    h
        Integration step, s.

    Returns
    -------
    State
        State with all friction springs slack, viscous forces settled, and the rotors behind a play
        midway in it, as fast as their joints.
    """
    place, speed = start[0].copy(), start[1].copy()
    place[held] = prescribed[held, 0]
    speed[held] = (prescribed[held, 1] - prescribed[held, 0]) / h
    along, guides = contacts.along, contacts.guides
    rate = along @ speed
    position = along @ place + contacts.zero
    more = 0.5 * guides["viscous_asymmetry"]
    damping = guides["viscous"] + np.where(rate > 0.0, more, -more)
    return State(
        place=place,
        speed=speed,
        before=speed.copy(),
        slider=position.copy(),
        viscous=damping * rate,
        inner=position.copy(),
        within=np.zeros(len(position)),
        rotor=pushers.levers @ place + pushers.zero,
        spin=pushers.levers @ speed,
    )
