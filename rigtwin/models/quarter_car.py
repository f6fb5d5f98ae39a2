"""The plant from its commands to its sensors, without MuJoCo: one degree of freedom, fast enough to
search with.

The carriage is all that moves freely; both plates are prescribed by their cylinders, and the rod
has no inertia. So one scalar inclusion a step, solved exactly, replaces the simulator: rail and
motor friction are set-valued. What depends on the effects (actuators, cylinders, breakaway,
sensors) is the twin's own code; tests hold it against the twin.
How it moves is in `quarter_car_motion`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controllers import Measurements
from controllers.force import MOTOR_CONSTANT
from rigtwin.components import Computer, Cylinder, RigPlant
from rigtwin.components.effect import Motion
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.models.basis import Passage, forms
from rigtwin.models.model import Form, Model
from rigtwin.models.quarter_car_motion import Plate, move_carriage, move_plate
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.recording import Inputs
from rigtwin.simulation.converters import sensors
from rigtwin.simulation.plant import (
    initial_deflection,
    initial_yield,
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


class Disturbances(NamedTuple):
    """What acts on a plant besides its commands, shape (ticks,) each: motions of the plates m,
    voltage V, force on the carriage N."""

    ground: Array
    structure: Array
    voltage: Array
    force: Array


class QuarterCarModel(Model[RigPlant]):
    """The plant under the commands of one test. Plates' motions are kept: most candidates leave
    them as they are."""

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
    def of(cls, inputs: Inputs, configuration: Configuration, steps: int) -> QuarterCarModel:
        """Under the commands of a recording. Raises RigtwinError if one is missing."""
        ground, structure, voltage = (
            inputs.column("/command", name) for name in ("ground", "structure", "voltage")
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

    def _plate(
        self,
        cylinder: Cylinder,
        computer: Computer,
        commands: Array,
        start: float,
        at: float | None,
    ) -> Plate:
        unloaded = cylinder._replace(compliance=0.0, yield_lag=0.0, zero_load=0.0)
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
        out = move_carriage(
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
        return clip_diverged(out)

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
