"""The plant from its commands to its sensors, without MuJoCo: one degree of freedom, fast enough to
search with.

The carriage is all that moves freely; both plates are prescribed by their cylinders, and the rod
has no inertia. So one scalar inclusion a step, solved exactly, replaces the simulator: rail and
motor friction are set-valued. What depends on the effects (actuators, cylinders, breakaway,
sensors) is the twin's own code; tests hold it against the twin.

Positions are taken at the steps and velocities midway between them, which makes the scheme second
order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from controllers.force import MOTOR_CONSTANT
from rigtwin.components import Computer, Cylinder, Motor, RigPlant
from rigtwin.components.conditioning import Actuator, ActuatorState, actuator, condition, hold
from rigtwin.components.cylinder import (
    CylinderModel,
    CylinderState,
    advance_cylinder,
    discretise,
    next_position,
    rest_state,
)
from rigtwin.components.effect import Motion
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.guide import breakaway
from rigtwin.components.sensors import apply_sensor
from rigtwin.components.yielding import share_of_load, solve_yielding
from rigtwin.description.configuration import Configuration
from rigtwin.models.basis import Passage, forms
from rigtwin.models.model import Form
from rigtwin.numerics.arrays import Array, contain
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording
from rigtwin.simulation.converters import sensors
from rigtwin.simulation.plant import (
    Contacts,
    contacts,
    initial_deflection,
    initial_yield,
    stiffness_ratio,
)

COMPONENTS = (
    "motor",
    "rail",
    "tyre",
    "carriage",
    "ground_cylinder",
    "structure_cylinder",
    *Measurements._fields,
)
"""Components that are disturbed in turn."""
DISTURBANCE_SIZE = {"m": 1e-4, "N": 4.0}
"""rms of each disturbance as tried; its response is taken as in proportion to it."""
KEPT = 64
"""Motions of plates that are kept."""

KEPT_MOTIONS = 7
"""Motions of the whole plant that are kept."""
MECHANICAL = (
    "carriage",
    "rail",
    "tyre",
    "motor",
    "gas_spring",
    "ground_cylinder",
    "structure_cylinder",
    "computer",
)
"""Components that the true motion depends on."""


class Plate(NamedTuple):
    """A plate's unloaded motion. position: m at every step and one beyond, shape (steps·ticks +
    1,); onward: where the command held before a tick would take it one step later, shape
    (ticks,)."""

    position: Array
    onward: Array


class Disturbances(NamedTuple):
    """What acts on a plant besides its commands, shape (ticks,) each: motions of the plates m,
    voltage V, force on the carriage N."""

    ground: Array
    structure: Array
    voltage: Array
    force: Array


class Carriage(NamedTuple):
    """What the carriage's equation of motion needs besides its contacts."""

    timestep: float
    mass: float
    rail_viscous: float
    motor_viscous: float
    motor_constant: float
    motor_share: float
    voltage_limit: float


@kernel
def _plate(
    model: CylinderModel,
    state: CylinderState,
    conditioning: Actuator,
    held: ActuatorState,
    commands: Array,
    steps: int,
    position: Array,
    onward: Array,
) -> None:
    for tick in range(len(commands)):
        onward[tick] = next_position(model, state, held.memory[3])
        for step in range(steps):
            position[tick * steps + step] = state.position[0]
            advance_cylinder(model, state, condition(conditioning, held, commands[tick]))
    position[len(commands) * steps] = state.position[0]


def move_plate(
    cylinder: Cylinder,
    computer: Computer,
    commands: Array,
    start: float,
    at: float | None,
    timestep: float,
    steps: int,
) -> Plate:
    """A cylinder under its commands, from rest.

    Parameters
    ----------
    cylinder, computer
        Their parameters.
    commands
        m, shape (ticks,).
    start
        Command that was held before, m.
    at
        Where it rests, m; None: where that command holds it.
    timestep
        s.
    steps
        Of integration a tick.

    Returns
    -------
    Plate
        Its unloaded motion.
    """
    conditioning = actuator(cylinder, computer, timestep)
    held = hold(conditioning, start)
    out = Plate(np.empty(len(commands) * steps + 1), np.empty(len(commands)))
    state = rest_state(cylinder, float(held.memory[3]) if at is None else at)
    _plate(
        model=discretise(cylinder, timestep),
        state=state,
        conditioning=conditioning,
        held=held,
        commands=commands,
        steps=steps,
        position=out.position,
        onward=out.onward,
    )
    return out


