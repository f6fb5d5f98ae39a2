"""Replays of one recording: single components under measured signals, mechanics, closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from controllers import Commands, Measurements
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.sensors import apply_sensor, remove_drift, sensor_of, undo_sensor
from rigtwin.components.yielding import yield_to_load
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import RigControl
from rigtwin.diagnosis.residual import Residual, combine_residuals, compute_residual, rounding
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.rig.component import (
    Output,
    replay_carriage,
    replay_cylinder,
    replay_mechanics,
    replay_motor,
)
from rigtwin.signals.motion import EstimatedMotion, estimate_motion
from rigtwin.signals.noise import band, remove_mains, rms, white_noise
from rigtwin.simulation.rig_contacts import initial_deflection, initial_yield
from rigtwin.simulation.runner import simulate, without_limits

RESOLVED_OVER = 0.03
"""Time within which the travel must change by more than the LVDT's noise, s. Slower motion counts
as standstill."""
CERTAIN = 3.0
"""Number of standard deviations from zero beyond which a velocity's sign is certain."""
CLOSED_LOOP_SEED = 2**31 - 1
"""Seed of the twin's noise in the closed loop. Recordings of a twin are unlikely to share it."""


class Undetermined(Exception):
    """Error of a replay whose output the recorded signals do not determine."""


