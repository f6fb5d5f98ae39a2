"""The replays of one recording: every component alone, driven by measured signals; the mechanics
together; the closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from controllers import Commands, Measurements
from rigtwin.components.gas_spring import spring_force
from rigtwin.components.sensors import apply_sensor, remove_drift, undo_sensor
from rigtwin.components.yielding import yield_to_load
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import RigControl
from rigtwin.diagnosis.residual import Residual, combine_residuals, compute_residual, rounding
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.rig.component import (
    Output,
    replay_carriage,
    replay_cylinder,
    replay_mechanics,
    replay_motor,
)
from rigtwin.signals.noise import (
    EstimatedMotion,
    band,
    estimate_motion,
    remove_mains,
    rms,
    white_noise,
)
from rigtwin.simulation.plant import initial_deflection, initial_yield
from rigtwin.simulation.runner import simulate, without_limits

RESOLVED_OVER = 0.03
"""s; a travel velocity that moves less than the LVDT's noise in this time cannot be told from
standstill."""
CERTAIN = 3.0
"""Standard deviations of a velocity beyond which its sign is certain."""
CLOSED_LOOP_SEED = 2**31 - 1
"""Of the twin's noise in the closed loop: not one that a recording of a twin is likely to have."""


class Undetermined(Exception):
    """The recorded signals do not determine what a replay would compare. The message says why."""