@compilable
def solve_velocity(
    rhs: float, inertia: float, rail: tuple[float, float], motor: tuple[float, float], plate: float
) -> float:
    """The velocity v that solves inertia·v + rail friction − motor friction ∋ rhs.

    Parameters
    ----------
    rhs, inertia
        Momentum Ns, and kg.
    rail
        Impulses, Ns, that it can bear against positive and negative v.
    motor
        The same against positive and negative plate − v.
    plate
        The plate's velocity, m/s.

    Returns
    -------
    float
        m/s.
    """
    below = (rhs + rail[1] + motor[0]) / inertia
    if below < min(0.0, plate):
        return below
    above = (rhs - rail[0] - motor[1]) / inertia
    if above > max(0.0, plate):
        return above
    between = (
        (rhs - rail[0] + motor[0]) / inertia
        if plate > 0.0
        else (rhs + rail[1] - motor[1]) / inertia
    )
    return min(max(between, min(0.0, plate)), max(0.0, plate))


@compilable
def motor_friction(
    rhs: float,
    inertia: float,
    rail: tuple[float, float],
    motor: tuple[float, float],
    plate: float,
    velocity: float,
) -> float:
    """The dry friction of the motor at that solution.

    Parameters
    ----------
    rhs, inertia, rail, motor, plate
        As `solve_velocity` takes them.
    velocity
        Its solution, m/s.

    Returns
    -------
    float
        Impulse on the carriage, Ns.
    """
    if velocity < plate:
        return motor[0]
    if velocity > plate:
        return -motor[1]
    left = inertia * velocity - rhs
    if velocity > 0.0:
        left += rail[0]
    elif velocity < 0.0:
        left -= rail[1]
    else:
        # Both stick: the rail carries what it can, as at the start of a test before anything has
        # moved.
        left += min(max(-left, -rail[1]), rail[0])
    return min(max(left, -motor[1]), motor[0])


