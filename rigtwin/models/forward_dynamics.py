"""Joints that act on each other, some of them predicted: pushed by force actuators, by each other
and by others that move as measured or as commanded.

What is prescribed moves the machine as a road moves a car; all else goes as its equations of motion
have it, from where the sensors see it start.
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
from rigtwin.components.guide import friction, friction_size
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import apply_sensor
from rigtwin.components.servo import Push, push, push_law
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Component, Machine, ReplayOf, Row
from rigtwin.models.basis import Passage, forms
from rigtwin.models.following import follow_command
from rigtwin.models.forward_motion import Contacts, Servos, State, StepInputs, advance
from rigtwin.models.initial_state import InitialState, Seen, Sense
from rigtwin.models.joint import ELASTIC, KEPT, LIGHTEST, SEED, SMALL, recover_motion
from rigtwin.models.joint_motion import RIGID
from rigtwin.models.model import Form, Model
from rigtwin.models.multibody import Multibody, inertia_at
from rigtwin.numerics.arrays import Array, contain, interpolate
from rigtwin.recording import Inputs
from rigtwin.signals.noise import smooth, white_noise

SHAPES = ("stribeck_velocity", "stribeck_exponent", "cogging_pitch", "cogging_phase")
"""Parameters of a guide that alone do nothing."""
COMMANDED = "/command"
"""Topic whose signals are held from tick to tick."""
COARSER = 2.0
"""Times as long steps as others search with: each is checked against the exact prediction."""
THINNED = 5e-3
"""Share of a signal's own swing that longer steps may change for a search."""


