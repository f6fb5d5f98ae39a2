"""Simulation of joints that act on each other and of which some are free: forward dynamics.

A coordinate is either prescribed or free. Position sensors and position actuators prescribe motion,
as a road prescribes the motion of a wheel. Free coordinates follow from the equation of motion
(`forward_motion`) under force actuators, servos, guides and the prescribed coordinates, starting
from the state that the sensors show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import mujoco
import numpy as np

from rigtwin.components import (
    UNLIMITED,
    Base,
    Body,
    ForceActuator,
    Guide,
    PositionActuator,
    Rotor,
    Servo,
    component_of,
)
from rigtwin.components.body import list_parameters, list_surplus, turn_gravity
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.guide import Friction, acts, friction, friction_size
from rigtwin.components.plant import Plant, select
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.components.servo import Push, push_law, pusher_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine, ReplayOf, Row
from rigtwin.models.following import follow_command
from rigtwin.models.forward_arrays import GuideContacts, Servos, State, StepInputs, allocate
from rigtwin.models.forward_motion import advance
from rigtwin.models.initial_state import InitialState, Seen
from rigtwin.models.joint_motion import RIGID
from rigtwin.models.joint_simulation import KEPT, LIGHTEST
from rigtwin.models.measured_motion import ELASTIC, recover_motion
from rigtwin.models.multibody import Multibody, inertia_at
from rigtwin.models.windows import Window, divide
from rigtwin.numerics.arrays import Array, clip_diverged, interpolate
from rigtwin.numerics.memo import Memo
from rigtwin.recording import Inputs
from rigtwin.signals.noise import smallest_step, smooth, white_noise


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
        self.every, self._quick = every, quick
        self._machine, self._replay, self._signals = machine, replay, inputs
        self._configuration, self._steps = configuration, steps
        self._period, self._ticks = inputs.period, inputs.ticks
        self.rows: tuple[Row, ...] = replay.rows
        components = machine.components
        movers = [(name, components[name].component_type) for name in replay.moved_by]
        self._pushers = [name for name, of in movers if of is ForceActuator]
        self._servos = [name for name, of in movers if of is Servo]
        self._leaders = [n for n in replay.moved_by if n not in (*self._pushers, *self._servos)]
        # The free coordinates come first, the prescribed ones after them.
        joints = [*replay.free, *(components[name].joint for name in self._leaders)]
        guides, rotors = machine.components_of(Guide), machine.components_of(Rotor)
        self._bodies = Multibody(machine.model, joints, guides, rotors)
        self._heavy = {body.name: body.mjcf for body in machine.components_of(Body)}
        self._base = next((base.name for base in machine.components_of(Base)), None)
        self._along = {
            name: self._bodies.express(component.acts_on) for name, component in components.items()
        }
        self._zero = {
            name: self._bodies.measure(component.acts_on) for name, component in components.items()
        }
        self._guides = [guide.name for guide in guides if self._along[guide.name].any()]
        self._rotors = [rotor.name for rotor in rotors if self._along[rotor.name].any()]
        self._loose = len(replay.free)
        self._free = np.arange(self._loose)
        self._held = np.arange(len(replay.free), len(joints))
        self._read_motions(inputs)
        self._loosest = self._find_loosest()
        self._changed: Memo[Multibody] = Memo(KEPT)
        self._last: Memo[Array] = Memo(KEPT)
        self._starts: Memo[Array] = Memo(KEPT)
        self._moved: Memo[tuple[Array, Array]] = Memo(KEPT)
        self._windows = self._divide(cuts) if windows is None else tuple(windows)

    def _read_motions(self, inputs: Inputs) -> None:
        """Smooth the prescribed motions and collect the sensors that show the initial state."""
        components = self._machine.components
        self._read = {
            name: smooth(self._column(name), self._period)
            for name in self._leaders
            if components[name].quantity == "position"
        }
        self._seen = {
            name: self._seen_by(name, kind)
            for name, component in components.items()
            if (kind := component.quantity) in ("position", "velocity")
            and component.channel in inputs.channels
            and self._along[name].any()
        }

    def _column(self, name: str) -> Array:
        channel = self._machine.components[name].channel
        assert channel is not None
        return self._signals.column(*channel)

    def _find_loosest(self) -> Array:
        """Return the smallest inertia that each guide can feel at the start, kg, shape (guides,).

        That is 1 / (aᵀ M⁻¹ a), with the guide's direction a and all other coordinates free to move
        (the operational-space inertia; Khatib, IEEE Journal of Robotics and Automation 3(1), 1987).
        """
        plant = self._configuration.plant
        free = len(self._free)
        data = self._bodies.data()
        bodies = self._bodies.bodies(data, self._turning(plant))
        place = self._state_of(0, self._ticks).read(plant)[0]
        inertia = inertia_at(bodies, place)[:free, :free]
        smallest = np.full(len(self._guides), 1.0)
        for number, name in enumerate(self._guides):
            along = self._along[name][:free]
            if along.any():
                smallest[number] = 1.0 / max(along @ np.linalg.solve(inertia, along), 1e-300)
        return np.maximum(smallest, LIGHTEST)

    def _turning(self, plant: Plant) -> Array:
        """Return the rotors' inertia matrix Σ J·a·aᵀ, kg, shape (coordinates, coordinates)."""
        size = self._bodies.coordinates
        inertia = np.zeros((size, size))
        for name in self._rotors:
            along, rotor = self._along[name], component_of(plant, name, Rotor)
            inertia += rotor.inertia * np.outer(along, along)
        return inertia

    def _bodies_of(self, plant: Plant) -> Multibody:
        """Return the rigid bodies with the plant's inertial parameters and tilt of the base."""
        # A change of bodies recompiles the MJCF, so the last few variants are remembered.
        key = select(plant, (*self._heavy, *self._bases()))
        return self._changed.recall(key, lambda: self._change_bodies(plant))

    def _change_bodies(self, plant: Plant) -> Multibody:
        changed = {}
        for name, mjcf in self._heavy.items():
            body = component_of(plant, name, Body)
            nominal = self._bodies.list_nominal(mjcf)
            if list_surplus(body, *nominal).any():
                changed[mjcf] = list_parameters(body, nominal[0], nominal[2])
        base = None if self._base is None else component_of(plant, self._base, Base)
        if not changed and (base is None or not any(base)):
            return self._bodies
        turn = None if base is None else (lambda gravity: turn_gravity(base, gravity))
        return self._bodies.change(changed, turn)

    def _bases(self) -> tuple[str, ...]:
        return () if self._base is None else (self._base,)

    # Inputs: prescribed motion, forces, guides

    def _prescribe(self, plant: Plant, shifts: Mapping[str, Array]) -> Array:
        """Return the prescribed positions at the steps, m, shape (coordinates, steps + 1).

        `shifts` maps a sensor to a displacement of its measured motion, m, shape (ticks,).
        """
        count = self._ticks * self._steps + 1
        positions = np.zeros((self._bodies.coordinates, count))
        time = np.arange(self._ticks + 1) * self._period
        fine = np.arange(count) * (self._period / self._steps)
        for place, name in zip(self._held, self._leaders, strict=True):
            if name in self._read:
                signal = self._read[name][0] + shifts.get(name, 0.0)
                position = recover_motion(sensor_of(plant, name), signal, self._period)
            else:
                mover = component_of(plant, name, PositionActuator)
                late, command = plant.computer.delay, self._column(name)
                position = follow_command(mover, command, late, self._period, self._steps)
            position = (position - self._zero[name]) / self._along[name][place]
            # The last step needs a position beyond the last tick: extrapolated.
            position = np.append(position, 2.0 * position[-1] - position[-2])
            positions[place] = position if self._steps == 1 else interpolate(time, position, fine)
        return positions

    def _condition(self, plant: Plant, names: Sequence[str]) -> Array:
        """Return conditioned commands of actuators at the steps, shape (actuators, steps)."""
        commands = np.zeros((len(names), self._ticks * self._steps))
        for number, name in enumerate(names):
            command = np.ascontiguousarray(self._column(name))
            mover = pusher_of(plant, name)
            conditioning = actuator(mover, plant.computer, self._period / self._steps)
            condition_all(
                conditioning,
                hold(conditioning, float(command[0])),
                command,
                self._steps,
                commands[number],
            )
        return commands

    def _push(self, plant: Plant) -> Array:
        """Return the forces of the force actuators at the steps, N, shape (actuators, steps)."""
        forces = self._condition(plant, self._pushers)
        for number, name in enumerate(self._pushers):
            mover = component_of(plant, name, ForceActuator)
            limit = self._limit(plant, name)
            forces[number] = np.clip(mover.constant * forces[number], -limit, limit)
        return forces

    def _limit(self, plant: Plant, name: str) -> float:
        """Return the force limit of a force actuator, N."""
        return min(pusher_of(plant, name).force_limit, UNLIMITED)

    def _serve(self, plant: Plant, commands: Array) -> Servos:
        """Return the servos with conditioned commands at the steps, shape (servos, steps)."""
        size, names = self._bodies.coordinates, self._servos
        laws = [push_law(pusher_of(plant, name)) for name in names]
        return Servos(
            laws=np.array(laws, float).reshape(len(names), len(Push._fields)),
            levers=np.array([self._along[name] for name in names]).reshape(-1, size),
            zero=np.array([self._zero[name] for name in names]),
            inertia=np.array([self._felt(self._along[name]) for name in names]),
            commands=commands,
        )

    def _inputs(self, plant: Plant, pushes: Array, commands: Array) -> StepInputs:
        """Return the inputs of one test without disturbances.

        `pushes` are the forces of the force actuators, N, shape (actuators, steps). `commands` are
        the conditioned commands of the servos, m, shape (servos, steps).
        """
        size = self._bodies.coordinates
        return StepInputs(
            prescribed=self._prescribe(plant, {}),
            pushes=pushes,
            levers=np.array([self._along[name] for name in self._pushers]).reshape(-1, size),
            disturbance=np.zeros((size, self._ticks)),
            guide_disturbance=np.zeros((len(self._guides), self._ticks)),
            servos=self._serve(plant, commands),
        )

    def _contacts(self, plant: Plant, forces: Array) -> GuideContacts:
        """Return the guides as compiled code takes them.

        `forces` are those of the force actuators, N, shape (actuators, steps). They give the load
        by which the friction of a prescribed joint is sized.
        """
        # Rigid dry friction has no spring of its own. A numerical one is as stiff as the step
        # resolves; it keeps the friction single-valued, so that a sticking joint stays put.
        guides = [component_of(plant, name, Guide) for name in self._guides]
        h = self._period / self._steps
        dry = [friction(guide) for guide in guides]
        springs = np.empty(len(guides))
        for number, (name, guide) in enumerate(zip(self._guides, guides, strict=True)):
            rigid = RIGID * self._loosest[number] / h**2
            # A fully prescribed guide must not see its friction jump with the sensor's noise: its
            # spring builds the friction up over the error of the measured motion.
            if not self._along[name][self._free].any():
                load = float(np.sqrt(np.mean(forces**2))) if forces.size else 0.0
                size = max(friction_size(dry[number], load), 1e-300)
                errors = np.array(
                    [self._read[n][1] if n in self._read else 0.0 for n in self._leaders]
                )
                error = float(np.linalg.norm(self._along[name][self._held] * errors))
                rigid = 1.0 / max(ELASTIC * error / size, 1e-12 / size)
            springs[number] = (
                rigid if guide.compliance <= 0.0 else min(1.0 / guide.compliance, rigid)
            )
        size = self._bodies.coordinates
        return GuideContacts(
            guides=np.array(guides, float).reshape(len(guides), len(Guide._fields)),
            dry=np.array(dry, float).reshape(len(guides), len(Friction._fields)),
            along=np.array([self._along[name] for name in self._guides]).reshape(-1, size),
            zero=np.array([self._zero[name] for name in self._guides]),
            springs=springs,
            rests=np.array(
                [self._bodies.rest_of(self._machine.components[name]) for name in self._guides]
            ),
            inertia=self._loosest,
            acts=np.array([acts(guide) for guide in guides], bool),
            rubs=np.array([friction_size(each, 1.0) > 0.0 for each in dry], bool),
        )

    # Initial states

    def _state_of(self, first: int, last: int) -> InitialState:
        """Return the initial state of a window, not yet judged."""
        seen = {name: each.between(first, last) for name, each in self._seen.items()}
        return InitialState(seen, self._bodies.place(), self._loose, self._period)

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
        return tuple(window.last * self._period for window in self._windows[:-1])

    def _starts_of(self, plant: Plant) -> Array:
        """Return initial positions and velocities, m and m/s, shape (windows, 2, coordinates)."""
        if not any(window.state.fitted for window in self._windows):
            return self._read_starts(plant)
        if self._quick:
            return self._move_starts(plant)[0]
        return self._starts.recall(self._key(plant), lambda: self._find_starts(plant))

    def _read_starts(self, plant: Plant) -> Array:
        """Return the initial states as read, shape (windows, 2, coordinates)."""
        return np.stack([window.state.read(plant) for window in self._windows])

    def _move_starts(self, plant: Plant) -> tuple[Array, Array]:
        """Return the states from which a quick prediction is corrected, and how far they are moved.

        The moves are in standard errors, shape (windows, unknowns). One window alone is predicted
        from its state as read. Where errors grow, one correction is not enough, so that the states
        are moved by a first one.
        """
        read = self._read_starts(plant)
        if len(self._windows) == 1:
            return read, np.zeros((1, 2 * self._loose))
        return self._moved.recall(self._key(plant), lambda: self._correct_starts(plant))

    def _correct_starts(self, plant: Plant) -> tuple[Array, Array]:
        sense = self._sense_from(plant)
        moved = [
            window.state.move(plant, sense(window.state.read(plant), window.first, window.last))
            for window in self._windows
        ]
        return np.stack([state for state, _ in moved]), np.stack([by for _, by in moved])

    def _find_starts(self, plant: Plant) -> Array:
        """Return the fitted initial states of all windows, shape (windows, 2, coordinates)."""
        sense = self._sense_from(plant)

        def find(window: Window) -> Array:
            first = window.first
            return window.state.find(plant, lambda start, n: sense(start, first, first + n))

        return np.stack([find(window) for window in self._windows])

    def _sense_from(self, plant: Plant) -> Callable[[Array, int, int], Array]:
        """Return a function that predicts the rows from an initial state, between two ticks."""
        move, undisturbed = self._prepare(plant, {}), self._no_force()
        return lambda start, first, last: self._sense(
            plant, clip_diverged(move(start, *undisturbed, first, last))
        )

    def _seen_by(self, name: str, kind: str) -> Seen:
        measured = self._read[name][0] if name in self._read else self._column(name)
        noise = max(white_noise(measured), smallest_step(measured) / np.sqrt(12.0))
        return Seen(kind, self._along[name], self._zero[name], measured, noise)

    # Motion

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that the motion depends on, as a key of remembered motions."""
        names = {
            *self._guides,
            *self._rotors,
            *self._heavy,
            *self._bases(),
            *self._replay.moved_by,
            *self._seen,
            "computer",
        }
        return select(plant, sorted(names))

    def _no_force(self) -> tuple[Array, Array]:
        return (
            np.zeros((self._bodies.coordinates, self._ticks)),
            np.zeros((len(self._guides), self._ticks)),
        )

    def _prepare(
        self, plant: Plant, shifts: Mapping[str, Array]
    ) -> Callable[[Array, Array, Array, int, int], Array]:
        """Return a function that integrates the machine.

        Its arguments are the initial state, shape (2, coordinates), the disturbances of coordinates
        and guides, N, the first tick, and the tick after the last.
        """
        multibody, turning = self._bodies_of(plant), self._turning(plant)
        inputs = self._inputs(plant, self._push(plant), self._condition(plant, self._servos))
        inputs = inputs._replace(prescribed=self._prescribe(plant, shifts)) if shifts else inputs
        contacts, size = self._contacts(plant, inputs.pushes), multibody.coordinates

        def move(
            start: Array, disturbance: Array, guide_disturbance: Array, first: int, last: int
        ) -> Array:
            # Compiled code knows MuJoCo's data by its address only: this name keeps it alive.
            data: mujoco.MjData = multibody.data()
            bodies = multibody.bodies(data, turning)
            h = self._period / self._steps
            prescribed = inputs.prescribed[:, first * self._steps :]
            state = begin(contacts, start, prescribed, self._held, h)
            out = np.zeros((3, size, last))
            work = allocate(size, self._loose, len(self._guides), len(self._servos))
            advance(
                bodies=bodies,
                contacts=contacts,
                free=self._free,
                held=self._held,
                state=state,
                inputs=inputs._replace(
                    disturbance=disturbance, guide_disturbance=guide_disturbance
                ),
                work=work,
                h=h,
                steps=self._steps,
                first=first,
                last=last,
                out=out,
            )
            return out[:, :, first:]

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
            undisturbed = self._no_force()
            forces = (
                undisturbed[0] if disturbance is None else disturbance,
                undisturbed[1] if guide_disturbance is None else guide_disturbance,
            )
            integrate = self._prepare(plant, shifts or {})
            parts = [
                integrate(start, *forces, window.first, window.last)
                for window, start in zip(self._windows, self._starts_of(plant), strict=True)
            ]
            return clip_diverged(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2))

        plain = disturbance is None and guide_disturbance is None and not shifts
        return self._last.recall(self._key(plant), compute) if plain else compute()

    # Sensors

    def observe(self, row: Row, moved: Array) -> Array:
        """Return what an ideal sensor reads of a motion returned by `move`, shape (ticks,)."""
        along = self._along[row.name]
        if row.kind == "position":
            return along @ moved[0] + self._zero[row.name]
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

    def _felt(self, along: Array) -> float:
        """Return the inertia along a direction, kg or kg m², by the guide that has it."""
        for number, name in enumerate(self._guides):
            if np.array_equal(self._along[name], along):
                return float(self._loosest[number])
        return float(np.max(self._loosest)) if len(self._loosest) else 1.0


def begin(
    contacts: GuideContacts, start: Array, prescribed: Array, held: np.ndarray, h: float
) -> State:
    """Return the state of the machine before its first step.

    Parameters
    ----------
    contacts
        Guides of the machine.
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
        State with all friction springs slack and viscous forces settled.
    """
    place, speed = start[0].copy(), start[1].copy()
    place[held] = prescribed[held, 0]
    speed[held] = (prescribed[held, 1] - prescribed[held, 0]) / h
    along, guides = contacts.along, contacts.guides
    rate = along @ speed
    position = along @ place + contacts.zero
    viscous, more = (Guide._fields.index(name) for name in ("viscous", "viscous_asymmetry"))
    damping = guides[:, viscous] + 0.5 * guides[:, more] * np.where(rate > 0.0, 1.0, -1.0)
    return State(
        place=place,
        speed=speed,
        before=speed.copy(),
        slider=position.copy(),
        viscous=damping * rate,
        inner=position.copy(),
        within=np.zeros(len(position)),
    )