@kernel
def _mechanics(
    carriage: Carriage,
    now: Contacts,
    motor_drive: Actuator,
    motor_command: ActuatorState,
    start: float,
    preload: float,
    steps: int,
    ground: Array,
    ground_onward: Array,
    structure: Array,
    structure_onward: Array,
    voltage: Array,
    pushed: Array,
    out: Array,
) -> None:
    """pushed: a force on the carriage besides, N, shape (ticks,); out: the true sensors' values,
    shape (4, ticks)."""
    h = carriage.timestep
    x, v, force = start, 0.0, preload
    yielding = 0.0
    inertia = carriage.mass + h * (carriage.rail_viscous + carriage.motor_viscous)
    # Out of the loop, or out of their tuple: in it they cost as much as the rest of a step.
    rate, yielded, changing = 1.0 / h, now.yielded, now.changing
    ground_fades, structure_fades = 1.0 / (now.ground_lag + h), 1.0 / (now.structure_lag + h)
    ground_share = share_of_load(now.ground_compliance, now.ground_lag, h)
    structure_share = share_of_load(now.structure_compliance, now.structure_lag, h)
    for tick in range(len(voltage)):
        for step in range(-1, steps):
            # Before the tick's commands act, once as if the old ones went on: that is what the
            # sensors see.
            place = tick * steps + max(step, 0)
            ground_here, structure_here = ground[place], structure[place]
            if step < 0:
                ground_there, structure_there = ground_onward[tick], structure_onward[tick]
            else:
                ground_there, structure_there = ground[place + 1], structure[place + 1]
            plate_velocity = (structure_there - structure_here) * rate
            ground_velocity = (ground_there - ground_here) * rate
            structure_now, ground_now = structure_here + yielded[1], ground_here + yielded[0]
            # How fast the plates would give up what they have yielded, without load.
            ground_loss, structure_loss = -yielded[0] * ground_fades, -yielded[1] * structure_fades
            ground_velocity += ground_loss
            travel = structure_now - x
            deflection = ground_now - x
            rail, motor = (
                (h * now.rail.coulomb, h * now.rail.coulomb),
                (h * now.motor.coulomb, h * now.motor.coulomb),
            )
            bias = beside = 0.0
            forward = backward = now.motor.coulomb
            if changing:
                forward, backward = breakaway(now.rail, now.rail_gap, x, v, force)
                rail = (h * forward, h * backward)
                forward, backward = breakaway(
                    now.motor, now.motor_gap, travel, plate_velocity + yielding - v, force
                )
                motor = (h * forward, h * backward)
                if now.cogging != 0.0:
                    bias = now.cogging * math.sin(
                        2.0 * math.pi * travel / now.cogging_pitch + now.cogging_phase
                    )
            if now.gas.force > 0.0:
                beside = spring_force(now.gas, -travel)
            free = carriage.mass * v + h * (
                carriage.motor_viscous * plate_velocity - force - bias - beside + pushed[tick]
            )
            spring = damping = 0.0
            if deflection > 0.0:
                ratio = stiffness_ratio(now, deflection)
                given = 1.0 + ground_share * (h * now.stiffness * ratio + now.damping)
                spring = now.stiffness * (deflection + h * ground_loss) * ratio / given
                damping = now.damping / given
            while True:
                push, resisted = h * (spring + damping * ground_velocity), h * damping
                if now.structure_compliance > 0.0:
                    velocity, cell = solve_yielding(
                        rhs=carriage.mass * v + h * (pushed[tick] - beside) + push,
                        inertia=carriage.mass + h * carriage.rail_viscous + resisted,
                        timestep=h,
                        rail=rail,
                        free=plate_velocity + structure_loss,
                        share=structure_share,
                        force=force + bias,
                        viscous=carriage.motor_viscous,
                        forward=forward,
                        backward=backward,
                    )
                else:
                    rhs, total = free + push, inertia + resisted
                    velocity = solve_velocity(rhs, total, rail, motor, plate_velocity)
                    dry = motor_friction(rhs, total, rail, motor, plate_velocity, velocity) * rate
                    cell = force + bias - dry - carriage.motor_viscous * (plate_velocity - velocity)
                tyre = spring + damping * (ground_velocity - velocity)
                if tyre >= 0.0:
                    break
                # A tyre does not pull.
                spring = damping = 0.0
            if step < 0:
                out[0, tick], out[1, tick], out[2, tick], out[3, tick] = (
                    ground_now,
                    structure_now,
                    travel,
                    cell,
                )
                continue
            yielding = structure_loss + structure_share * cell
            yielded[0] += h * (ground_loss - ground_share * tyre)
            yielded[1] += h * yielding
            asked = condition(motor_drive, motor_command, voltage[tick])
            asked = min(max(asked, -carriage.voltage_limit), carriage.voltage_limit)
            force += carriage.motor_share * (carriage.motor_constant * asked - force)
            v = velocity
            x += h * v


def follow_plates(
    plant: RigPlant,
    timestep: float,
    ground: Array,
    structure: Array,
    voltage: Array,
    pushed: Array,
    preload: float,
    start: float,
) -> Array:
    """The plant between plates that move as prescribed, whatever loads them.

    Parameters
    ----------
    plant
        Its parameters; those of its cylinders do not count.
    timestep
        s.
    ground, structure
        m, at every timestep and at one more, shape (timesteps + 1,).
    voltage, pushed
        V, and a force on the carriage besides, N, shape (timesteps,).
    preload
        Motor force at the start, N.
    start
        Carriage position at the start, m.

    Returns
    -------
    array
        What ideal sensors would read, rows as in Measurements, shape (4, timesteps).
    """
    rigid = Cylinder()
    plant = plant._replace(ground_cylinder=rigid, structure_cylinder=rigid)
    return _integrate(
        plant=plant,
        plates=(Plate(ground, ground[1:]), Plate(structure, structure[1:])),
        voltage=voltage,
        pushed=pushed,
        start=start,
        travel=float(structure[0]) - start,
        preload=preload,
        timestep=timestep,
        steps=1,
    )