class ComponentReplays:
    """Replays of one recording by the twin of one configuration.

    Motions are estimated once and shared by all replays. The recording has to pass `data_checks`.
    """

    def __init__(self, recording: RecordedTest, configuration: Configuration) -> None:
        self.recording = recording
        self.configuration = configuration
        self.period = recording.period
        self.preload = configuration.controller.preload
        # The wheel has no sensor of its own: plate position minus travel.
        self.wheel = self._sensor("structure_lvdt") - self._sensor("suspension_lvdt")

    def _sensor(self, name: str) -> Array:
        return self.recording.column("/sensor", name)

    def _command(self, name: str) -> Array:
        return self.recording.column("/command", name)

    def _clean(self, signal: Array) -> Array:
        # Mains hum is not white noise: unless removed, it would add to every component's residual.
        return remove_mains(signal, self.period, self.configuration.plant.mains.frequency)

    def _without_zero(self, name: str) -> Array:
        """Return a sensor's reading without mains hum, offset and drift."""
        sensor = sensor_of(self.configuration.plant, name)
        return remove_drift(sensor, self._clean(self._sensor(name)), self.period) - sensor.offset

    def _apply_sensor(self, name: str, true: Array) -> Array:
        """Return the reading of the twin's sensor of that name for a true signal."""
        return apply_sensor(sensor_of(self.configuration.plant, name), true, self.period)

    def _apply_lvdts(self, wheel: Array) -> Array:
        """Return the difference of both LVDTs' readings for a true wheel position, m."""
        # The wheel has no sensor: its reading is a difference, with the errors of both LVDTs.
        plate = self.structure_motion.position
        return self._apply_sensor("structure_lvdt", plate) - self._apply_sensor(
            "suspension_lvdt", plate - wheel
        )

    def _motion(self, name: str, expected: Array) -> EstimatedMotion:
        """Return the true motion behind a sensor's reading, given the motion a replay expects."""
        # Only the correction passes through the inverse of the sensor, so the expected motion keeps
        # its sharp edges.
        sensor = sensor_of(self.configuration.plant, name)
        mains = self.configuration.plant.mains.frequency
        estimate = estimate_motion(
            self._sensor(name), self._apply_sensor(name, expected), self.period, mains
        )
        return EstimatedMotion(
            expected + undo_sensor(sensor, estimate.correction, self.period),
            estimate.correction,
            estimate.velocity_error / sensor.gain,
        )

    @property
    def _ground_start(self) -> float:
        return float(self._command("ground")[0]) * self.configuration.plant.ground_cylinder.gain

    @cached_property
    def ground_cylinder_output(self) -> Array:
        """Predicted position of the ground plate, m, shape (ticks,)."""
        command, cylinder = self._command("ground"), self.configuration.plant.ground_cylinder
        unloaded = replay_cylinder(cylinder, self.configuration, command, float(command[0]))
        if cylinder.compliance == 0.0:
            return unloaded
        # The plate yields to the tyre's force, which follows from the tyre's measured deflection.
        tyre = self.configuration.plant.tyre.stiffness * (
            self._clean(self._sensor("ground_lvdt") - self.wheel)
        )
        # The tyre presses the ground plate down; it cannot pull it up.
        return unloaded - yield_to_load(cylinder, np.maximum(tyre, 0.0), self.period)

    @cached_property
    def structure_cylinder_output(self) -> Array:
        """Predicted position of the structure plate, m, shape (ticks,)."""
        start = self.configuration.controller.start
        cylinder = self.configuration.plant.structure_cylinder
        # A test starts with an uncompressed suspension: the plate stands at the wheel's height.
        plant = self.configuration.plant
        uncompressed = self._ground_start - initial_deflection(plant, self.preload)
        uncompressed += initial_yield(plant, self.preload)[0]
        unloaded = replay_cylinder(
            cylinder, self.configuration, self._command("structure"), start, uncompressed
        )
        # The load cell measures the load of this plate directly.
        load = self._clean(self._sensor("load_cell"))
        return unloaded + yield_to_load(cylinder, load, self.period)

    @cached_property
    def ground_motion(self) -> EstimatedMotion:
        """Motion of the ground plate, estimated from its LVDT."""
        return self._motion("ground_lvdt", self.ground_cylinder_output)

    @cached_property
    def structure_motion(self) -> EstimatedMotion:
        """Motion of the structure plate, estimated from its LVDT."""
        return self._motion("structure_lvdt", self.structure_cylinder_output)

    @cached_property
    def carriage_output(self) -> Array:
        """Predicted position of the wheel under the measured force, m, shape (ticks,)."""
        sensor = self.configuration.plant.load_cell
        # The cell's zero and drift are removed here, its gain, lag and delay by `undo_sensor`.
        force = undo_sensor(sensor, self._without_zero("load_cell"), self.period)
        return replay_carriage(
            self.configuration, self.ground_motion.position, force + self._gas_force(), self.preload
        )

    def _gas_force(self) -> Array:
        """Return the force of the gas spring at the measured travel, N, shape (ticks,)."""
        spring = self.configuration.plant.gas_spring
        if spring.force == 0.0:
            return np.zeros(self.recording.ticks)
        sensor = self.configuration.plant.suspension_lvdt
        travel = undo_sensor(sensor, self._without_zero("suspension_lvdt"), self.period)
        return np.array([spring_force(spring, -stroke) for stroke in travel.tolist()])

    @cached_property
    def travel_motion(self) -> EstimatedMotion:
        """Motion of the travel, estimated from the carriage's replay and both LVDTs."""
        mains = self.configuration.plant.mains.frequency
        estimate = estimate_motion(
            self.wheel, self._apply_lvdts(self.carriage_output), self.period, mains
        )
        sensor = self.configuration.plant.suspension_lvdt
        wheel = self.carriage_output + undo_sensor(sensor, estimate.correction, self.period)
        # Travel is a difference of two estimates with independent errors.
        error = math.hypot(
            self.structure_motion.velocity_error, estimate.velocity_error / sensor.gain
        )
        return EstimatedMotion(self.structure_motion.position - wheel, estimate.correction, error)

    @cached_property
    def mechanics_output(self) -> Output:
        """Predicted force and wheel position of motor and carriage together."""
        return replay_mechanics(
            self.configuration,
            self.ground_motion.position,
            self.structure_motion.position,
            self._command("voltage"),
            self.preload,
        )

    def _residual(self, measured: Array, output: Array, unit: str) -> tuple[Residual, Array]:
        difference = self._clean(measured - output)
        return compute_residual(difference, white_noise(measured), unit, self.period), difference

    def motor(self) -> Residual:
        """Return the motor's residual at the ticks at which the motor is known to slide.

        Voltage and travel do not determine its friction at standstill.
        """
        measured, travel = self._sensor("load_cell"), self.travel_motion
        output = replay_motor(
            self.configuration, travel.position, self._command("voltage"), self.preload
        )
        # The travel's speed must exceed both the LVDT's noise and the error of the estimate.
        resolved = (
            white_noise(self._sensor("suspension_lvdt")) / RESOLVED_OVER
            + CERTAIN * travel.velocity_error
        )
        slides = np.abs(np.gradient(travel.position, self.period)) > resolved
        if not slides.any():
            raise Undetermined("the motor never slides fast enough for its friction to be known")
        # The mains filter needs an unbroken signal, so the restriction to sliding comes after it.
        difference = self._clean(measured - self._apply_sensor("load_cell", output))
        residual_rms = rms(difference[slides])
        floor = white_noise(measured)
        return Residual(
            residual_rms,
            floor,
            residual_rms / floor if floor > 0 else math.inf,
            "N",
            # The spectrum needs evenly spaced samples, so ticks at standstill are set to zero.
            band(difference * slides, self.period),
        )

    def carriage(self) -> Residual:
        """Return the residual of the carriage's replay."""
        return self._residual(self.wheel, self._apply_lvdts(self.carriage_output), "m")[0]

    def mechanics(self) -> Residual:
        """Return the residual of force and wheel position of motor and carriage together."""
        force = self._apply_sensor("load_cell", self.mechanics_output.load_cell)
        pairs = {
            "load_cell": self._residual(self._sensor("load_cell"), force, "N"),
            "wheel": self._residual(
                self.wheel, self._apply_lvdts(self.mechanics_output.wheel), "m"
            ),
        }
        return combine_residuals(
            {n: p[0] for n, p in pairs.items()}, {n: p[1] for n, p in pairs.items()}, self.period
        )

    def structure_cylinder(self) -> Residual:
        """Return the residual of the structure cylinder's replay."""
        output = self._apply_sensor("structure_lvdt", self.structure_cylinder_output)
        return self._residual(self._sensor("structure_lvdt"), output, "m")[0]

    def ground_cylinder(self) -> Residual:
        """Return the residual of the ground cylinder's replay."""
        output = self._apply_sensor("ground_lvdt", self.ground_cylinder_output)
        return self._residual(self._sensor("ground_lvdt"), output, "m")[0]

    def _demands(self) -> Array:
        return np.column_stack([self._command(name) for name in ("ground", "structure", "force")])

    def controller(self) -> Residual:
        """Return the residual of the controller's replay, against the recorded commands."""
        # Commands have no noise: their floor is the rounding of the recording.
        control = RigControl()
        inputs = [self.recording.column(*channel) for channel in control.channels]
        replayed = control.replay(self.configuration.controller, inputs, self.period)
        outputs: dict[str, Residual] = {}
        differences: dict[str, Array] = {}
        for number, (name, unit) in enumerate(
            zip(Commands._fields, ("m", "m", "N", "V"), strict=True)
        ):
            recorded = self._command(name)
            differences[name] = replayed[number] - recorded
            outputs[name] = compute_residual(
                differences[name], rounding(recorded), unit, self.period
            )
        return combine_residuals(outputs, differences, self.period)

    def closed_loop(self) -> Residual:
        """Return the residual of the whole test on the twin, tick by tick.

        Where the loop has a limit cycle, twin and recording drift apart in phase.
        """
        # Limits are off: a trip of the twin would cut the comparison short.
        truth = simulate(
            without_limits(self.configuration), self._demands(), CLOSED_LOOP_SEED
        ).truth
        units = ("m", "m", "m", "N")
        pairs = {
            name: self._residual(
                self._sensor(name), self._apply_sensor(name, truth[:, number]), unit
            )
            for number, (name, unit) in enumerate(zip(Measurements._fields, units, strict=True))
        }
        return combine_residuals(
            {n: p[0] for n, p in pairs.items()}, {n: p[1] for n, p in pairs.items()}, self.period
        )


REPLAYS: dict[str, Callable[[ComponentReplays], Residual]] = {
    "motor": ComponentReplays.motor,
    "carriage": ComponentReplays.carriage,
    "mechanics": ComponentReplays.mechanics,
    "structure_cylinder": ComponentReplays.structure_cylinder,
    "ground_cylinder": ComponentReplays.ground_cylinder,
    "controller": ComponentReplays.controller,
    "closed_loop": ComponentReplays.closed_loop,
}
"""Replays by name, in the order in which they are reported."""