class ComponentReplays:
    """The replays of one recording by the twin of one configuration. Motions are estimated once and
    shared.

    The data have to be fit for a comparison, see `data_checks`.
    """

    def __init__(self, recording: Recording, configuration: Configuration) -> None:
        self.recording = recording
        self.configuration = configuration
        self.period = recording.period
        self.preload = configuration.controller.preload
        self.wheel = self._sensor("structure_lvdt") - self._sensor("suspension_lvdt")

    def _sensor(self, name: str) -> Array:
        return self.recording.column("/sensor", name)

    def _command(self, name: str) -> Array:
        return self.recording.column("/command", name)

    def _clean(self, signal: Array) -> Array:
        return remove_mains(signal, self.period, self.configuration.plant.mains.frequency)

    def _without_zero(self, name: str) -> Array:
        """What a sensor measured, its mains line, offset and drift taken away."""
        sensor = getattr(self.configuration.plant, name)
        return remove_drift(sensor, self._clean(self._sensor(name)), self.period) - sensor.offset

    def _apply_sensor(self, name: str, true: Array) -> Array:
        """What the twin's sensor of that name makes of a true signal."""
        return apply_sensor(getattr(self.configuration.plant, name), true, self.period)

    def _apply_lvdts(self, wheel: Array) -> Array:
        """The difference of both LVDTs for a true wheel position and the plate's motion."""
        plate = self.structure_motion.position
        return self._apply_sensor("structure_lvdt", plate) - self._apply_sensor(
            "suspension_lvdt", plate - wheel
        )

    def _motion(self, name: str, expected: Array) -> EstimatedMotion:
        """The true motion that a sensor measured, given what a replay expects of it."""
        sensor = getattr(self.configuration.plant, name)
        mains = self.configuration.plant.mains.frequency
        found = estimate_motion(
            self._sensor(name), self._apply_sensor(name, expected), self.period, mains
        )
        return EstimatedMotion(
            expected + undo_sensor(sensor, found.correction, self.period),
            found.correction,
            found.velocity_error / sensor.gain,
        )

    @property
    def _ground_start(self) -> float:
        return float(self._command("ground")[0]) * self.configuration.plant.ground_cylinder.gain

    @cached_property
    def ground_cylinder_output(self) -> Array:
        command, cylinder = self._command("ground"), self.configuration.plant.ground_cylinder
        unloaded = replay_cylinder(cylinder, self.configuration, command, float(command[0]))
        if cylinder.compliance == 0.0:
            return unloaded
        tyre = self.configuration.plant.tyre.stiffness * (
            self._clean(self._sensor("ground_lvdt") - self.wheel)
        )
        return unloaded - yield_to_load(cylinder, np.maximum(tyre, 0.0), self.period)

    @cached_property
    def structure_cylinder_output(self) -> Array:
        start = self.configuration.controller.start
        cylinder = self.configuration.plant.structure_cylinder
        # A test starts with its spring uncompressed: the plate stands where the preload holds the
        # wheel.
        plant = self.configuration.plant
        uncompressed = self._ground_start - initial_deflection(plant, self.preload)
        uncompressed += initial_yield(plant, self.preload)[0]
        unloaded = replay_cylinder(
            cylinder, self.configuration, self._command("structure"), start, uncompressed
        )
        load = self._clean(self._sensor("load_cell"))
        return unloaded + yield_to_load(cylinder, load, self.period)

    @cached_property
    def ground_motion(self) -> EstimatedMotion:
        return self._motion("ground_lvdt", self.ground_cylinder_output)

    @cached_property
    def structure_motion(self) -> EstimatedMotion:
        return self._motion("structure_lvdt", self.structure_cylinder_output)

    @cached_property
    def carriage_output(self) -> Array:
        sensor = self.configuration.plant.load_cell
        force = undo_sensor(sensor, self._without_zero("load_cell"), self.period)
        return replay_carriage(
            self.configuration, self.ground_motion.position, force + self._gas_force(), self.preload
        )

    def _gas_force(self) -> Array:
        """Of the gas spring beside the motor, N, at the travel measured."""
        spring = self.configuration.plant.gas_spring
        if spring.force == 0.0:
            return np.zeros(self.recording.ticks)
        sensor = self.configuration.plant.suspension_lvdt
        travel = undo_sensor(sensor, self._without_zero("suspension_lvdt"), self.period)
        return np.array([spring_force(spring, -stroke) for stroke in travel.tolist()])

    @cached_property
    def travel_motion(self) -> EstimatedMotion:
        """Of plate against wheel, by the difference that the carriage's replay leaves between the
        LVDTs."""
        mains = self.configuration.plant.mains.frequency
        found = estimate_motion(
            self.wheel, self._apply_lvdts(self.carriage_output), self.period, mains
        )
        sensor = self.configuration.plant.suspension_lvdt
        wheel = self.carriage_output + undo_sensor(sensor, found.correction, self.period)
        error = math.hypot(self.structure_motion.velocity_error, found.velocity_error / sensor.gain)
        return EstimatedMotion(self.structure_motion.position - wheel, found.correction, error)

    @cached_property
    def mechanics_output(self) -> Output:
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
        """Only where the motor is known to slide: voltage and travel do not determine its friction
        at standstill."""
        measured, travel = self._sensor("load_cell"), self.travel_motion
        output = replay_motor(
            self.configuration, travel.position, self._command("voltage"), self.preload
        )
        resolved = (
            white_noise(self._sensor("suspension_lvdt")) / RESOLVED_OVER
            + CERTAIN * travel.velocity_error
        )
        slides = np.abs(np.gradient(travel.position, self.period)) > resolved
        if not slides.any():
            raise Undetermined("the motor never slides fast enough for its friction to be known")
        difference = self._clean(measured - self._apply_sensor("load_cell", output))
        left = rms(difference[slides])
        floor = white_noise(measured)
        return Residual(
            left,
            floor,
            left / floor if floor > 0 else math.inf,
            "N",
            band(difference * slides, self.period),
        )

    def carriage(self) -> Residual:
        return self._residual(self.wheel, self._apply_lvdts(self.carriage_output), "m")[0]

    def mechanics(self) -> Residual:
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
        output = self._apply_sensor("structure_lvdt", self.structure_cylinder_output)
        return self._residual(self._sensor("structure_lvdt"), output, "m")[0]

    def ground_cylinder(self) -> Residual:
        output = self._apply_sensor("ground_lvdt", self.ground_cylinder_output)
        return self._residual(self._sensor("ground_lvdt"), output, "m")[0]

    def _demands(self) -> Array:
        return np.column_stack([self._command(name) for name in ("ground", "structure", "force")])

    def controller(self) -> Residual:
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
        """The whole test again on the twin, tick against tick; drifts apart in phase wherever the
        loop limit-cycles."""
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
"""Every replay by name, in the order in which they are reported."""