def _integrate(
    plant: RigPlant,
    plates: tuple[Plate, Plate],
    voltage: Array,
    pushed: Array,
    start: float,
    travel: float,
    preload: float,
    timestep: float,
    steps: int,
) -> Array:
    """plates: ground and structure, as they move unloaded; start, travel: of carriage and
    suspension at the start, m."""
    motor: Motor = plant.motor
    carriage = Carriage(
        timestep=timestep,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=motor.viscous,
        motor_constant=motor.constant,
        motor_share=1.0 - math.exp(-timestep / motor.time_constant),
        voltage_limit=min(motor.voltage_limit, motor.force_limit / motor.constant),
    )
    out = np.empty((4, len(voltage)))
    ground, structure = plates
    _mechanics(
        carriage=carriage,
        now=contacts(plant, start, travel, preload),
        motor_drive=actuator(motor, plant.computer, timestep),
        motor_command=hold(actuator(motor, plant.computer, timestep), preload / motor.constant),
        start=start,
        preload=preload,
        steps=steps,
        ground=ground.position,
        ground_onward=ground.onward,
        structure=structure.position,
        structure_onward=structure.onward,
        voltage=np.ascontiguousarray(voltage),
        pushed=np.ascontiguousarray(pushed),
        out=out,
    )
    return out