class ForwardDynamicsModel(Model[Plant]):
    """All joints of one recording."""

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
        quick: bool = False,
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
        self._loosest = self._find_loosest()
        self._changed: dict[tuple[object, ...], Multibody] = {}
        self._last: dict[tuple[object, ...], Array] = {}
        self._starts: dict[tuple[object, ...], Array] = {}
        self._judge_start()

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
        )

    def thin(self, longest: float) -> ForwardDynamicsModel:
        """Return a coarser model for a search: fewer ticks and longer integration steps, as long
        as they change next to nothing, and errors of the start taken as linear."""
        plant = self._configuration.plant
        exact = self.predict(plant)
        swing = np.std(exact, axis=1)
        quick = self._start.fitted and self._start.linear
        for every, steps in self._list_grids(COARSER * longest):
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
        most = 1 if self._leaders else max(int(longest / self._period), 1)
        for every in range(most, 0, -1):
            steps = math.ceil(every * self._period / longest)
            while steps <= self._steps * every:
                yield every, steps
                steps *= 2

    def _column(self, name: str) -> Array:
        channel = self._machine.components[name].channel
        assert channel is not None
        return self._signals.column(*channel)

    def _find_loosest(self) -> Array:
        """The inertia that each guide feels where nothing else holds its joints, at the start."""
        plant = self._configuration.plant
        free = len(self._free)
        data = self._bodies.data()
        bodies = self._bodies.bodies(data, self._turning(plant))
        inertia = inertia_at(bodies, self._start.read(plant)[0])[:free, :free]
        found = np.full(len(self._guides), 1.0)
        for number, name in enumerate(self._guides):
            along = self._along[name][:free]
            if along.any():
                found[number] = 1.0 / max(along @ np.linalg.solve(inertia, along), 1e-300)
        return np.maximum(found, LIGHTEST)

    def _turning(self, plant: Plant) -> Array:
        """The rotors' inertia, shape (coordinates, coordinates)."""
        size = self._bodies.coordinates
        found = np.zeros((size, size))
        for name in self._rotors:
            found += getattr(plant, name).inertia * np.outer(self._along[name], self._along[name])
        return found

    def _bodies_of(self, plant: Plant) -> Multibody:
        """With what is other about bodies and base."""
        key = tuple(getattr(plant, name) for name in (*self._heavy, *self._bases()))
        if key not in self._changed:
            changed = {}
            for name, mjcf in self._heavy.items():
                body, nominal = getattr(plant, name), self._bodies.list_nominal(mjcf)
                if list_surplus(body, *nominal).any():
                    changed[mjcf] = list_parameters(body, nominal[0], nominal[2])
            base = None if self._base is None else getattr(plant, self._base)
            found = self._bodies
            if changed or (base is not None and any(base)):
                turn = None if base is None else (lambda gravity: turn_gravity(base, gravity))
                found = self._bodies.change(changed, turn)
            self._changed = {**dict(list(self._changed.items())[-KEPT:]), key: found}
        return self._changed[key]

    def _bases(self) -> tuple[str, ...]:
        return () if self._base is None else (self._base,)

    # What moves it

    def _prescribe(self, plant: Plant, shifts: Mapping[str, Array]) -> Array:
        """Positions of what is prescribed at the steps, shape (coordinates, steps + 1). shifts: of
        measured motions, shape (ticks,)."""
        count = self._ticks * self._steps + 1
        found = np.zeros((self._bodies.coordinates, count))
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
            position = np.append(position, 2.0 * position[-1] - position[-2])
            found[place] = position if self._steps == 1 else interpolate(time, position, fine)
        return found

    def _condition(self, plant: Plant, names: Sequence[str]) -> Array:
        """Commands of actuators as conditioned, at the steps, shape (actuators, steps)."""
        found = np.zeros((len(names), self._ticks * self._steps))
        for number, name in enumerate(names):
            command = np.ascontiguousarray(self._column(name))
            mover = getattr(plant, name)
            conditioning = actuator(mover, plant.computer, self._period / self._steps)
            condition_all(
                conditioning,
                hold(conditioning, float(command[0])),
                command,
                self._steps,
                found[number],
            )
        return found

    def _push(self, plant: Plant) -> Array:
        """Forces of the force actuators at the steps, shape (actuators, steps)."""
        found = self._condition(plant, self._pushers)
        for number, name in enumerate(self._pushers):
            mover: ForceActuator = getattr(plant, name)
            limit = self._limit(plant, name)
            found[number] = np.clip(mover.constant * found[number], -limit, limit)
        return found

    def _limit(self, plant: Plant, name: str) -> float:
        """Of a force actuator, N."""
        return min(getattr(plant, name).force_limit, UNLIMITED)

    def _serve(self, plant: Plant, commands: Array) -> Servos:
        """The servos. commands: as conditioned, at the steps, shape (servos, steps)."""
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
        """What moves it besides measured motions: forces of the force actuators and commands of the
        servos at the steps, shape (actuators, steps) and (servos, steps)."""
        size = self._bodies.coordinates
        return StepInputs(
            prescribed=self._prescribe(plant, {}),
            pushes=pushes,
            levers=np.array([self._along[name] for name in self._pushers]).reshape(-1, size),
            besides=np.zeros((size, self._ticks)),
            on=np.zeros((len(self._guides), self._ticks)),
            servos=self._serve(plant, commands),
        )

    def _contacts(self, plant: Plant, forces: Array) -> Contacts:
        """forces: of the actuators, by which a spring that nobody describes is stiff enough."""
        guides = [getattr(plant, name) for name in self._guides]
        h = self._period / self._steps
        dry = [friction(guide) for guide in guides]
        springs = np.empty(len(guides))
        for number, (name, guide) in enumerate(zip(self._guides, guides, strict=True)):
            rigid = RIGID * self._loosest[number] / h**2
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
        return Contacts(
            guides=np.array(guides, float).reshape(len(guides), len(Guide._fields)),
            dry=np.array(dry, float).reshape(len(guides), -1),
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

    # Where it starts

    def _start_of(self, plant: Plant) -> Array:
        """Positions and velocities, shape (2, coordinates)."""
        if self._quick or not self._start.fitted:
            return self._start.read(plant)
        key = self._key(plant)
        if key not in self._starts:
            found = self._start.find(plant, self._sense_from(plant))
            self._starts = {**dict(list(self._starts.items())[-KEPT:]), key: found}
        return self._starts[key]

    def _sense_from(self, plant: Plant) -> Sense:
        """What is observed from any start, for so many ticks."""
        move, besides = self._prepare(plant, {}), self._no_force()
        return lambda start, ticks: self._sense(plant, contain(move(start, *besides, ticks)))

    def _judge_start(self) -> None:
        """Find out whether the error of a start as it is read shows."""
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

    # How it moves

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """What the motion depends on."""
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
        """The motion as a function of the start, of other forces on coordinates and on guides, and
        of ticks."""
        multibody, turning = self._bodies_of(plant), self._turning(plant)
        inputs = self._inputs(plant, self._push(plant), self._condition(plant, self._servos))
        inputs = inputs._replace(prescribed=self._prescribe(plant, shifts)) if shifts else inputs
        contacts, size = self._contacts(plant, inputs.pushes), multibody.coordinates

        def move(start: Array, besides: Array, on: Array, ticks: int) -> Array:
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
                inputs=inputs._replace(besides=besides, on=on),
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
        besides: Array | None = None,
        on: Array | None = None,
        shifts: Mapping[str, Array] | None = None,
    ) -> Array:
        """Positions, velocities and forces of the coordinates, shape (3, coordinates, ticks).

        Parameters
        ----------
        plant
            Its components.
        besides, on
            Other forces on coordinates and on guides, N, shape (coordinates, ticks) and (guides,
            ticks).
        shifts
            Of measured motions, m, shape (ticks,) each.

        Returns
        -------
        array
            The force is what moves a joint that is prescribed, and what pushes another.
        """
        plain = besides is None and on is None and not shifts
        key = self._key(plant)
        if plain and key in self._last:
            return self._last[key]
        nothing = self._no_force()
        out = contain(
            self._prepare(plant, shifts or {})(
                self._start_of(plant),
                nothing[0] if besides is None else besides,
                nothing[1] if on is None else on,
                self._ticks,
            )
        )
        if plain:
            self._last = {**dict(list(self._last.items())[-KEPT:]), key: out}
        return out

    # What is read

    def observe(self, row: Row, moved: Array) -> Array:
        """What an ideal sensor reads of a motion, as `move` has it, shape (ticks,)."""
        along = self._along[row.name]
        if row.kind == "position":
            return along @ moved[0] + self._zero[row.name]
        if row.kind == "velocity":
            return along @ moved[1]
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
        besides, on = self._no_force()
        if entry in self._guides:
            on[self._guides.index(entry)] = amount
            return self._sense(plant, self.move(plant, on=on))
        if entry in self._leaders:
            return self._sense(plant, self.move(plant, shifts={entry: amount}))
        if entry in self._along and entry not in {row.name for row in self.rows}:
            besides += self._along[entry][:, None] * amount
            return self._sense(plant, self.move(plant, besides=besides))
        found = self.predict(plant)
        found[[row.name for row in self.rows].index(entry)] += amount
        return found

    # What may be wrong

    def components(self) -> tuple[str, ...]:
        return (
            *self._guides,
            *self._rotors,
            *self._replay.moved_by,
            *(row.name for row in self.rows),
        )

    def _passage(self, component: str, plant: Plant) -> tuple[Array, Array, Array]:
        """Position, speed and force of a component's coordinate, shape (ticks,) each."""
        moved, along = self.move(plant), self._along[component]
        if not along.any():
            along = self._along[self.rows[0].name]
        position, speed = along @ moved[0], along @ moved[1]
        if component in self._pushers:
            # Forces of all actuators together are what pushes its joints, too.
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
            # It swings freely: what acts on it is what its inertia shows.
            force = self._felt(along) * np.gradient(speed, self._period)
        return position, speed, force

    def _felt(self, along: Array) -> float:
        """The inertia along a coordinate, kg or kg m²."""
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
        """What the noise of the measured motions makes of what is observed."""
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
    """Return every n-th tick of the readings, and the means of the commands in between."""
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
    """Whether a guide does anything."""
    return any(value for name, value in guide._asdict().items() if name not in SHAPES)


def begin(contacts: Contacts, start: Array, prescribed: Array, held: np.ndarray, h: float) -> State:
    """The state in which a machine starts.

    Parameters
    ----------
    contacts
        What resists.
    start
        Positions and velocities, shape (2, coordinates).
    prescribed, held
        Positions of coordinates at the steps, and which of them are prescribed.
    h
        s, of a step.

    Returns
    -------
    State
        With all springs slack.
    """
    place, speed = start[0].copy(), start[1].copy()
    place[held] = prescribed[held, 0]
    speed[held] = (prescribed[held, 1] - prescribed[held, 0]) / h
    along, guides = contacts.along, contacts.guides
    rate = along @ speed
    own = along @ place + contacts.zero
    viscous, more = (Guide._fields.index(name) for name in ("viscous", "viscous_asymmetry"))
    damping = guides[:, viscous] + 0.5 * guides[:, more] * np.where(rate > 0.0, 1.0, -1.0)
    return State(
        place=place,
        speed=speed,
        before=speed.copy(),
        slider=own.copy(),
        viscous=damping * rate,
        inner=own.copy(),
        within=np.zeros(len(own)),
    )
