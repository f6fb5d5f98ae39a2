"""Fast model of the suspension rig as a quarter car: from commands to readings, without MuJoCo.

The carriage is the only free body. Both plates are prescribed by their cylinders, and the rod has
no inertia. One scalar inclusion per step, solved exactly, therefore replaces the simulator: rail
and motor friction are set-valued. The equation of motion is in `quarter_car_motion`. Actuators,
cylinders, breakaway and sensors are the twin's own functions, and tests hold the model to the twin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controllers import Measurements
from controllers.force import MOTOR_CONSTANT
from rigtwin.components import Computer, Cylinder, RigPlant
from rigtwin.components.plant import select
from rigtwin.components.scales import Motion
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.models.basis import Passage, forms
from rigtwin.models.model import Form, Model
from rigtwin.models.quarter_car_motion import PlateMotion, move_carriage, move_plate
from rigtwin.numerics.arrays import Array, clip_diverged
from rigtwin.numerics.memo import Memo
from rigtwin.recording import Inputs
from rigtwin.simulation.converters import sensors
from rigtwin.simulation.rig_contacts import initial_deflection, initial_yield

COMPONENTS = (
    "motor",
    "rail",
    "tyre",
    "carriage",
    "ground_cylinder",
    "structure_cylinder",
    *Measurements._fields,
)
"""Components on which an unknown input may act."""
DISTURBANCE_SIZE = {"m": 1e-4, "N": 4.0}
"""rms of a trial disturbance. Its response is assumed to be proportional to it."""
KEPT = 64
"""Number of remembered motions of plates."""

KEPT_MOTIONS = 7
"""Number of remembered motions of the whole plant."""
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
STEP_EFFORT = 8e-8
"""Estimated processor time of an integration step, s."""


class Disturbances(NamedTuple):
    """Unmodelled inputs of the plant, which add to its commands."""

    ground: Array  # Motion of the ground plate, m, shape (ticks,).
    structure: Array  # Motion of the structure plate, m, shape (ticks,).
    voltage: Array  # Voltage of the motor's amplifier, V, shape (ticks,).
    force: Array  # Force on the carriage, N, shape (ticks,).


class QuarterCarModel(Model[RigPlant]):
    """Model of the suspension rig under the commands of one test.

    Parameters
    ----------
    ground, structure
        Commands of the cylinders, m, shape (ticks,).
    voltage
        Command of the motor, V, shape (ticks,).
    configuration
        Settings of the test.
    steps
        Integration steps per tick.
    """

    def __init__(
        self,
        ground: Array,
        structure: Array,
        voltage: Array,
        configuration: Configuration,
        steps: int,
    ) -> None:
        self._ground, self._structure, self._voltage = (
            np.ascontiguousarray(c) for c in (ground, structure, voltage)
        )
        self._configuration = configuration
        self._start = configuration.controller.start
        self._preload = configuration.controller.preload
        self._period, self._steps = configuration.timing.period, steps
        # Effects at sensors leave the mechanics as they are: the last motions serve again.
        self._last: Memo[Array] = Memo(KEPT_MOTIONS)
        self._plates: Memo[PlateMotion] = Memo(KEPT)

    @classmethod
    def of(cls, inputs: Inputs, configuration: Configuration, steps: int) -> QuarterCarModel:
        """Return the model under the commands of a recording.

        Parameters
        ----------
        inputs
            Recorded signals.
        configuration
            Settings of the test.
        steps
            Integration steps per tick.

        Raises
        ------
        RigtwinError
            If a command is missing from the recording.
        """
        ground, structure, voltage = (
            inputs.column("/command", name) for name in ("ground", "structure", "voltage")
        )
        return cls(ground, structure, voltage, configuration, steps)

    @property
    def effort(self) -> float:
        return STEP_EFFORT * len(self._voltage) * self._steps

    def halve_steps(self) -> QuarterCarModel:
        """Return the model with half the integration steps."""
        return self._with_steps(max(1, self._steps // 2))

    def double_steps(self) -> QuarterCarModel:
        """Return the model with twice the integration steps."""
        return self._with_steps(2 * self._steps)

    def _with_steps(self, steps: int) -> QuarterCarModel:
        return QuarterCarModel(
            self._ground, self._structure, self._voltage, self._configuration, steps
        )

    def _plate(
        self,
        cylinder: Cylinder,
        computer: Computer,
        commands: Array,
        start: float,
        position: float | None,
    ) -> PlateMotion:
        # Most candidates leave the cylinders as they are, so the plates' motions are remembered.
        # A plate's yielding depends on its load and is left to the carriage's motion.
        unloaded = cylinder._replace(compliance=0.0, yield_lag=0.0, zero_load=0.0)
        key = (unloaded, computer.delay, id(commands), position)
        h, steps = self._period / self._steps, self._steps
        return self._plates.recall(
            key, lambda: move_plate(unloaded, computer, commands, start, position, h, steps)
        )

    def predict_true(self, plant: RigPlant, disturbances: Disturbances | None = None) -> Array:
        """Return what ideal sensors would read, rows as in `Measurements`, shape (4, ticks).

        Parameters
        ----------
        plant
            Parameters of the rig.
        disturbances
            Unmodelled inputs. Default: none.
        """
        timestep = self._period / self._steps
        ground = self._plate(
            plant.ground_cylinder, plant.computer, self._ground, float(self._ground[0]), None
        )
        # At the start the suspension is uncompressed and the tyre carries the preload.
        start = float(ground.position[0]) - initial_deflection(plant, self._preload)
        start += initial_yield(plant, self._preload)[0]
        structure = self._plate(
            plant.structure_cylinder, plant.computer, self._structure, self._start, start
        )
        zero = np.zeros_like(self._voltage)
        disturbances = disturbances or Disturbances(zero, zero, zero, zero)
        ground = self._displace(ground, disturbances.ground)
        structure = self._displace(structure, disturbances.structure)
        out = move_carriage(
            plant=plant,
            plates=(ground, structure),
            voltage=self._voltage + disturbances.voltage,
            pushed=disturbances.force,
            start=start,
            travel=0.0,
            preload=self._preload,
            timestep=timestep,
            steps=self._steps,
        )
        return clip_diverged(out)

    def _displace(self, plate: PlateMotion, shift: Array) -> PlateMotion:
        if not shift.any():
            return plate
        ticks = np.arange(len(shift) * self._steps + 1) / self._steps
        motion = np.interp(ticks, np.arange(len(shift)), shift)
        ahead = motion[np.arange(len(shift)) * self._steps + 1]
        return PlateMotion(plate.position + motion, plate.onward + ahead)

    def predict_disturbed(self, plant: RigPlant, entry: str, amount: Array) -> Array:
        """Return the sensors' readings under a disturbance, shape (4, ticks).

        Parameters
        ----------
        plant
            Parameters of the rig.
        entry
            Name of a sensor, or field of `Disturbances`. A voltage is given as motor force, N.
        amount
            Disturbance, m or N, shape (ticks,).
        """
        if entry in Measurements._fields:
            sensed = self.predict(plant)
            sensed[Measurements._fields.index(entry)] += amount
            return sensed
        amounts = dict.fromkeys(Disturbances._fields, np.zeros_like(amount))
        amounts[entry] = amount / MOTOR_CONSTANT if entry == "voltage" else amount
        return self._sense(plant, self.predict_true(plant, Disturbances(**amounts)))

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
        """Return the sensors' readings without noise and quantisation, shape (4, ticks)."""
        mechanical = select(plant, MECHANICAL)
        true = self._last.recall(mechanical, lambda: self.predict_true(plant))
        return self._sense(plant, true)

    def _sense(self, plant: RigPlant, true: Array) -> Array:
        readings = zip(sensors(plant), true, strict=True)
        return np.stack([apply_sensor(sensor, row, self._period) for sensor, row in readings])