class QuarterCarModel:
    """The plant under the commands of one test. Plates' motions are kept: most candidates leave
    them as they are."""

    every = 1

    def __init__(
        self,
        ground: Array,
        structure: Array,
        voltage: Array,
        configuration: Configuration,
        steps: int,
    ) -> None:
        """ground, structure: commands m; voltage: V; shape (ticks,). steps: of integration a
        tick."""
        self._ground, self._structure, self._voltage = (
            np.ascontiguousarray(c) for c in (ground, structure, voltage)
        )
        self._configuration = configuration
        self._start, self._preload = (
            configuration.controller.start,
            configuration.controller.preload,
        )
        self._period, self._steps = configuration.timing.period, steps
        self._last: dict[tuple[object, ...], Array] = {}
        self._plates: dict[tuple[object, ...], Plate] = {}

    @classmethod
    def of(cls, recording: Recording, configuration: Configuration, steps: int) -> QuarterCarModel:
        """Under the commands of a recording. Raises RigtwinError if one is missing."""
        ground, structure, voltage = (
            recording.column("/command", name) for name in ("ground", "structure", "voltage")
        )
        return cls(ground, structure, voltage, configuration, steps)

    def halve_steps(self) -> QuarterCarModel:
        """The same with half as many steps."""
        return QuarterCarModel(
            self._ground,
            self._structure,
            self._voltage,
            self._configuration,
            max(1, self._steps // 2),
        )

    def double_steps(self) -> QuarterCarModel:
        """The same with twice as many steps."""
        return QuarterCarModel(
            self._ground, self._structure, self._voltage, self._configuration, 2 * self._steps
        )

    def thin(self, longest: float) -> QuarterCarModel:  # noqa: ARG002
        """The same: it is integrated from tick to tick."""
        return self

    def _plate(
        self,
        cylinder: Cylinder,
        computer: Computer,
        commands: Array,
        start: float,
        at: float | None,
    ) -> Plate:
        unloaded = cylinder._replace(compliance=0.0, yield_lag=0.0)
        key = (unloaded, computer.delay, id(commands), at)
        found = self._plates.get(key)
        if found is None:
            if len(self._plates) > KEPT:
                self._plates.clear()
            found = move_plate(
                cylinder=unloaded,
                computer=computer,
                commands=commands,
                start=start,
                at=at,
                timestep=self._period / self._steps,
                steps=self._steps,
            )
            self._plates[key] = found
        return found

    def predict_true(self, plant: RigPlant, besides: Disturbances | None = None) -> Array:
        """What ideal sensors would read, rows as in Measurements, shape (4, ticks). besides: what
        acts on the plant that it does not know."""
        timestep = self._period / self._steps
        ground = self._plate(
            plant.ground_cylinder, plant.computer, self._ground, float(self._ground[0]), None
        )
        # The spring is uncompressed at the start, the tyre carries the preload.
        start = float(ground.position[0]) - initial_deflection(plant, self._preload)
        start += initial_yield(plant, self._preload)[0]
        structure = self._plate(
            plant.structure_cylinder, plant.computer, self._structure, self._start, start
        )
        nothing = np.zeros_like(self._voltage)
        besides = besides or Disturbances(nothing, nothing, nothing, nothing)
        ground, structure = (
            self._displace(ground, besides.ground),
            self._displace(structure, besides.structure),
        )
        out = _integrate(
            plant=plant,
            plates=(ground, structure),
            voltage=self._voltage + besides.voltage,
            pushed=besides.force,
            start=start,
            travel=0.0,
            preload=self._preload,
            timestep=timestep,
            steps=self._steps,
        )
        return contain(out)

    def _displace(self, of: Plate, by: Array) -> Plate:
        if not by.any():
            return of
        ticks = np.arange(len(by) * self._steps + 1) / self._steps
        motion = np.interp(ticks, np.arange(len(by)), by)
        ahead = motion[np.arange(len(by)) * self._steps + 1]
        return Plate(of.position + motion, of.onward + ahead)

    def predict_disturbed(self, plant: RigPlant, entry: str, amount: Array) -> Array:
        """What the plant's sensors would read under a disturbance, shape (4, ticks). entry: a
        sensor's name, or a field of Disturbances, whose voltage is taken in N; amount: shape
        (ticks,)."""
        if entry in Measurements._fields:
            sensed = self.predict(plant)
            sensed[Measurements._fields.index(entry)] += amount
            return sensed
        amounts = dict.fromkeys(Disturbances._fields, np.zeros_like(amount))
        amounts[entry] = amount / MOTOR_CONSTANT if entry == "voltage" else amount
        true = self.predict_true(plant, Disturbances(**amounts))
        return np.stack(
            [
                apply_sensor(sensor, row, self._period)
                for sensor, row in zip(sensors(plant), true, strict=True)
            ]
        )

    def components(self) -> tuple[str, ...]:
        return COMPONENTS

    def forms(self, component: str, plant: RigPlant) -> list[Form]:
        true, sensed = self.predict_true(plant), self.predict(plant)
        wheel = true[1] - true[2]
        wheel_speed, sliding = np.gradient(wheel, self._period), np.gradient(true[2], self._period)

        def build(
            role: str,
            entry: str,
            signal: Array,
            position: Array = wheel,
            speed: Array = wheel_speed,
        ) -> list[Form]:
            return forms(role, entry, Passage(signal, position, speed, true[3], self._period))

        if component in Measurements._fields:
            signal = sensed[Measurements._fields.index(component)]
            return build("load cell" if component == "load_cell" else "sensor", component, signal)
        if component in ("ground_cylinder", "structure_cylinder"):
            place = component.removesuffix("_cylinder")
            return build("cylinder", place, sensed[("ground", "structure").index(place)])
        if component == "motor":
            return build("motor", "voltage", true[3], true[2], sliding)
        if component == "tyre":
            return build("tyre", "force", np.maximum(true[0] - wheel, 0.0))
        return build("rail" if component == "rail" else "mass", "force", wheel)

    def disturbance_size(self, entry: str) -> float:
        return DISTURBANCE_SIZE["N" if entry in ("voltage", "force", "load_cell") else "m"]

    def motion(self, component: str, plant: RigPlant) -> Motion:
        true = self.predict_true(plant)
        if component in ("motor", "load_cell", "suspension_lvdt", "controller"):
            position = true[2]
        elif component.startswith("ground"):
            position = true[0]
        elif component.startswith("structure"):
            position = true[1]
        else:
            position = true[1] - true[2]
        return Motion(position, np.gradient(position, self._period), true[3])

    @property
    def band(self) -> float:
        """Infinite."""
        return math.inf

    def undetermined(self) -> None:
        """None: what moves the wheel is known throughout."""

    def propagated_noise(self, plant: RigPlant) -> None:
        """Sensors' noise reaches the plant only through recorded commands, which are known
        exactly."""

    def predict(self, plant: RigPlant) -> Array:
        """The same through the plant's sensors, noise and quantisation apart."""
        mechanical = tuple(getattr(plant, name) for name in MECHANICAL)
        true = self._last.get(mechanical)
        if true is None:
            true = self.predict_true(plant)
            # Candidates at sensors leave the mechanics as they are, so what was worked out last
            # often serves again.
            self._last = {**dict(list(self._last.items())[-KEPT_MOTIONS:]), mechanical: true}
        return np.stack(
            [
                apply_sensor(sensor, row, self._period)
                for sensor, row in zip(sensors(plant), true, strict=True)
            ]
        )
