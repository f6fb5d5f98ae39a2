"""Model of joints that act on each other and of which some are free: forward dynamics.

A coordinate is either prescribed or free. Position sensors and position actuators prescribe motion,
as a road prescribes the motion of a wheel. Free coordinates follow from the equation of motion
(`forward_motion`) under force actuators, servos, guides and the prescribed coordinates, starting
from the state that the sensors show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

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
    measures,
)
from rigtwin.components.body import list_parameters, list_surplus, turn_gravity
from rigtwin.components.conditioning import actuator, condition_all, hold
from rigtwin.components.effect import Motion
from rigtwin.components.guide import SHAPES, Friction, friction, friction_size
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor
from rigtwin.components.servo import Push, push, push_law
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Component, Machine, ReplayOf, Row
from rigtwin.models.basis import Passage, forms
from rigtwin.models.following import follow_command
from rigtwin.models.forward_motion import GuideContacts, Servos, State, StepInputs, advance
from rigtwin.models.initial_state import InitialState, Seen, Sense
from rigtwin.models.joint import ELASTIC, KEPT, LIGHTEST, SEED, SMALL, recover_motion
from rigtwin.models.joint_motion import RIGID
from rigtwin.models.model import Form, Model
from rigtwin.models.multibody import Multibody, inertia_at
from rigtwin.numerics.arrays import Array, clip_diverged, interpolate
from rigtwin.recording import Inputs
from rigtwin.signals.noise import smooth, white_noise

COMMANDED = "/command"
"""Topic of the signals that are held from tick to tick."""
COARSER = 2.0
"""Factor on the longest step of a search. Each step is checked against the exact prediction, so it
may be tried longer than in models without this check."""
THINNED = 5e-3
"""Largest change of a signal by longer steps in a search, as a share of its standard deviation."""


class ForwardDynamicsModel(Model[Plant]):
    """Forward-dynamics model of all coupled joints of one recording."""

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
        quick: bool = False,
        start: InitialState | None = None,
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
        start
            Judged initial state of the same recording at the same ticks. Default: it is judged,
            which takes as many predictions as there are free positions and velocities.

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
        plant = configuration.plant
        self._pushers = [n for n in replay.moved_by if isinstance(getattr(plant, n), ForceActuator)]
        self._servos = [n for n in replay.moved_by if isinstance(getattr(plant, n), Servo)]
        self._leaders = [n for n in replay.moved_by if n not in (*self._pushers, *self._servos)]
        # The free coordinates come first, the prescribed ones after them.
        joints = [*replay.free, *(components[name].joint for name in self._leaders)]
        at: dict[type, list[Component]] = {Guide: [], Rotor: [], Body: [], Base: []}
        for component in components.values():
            at.get(type(getattr(plant, component.name)), []).append(component)
        self._bodies = Multibody(machine.model, joints, at[Guide], at[Rotor])
        self._heavy = {component.name: component.mjcf for component in at[Body]}
        self._base = at[Base][0].name if at[Base] else None
        self._along = {
            name: self._bodies.express(component.acts_on) for name, component in components.items()
        }
        self._zero = {
            name: self._bodies.measure(component.acts_on) for name, component in components.items()
        }
        self._guides = [c.name for c in at[Guide] if self._along[c.name].any()]
        self._rotors = [c.name for c in at[Rotor] if self._along[c.name].any()]
        self._loose = len(replay.free)
        self._free = np.arange(self._loose)
        self._held = np.arange(len(replay.free), len(joints))
        self._read_motions(inputs)
        self._loosest = self._find_loosest()
        self._changed: dict[tuple[object, ...], Multibody] = {}
        self._last: dict[tuple[object, ...], Array] = {}
        self._starts: dict[tuple[object, ...], Array] = {}
        if start is None:
            self._judge_start()
        else:
            self._start = start

    def _read_motions(self, inputs: Inputs) -> None:
        """Smooth the prescribed motions and collect the sensors that show the initial state."""
        components, plant = self._machine.components, self._configuration.plant
        self._read = {
            name: smooth(self._column(name), self._period)
            for name in self._leaders
            if measures(getattr(plant, name)) == "position"
        }
        seen = {
            name: self._seen_by(name, kind)
            for name, component in components.items()
            if (kind := measures(getattr(plant, name))) in ("position", "velocity")
            and component.channel in inputs.channels
            and self._along[name].any()
        }
        self._start = InitialState(seen, self._bodies.place(), self._loose, self._period)

    def halve_steps(self) -> ForwardDynamicsModel:
        return self._with_steps(max(1, self._steps // 2))

    def double_steps(self) -> ForwardDynamicsModel:
        return self._with_steps(2 * self._steps)

    def _with_steps(self, steps: int) -> ForwardDynamicsModel:
        return ForwardDynamicsModel(
            self._machine,
            self._replay,
            self._signals,
            self._configuration,
            steps,
            self.every,
            self._quick,
            # How well the start is known hardly depends on the integration steps.
            self._start,
        )

    def thin(self, longest: float) -> ForwardDynamicsModel:
        """Return a coarser model for a search: fewer ticks and longer integration steps, as long
        as they change next to nothing, and errors of the start taken as linear."""
        plant = self._configuration.plant
        exact = self.predict(plant)
        swing = np.std(exact, axis=1)
        quick = self._start.fitted and self._start.linear
        for every, steps in self._list_grids(longest):
            if (every, steps, quick) == (1, self._steps, False):
                break
            coarser = ForwardDynamicsModel(
                self._machine,
                self._replay,
                _average_commands(self._signals, every),
                self._configuration,
                steps,
                every,
                quick,
            )
            change = coarser.predict(plant) - exact[:, ::every]
            if bool(np.all(np.sqrt(np.mean(change**2, axis=1)) <= THINNED * swing)):
                return coarser
        return self

    def _list_grids(self, longest: float) -> Iterator[tuple[int, int]]:
        """Yield ticks that make one, and integration steps per such tick, the cheapest first."""
        # What is prescribed is smoothed from all its samples.
        most = 1 if self._leaders else max(int(COARSER * longest / self._period), 1)
        for every in range(most, 0, -1):
            # A record that is slow already has no ticks to spare: stiff servos need short steps.
            steps = math.ceil(every * self._period / (longest if every == 1 else COARSER * longest))
            while steps <= self._steps * every:
                yield every, steps
                steps *= 2

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
        inertia = inertia_at(bodies, self._start.read(plant)[0])[:free, :free]
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
            inertia += getattr(plant, name).inertia * np.outer(self._along[name], self._along[name])
        return inertia

    def _bodies_of(self, plant: Plant) -> Multibody:
        """Return the rigid bodies with the plant's inertial parameters and tilt of the base."""
        # A change of bodies recompiles the MJCF, so the last few variants are remembered.
        key = tuple(getattr(plant, name) for name in (*self._heavy, *self._bases()))
        if key not in self._changed:
            changed = {}
            for name, mjcf in self._heavy.items():
                body, nominal = getattr(plant, name), self._bodies.list_nominal(mjcf)
                if list_surplus(body, *nominal).any():
                    changed[mjcf] = list_parameters(body, nominal[0], nominal[2])
            base = None if self._base is None else getattr(plant, self._base)
            multibody = self._bodies
            if changed or (base is not None and any(base)):
                turn = None if base is None else (lambda gravity: turn_gravity(base, gravity))
                multibody = self._bodies.change(changed, turn)
            self._changed = {**dict(list(self._changed.items())[-KEPT:]), key: multibody}
        return self._changed[key]

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
            mover = getattr(plant, name)
            if isinstance(mover, PositionActuator):
                late, command = plant.computer.delay, self._column(name)
                position = follow_command(mover, command, late, self._period, self._steps)
            else:
                signal = self._read[name][0] + shifts.get(name, 0.0)
                position = recover_motion(mover, signal, self._period)
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
            mover = getattr(plant, name)
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
            mover: ForceActuator = getattr(plant, name)
            limit = self._limit(plant, name)
            forces[number] = np.clip(mover.constant * forces[number], -limit, limit)
        return forces

    def _limit(self, plant: Plant, name: str) -> float:
        """Return the force limit of a force actuator, N."""
        return min(getattr(plant, name).force_limit, UNLIMITED)

    def _serve(self, plant: Plant, commands: Array) -> Servos:
        """Return the servos with conditioned commands at the steps, shape (servos, steps)."""
        size, names = self._bodies.coordinates, self._servos
        laws = [push_law(getattr(plant, name)) for name in names]
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
        guides = [getattr(plant, name) for name in self._guides]
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
            acts=np.array([_acts(guide) for guide in guides], bool),
            rubs=np.array([friction_size(each, 1.0) > 0.0 for each in dry], bool),
        )

    # Initial state

    def _start_of(self, plant: Plant) -> Array:
        """Return initial positions and velocities, m and m/s, shape (2, coordinates)."""
        if self._quick or not self._start.fitted:
            return self._start.read(plant)
        key = self._key(plant)
        if key not in self._starts:
            start = self._start.find(plant, self._sense_from(plant))
            self._starts = {**dict(list(self._starts.items())[-KEPT:]), key: start}
        return self._starts[key]

    def _sense_from(self, plant: Plant) -> Sense:
        """Return a function that predicts the rows from an initial state, for some ticks."""
        move, undisturbed = self._prepare(plant, {}), self._no_force()
        return lambda start, ticks: self._sense(
            plant, clip_diverged(move(start, *undisturbed, ticks))
        )

    def _judge_start(self) -> None:
        """Decide whether the initial state has to be fitted."""
        plant = self._configuration.plant
        rows = {
            number: (
                self._seen_by(row.name, row.kind),
                self._machine.prior.even * self._machine.form_of(row),
            )
            for number, row in enumerate(self.rows)
            if row.kind in ("position", "velocity")
        }
        self._start.judge(plant, rows, self._sense_from(plant))

    def _seen_by(self, name: str, kind: str) -> Seen:
        measured = self._read[name][0] if name in self._read else self._column(name)
        return Seen(kind, self._along[name], self._zero[name], measured)

    # Motion

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that the motion depends on, as a key of remembered motions."""
        names = {
            *self._guides,
            *self._rotors,
            *self._heavy,
            *self._bases(),
            *self._replay.moved_by,
            *self._start.sensors,
            "computer",
        }
        return tuple(getattr(plant, name) for name in sorted(names))

    def _no_force(self) -> tuple[Array, Array]:
        return (
            np.zeros((self._bodies.coordinates, self._ticks)),
            np.zeros((len(self._guides), self._ticks)),
        )

    def _prepare(
        self, plant: Plant, shifts: Mapping[str, Array]
    ) -> Callable[[Array, Array, Array, int], Array]:
        """Return a function that integrates the machine.

        Its arguments are the initial state, shape (2, coordinates), the disturbances of coordinates
        and guides, N, and the number of ticks.
        """
        multibody, turning = self._bodies_of(plant), self._turning(plant)
        inputs = self._inputs(plant, self._push(plant), self._condition(plant, self._servos))
        inputs = inputs._replace(prescribed=self._prescribe(plant, shifts)) if shifts else inputs
        contacts, size = self._contacts(plant, inputs.pushes), multibody.coordinates

        def move(start: Array, disturbance: Array, guide_disturbance: Array, ticks: int) -> Array:
            # Compiled code knows MuJoCo's data by its address only: this name keeps it alive.
            data: mujoco.MjData = multibody.data()
            bodies = multibody.bodies(data, turning)
            h = self._period / self._steps
            state = begin(contacts, start, inputs.prescribed, self._held, h)
            out = np.zeros((3, size, ticks))
            advance(
                bodies=bodies,
                contacts=contacts,
                free=self._free,
                held=self._held,
                state=state,
                inputs=inputs._replace(
                    disturbance=disturbance, guide_disturbance=guide_disturbance
                ),
                h=h,
                steps=self._steps,
                first=0,
                last=ticks,
                out=out,
            )
            return out

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
        plain = disturbance is None and guide_disturbance is None and not shifts
        key = self._key(plant)
        if plain and key in self._last:
            return self._last[key]
        undisturbed = self._no_force()
        out = clip_diverged(
            self._prepare(plant, shifts or {})(
                self._start_of(plant),
                undisturbed[0] if disturbance is None else disturbance,
                undisturbed[1] if guide_disturbance is None else guide_disturbance,
                self._ticks,
            )
        )
        if plain:
            self._last = {**dict(list(self._last.items())[-KEPT:]), key: out}
        return out

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
                apply_sensor(getattr(plant, row.name), signal, self._period)
                for row, signal in zip(self.rows, true, strict=True)
            ]
        )

    def _sense(self, plant: Plant, moved: Array) -> Array:
        return self._apply_sensors(plant, self._true(moved))

    def predict_true(self, plant: Plant) -> Array:
        return self._true(self.move(plant))

    def predict(self, plant: Plant) -> Array:
        predicted = self._sense(plant, self.move(plant))
        return self._start.correct(predicted) if self._quick else predicted

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        disturbance, guide_disturbance = self._no_force()
        if entry in self._guides:
            guide_disturbance[self._guides.index(entry)] = amount
            return self._sense(plant, self.move(plant, guide_disturbance=guide_disturbance))
        if entry in self._leaders:
            return self._sense(plant, self.move(plant, shifts={entry: amount}))
        if entry in self._along and entry not in {row.name for row in self.rows}:
            disturbance += self._along[entry][:, None] * amount
            return self._sense(plant, self.move(plant, disturbance=disturbance))
        predicted = self.predict(plant)
        predicted[[row.name for row in self.rows].index(entry)] += amount
        return predicted

    # Disturbances

    def components(self) -> tuple[str, ...]:
        return (
            *self._guides,
            *self._rotors,
            *self._replay.moved_by,
            *(row.name for row in self.rows),
        )

    def _passage(self, component: str, plant: Plant) -> tuple[Array, Array, Array]:
        """Return position, speed and force along a component's coordinate, shape (ticks,) each."""
        moved, along = self.move(plant), self._along[component]
        if not along.any():
            along = self._along[self.rows[0].name]
        position, speed = along @ moved[0], along @ moved[1]
        if component in self._pushers:
            # The joints' force is that of all actuators together: take this actuator's alone.
            pushed = self._push(plant)[self._pushers.index(component), :: self._steps]
            return position, speed, pushed
        if component in self._servos:
            law = push_law(getattr(plant, component))
            command = self._condition(plant, [component])[0, :: self._steps]
            at = position + self._zero[component]
            passed = [push(law, *each) for each in zip(command, at, speed, strict=True)]
            return position, speed, np.array(passed)
        force = along @ moved[2] / float(along @ along)
        if not force.any():
            # No actuator acts: the force is inertia times acceleration.
            force = self._felt(along) * np.gradient(speed, self._period)
        return position, speed, force

    def _felt(self, along: Array) -> float:
        """Return the inertia along a direction, kg or kg m², by the guide that has it."""
        for number, name in enumerate(self._guides):
            if np.array_equal(self._along[name], along):
                return float(self._loosest[number])
        return float(np.max(self._loosest)) if len(self._loosest) else 1.0

    def forms(self, component: str, plant: Plant) -> list[Form]:
        position, speed, force = self._passage(component, plant)
        part, names = getattr(plant, component), [row.name for row in self.rows]
        signal, role = force, "guide"
        if component in names:
            signal, role = self.predict(plant)[names.index(component)], "sensor"
        elif component in (*self._pushers, *self._servos):
            role = "force"
        elif component in self._leaders:
            signal, role = position, "position"
        elif isinstance(part, Rotor):
            role = "mass"
        return forms(role, component, Passage(signal, position, speed, force, self._period))

    def disturbance_size(self, entry: str) -> float:
        plant, names = self._machine.plant, [row.name for row in self.rows]
        if entry in names:
            size = float(np.std(self.predict(plant)[names.index(entry)]))
        else:
            position, _, force = self._passage(entry, plant)
            size = float(np.std(position if entry in self._leaders else force))
        return SMALL * max(size, 1e-9)

    def motion(self, component: str, plant: Plant) -> Motion:
        known = component if component in self._along else self.rows[0].name
        return Motion(*self._passage(known, plant))

    def propagated_noise(self, plant: Plant) -> Array | None:
        """Return the change of the predictions by one draw of the measured motions' noise."""
        random = np.random.default_rng(SEED)
        shifts = {}
        for name in self._leaders:
            if name in self._read and self._read[name][1] > 0.0:
                level = white_noise(self._column(name))
                signal = self._read[name][0]
                noise = level * random.standard_normal(self._ticks)
                shifts[name] = smooth(signal + noise, self._period)[0] - signal
        if not shifts:
            return None
        return self._true(self.move(plant, shifts=shifts)) - self.predict_true(plant)


def _average_commands(inputs: Inputs, every: int) -> Inputs:
    """Return every n-th tick of the readings, and the means of the commands in between.

    A held command acts over the whole interval, so its mean keeps the impulse on the joint.
    """
    if every == 1:
        return inputs
    starts = np.arange(0, inputs.ticks, every)
    counts = np.diff(np.append(starts, inputs.ticks))
    columns = {
        topic: {
            name: np.add.reduceat(signal, starts) / counts if topic == COMMANDED else signal[starts]
            for name, signal in names.items()
        }
        for topic, names in inputs.columns.items()
    }
    return replace(inputs, period=every * inputs.period, columns=columns)


def _acts(guide: Guide) -> bool:
    """Return whether any parameter of a guide has an effect."""
    return any(value for name, value in guide._asdict().items() if name not in SHAPES)


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
