"""Model of one joint that does not act on others, as a diagnosis asks it for predictions.

`joint_simulation` computes the motion; here are its observed signals, and unmodelled disturbances.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.plant import Plant
from rigtwin.components.scales import Motion
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.models.basis import Passage, forms
from rigtwin.models.joint_simulation import JointSimulation
from rigtwin.models.measured_motion import ENDS, may_be_at_rest, recover_motion
from rigtwin.models.model import Form, Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs
from rigtwin.signals.band import limit_band
from rigtwin.signals.motion import SmoothedMotion, motion_band, smooth
from rigtwin.signals.noise import white_noise

INERTIAL = 0.1
"""Share of inertia in the measured force above which the band of the motion limits the force."""
SMALL = 0.02
"""Size of a small disturbance, as a share of the signal's standard deviation."""
SHORTEST_END = 20
"""Divisor of a recording's length that gives the largest part left out at each end."""
STEP_EFFORT = 6e-8
"""Estimated processor time of an integration step, s."""
FITTED_PASSES = 5
"""Typical number of integrations that a fitted start takes."""
SEED = 7
"""Seed of the noise that is propagated through the machine."""
PLACES = {"position": 0, "velocity": 1, "force": 2, "command": 3}
"""Kind of a row → its place in a simulated motion."""


class JointModel(Model[Plant]):
    """Model of one joint of one recording.

    Parameters
    ----------
    machine, replay, inputs, configuration, steps, every, linear
        As `JointSimulation` takes them.

    Raises
    ------
    RigtwinError
        If a channel is missing from the recording.
    """

    def __init__(
        self,
        machine: Machine,
        replay: ReplayOf,
        inputs: Inputs,
        configuration: Configuration,
        steps: int,
        every: int = 1,
        linear: bool = False,
    ) -> None:
        self._machine, self._replay, self._signals = machine, replay, inputs
        self._configuration, self._steps, self.every = configuration, steps, every
        self._period = inputs.period
        self.rows: tuple[Row, ...] = replay.rows
        self._joint = JointSimulation(machine, replay, inputs, configuration, steps, every, linear)
        self._smoothed: dict[str, SmoothedMotion] = {}
        self._band = self._find_band()

    @property
    def band(self) -> float:
        """Highest frequency at which a measured motion shows its acceleration, Hz.

        It is infinite where inertia is a small part of the force. Above the band, smoothing has
        removed the acceleration from the motion. Predicted and measured forces are compared through
        the same low-pass filter.
        """
        return self._band

    def _find_band(self) -> float:
        joint = self._joint
        rows = [row for row in self.rows if row.kind == "force"]
        if joint.smoothed is None or joint.error == 0.0 or not rows:
            return math.inf
        plant = self._configuration.plant
        inertia = joint.mechanics(plant)[1].mass
        accelerating = inertia * float(np.std(np.gradient(self.move(plant)[1], joint.interval)))
        measured = float(np.std(self._signals.column(*rows[0].channel)))
        if accelerating < INERTIAL * measured:
            return math.inf
        assert joint.mover.channel is not None
        return motion_band(self._signals.column(*joint.mover.channel), self._period)

    @property
    def effort(self) -> float:
        ticks = self._signals.ticks // self.every
        passes = FITTED_PASSES if self._joint.may_be_linear and not self._joint.linear else 1
        return STEP_EFFORT * passes * ticks * (self._steps if self._joint.pushed else 1)

    @property
    def has_linear_starts(self) -> bool:
        return self._joint.linear

    def halve_steps(self) -> JointModel:
        return self._on_grid(max(1, self._steps // 2), self.every)

    def double_steps(self) -> JointModel:
        return self._on_grid(2 * self._steps, self.every)

    def thin(self, longest: float) -> JointModel:
        """Return a coarser model for a search, or itself.

        It has fewer ticks where a sensor prescribes the motion. Where a force moves the joint,
        errors of its start are linear.
        """
        if self._joint.may_be_linear:
            return self._on_grid(self._steps, self.every, True)
        every = max(int(longest / self._period), 1)
        if self._joint.smoothed is None or every == 1:
            return self
        return self._on_grid(self._steps, every)

    def _on_grid(self, steps: int, every: int, linear: bool | None = None) -> JointModel:
        return JointModel(
            self._machine,
            self._replay,
            self._signals,
            self._configuration,
            steps,
            every,
            self._joint.linear if linear is None else linear,
        )

    def move(self, plant: Plant, force: Array | None = None, shift: Array | None = None) -> Array:
        """Simulate the joint; see `JointSimulation.move`."""
        return self._joint.move(plant, force, shift)

    def predict_true(self, plant: Plant) -> Array:
        return self._rows(self.move(plant))

    def _rows(self, moved: Array) -> Array:
        return moved[[PLACES[row.kind] for row in self.rows]]

    def _apply_sensors(self, plant: Plant, true: Array) -> Array:
        sensed = true.copy()
        for number, row in enumerate(self.rows):
            if row.kind != "command":
                sensor = sensor_of(plant, row.name)
                sensed[number] = apply_sensor(sensor, true[number], self._joint.interval)
        return limit_band(sensed, self.band, self._joint.interval)

    def predict(self, plant: Plant) -> Array:
        return self._apply_sensors(plant, self.predict_true(plant))

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        if entry == "force":
            return self._apply_sensors(plant, self._rows(self.move(plant, force=amount)))
        if entry == "motion":
            return self._apply_sensors(plant, self._rows(self.move(plant, shift=amount)))
        predicted = self.predict(plant)
        predicted[[row.name for row in self.rows].index(entry)] += amount
        return predicted

    def components(self) -> tuple[str, ...]:
        replay = self._replay
        moving = (
            [replay.guide, replay.mass, replay.rotor]
            if any(row.kind != "position" for row in self.rows) or self._joint.pushed
            else []
        )
        sensors = [row.name for row in self.rows if row.kind != "command"]
        names = (*moving, self._joint.mover.name, *sensors)
        return tuple(name for name in names if name is not None)

    def forms(self, component: str, plant: Plant) -> list[Form]:
        moved = self.move(plant)
        names = [row.name for row in self.rows]
        role, entry, signal = "guide", "force", moved[2]
        if component in names:
            role, entry, signal = "sensor", component, self.predict(plant)[names.index(component)]
        elif component == self._joint.mover.name:
            role = "force" if self._joint.pushed else "position"
            if not self._joint.pushed:
                entry, signal = "motion", moved[0]
        elif component in (self._replay.mass, self._replay.rotor):
            role = "mass"
        passage = Passage(signal, moved[0], moved[1], moved[2], self._joint.interval)
        return forms(role, entry, passage)

    def disturbance_size(self, entry: str) -> float:
        moved = self.move(self._machine.plant)
        if entry in ("force", "motion"):
            return SMALL * max(float(np.std(moved[2 if entry == "force" else 0])), 1e-9)
        number = [row.name for row in self.rows].index(entry)
        return SMALL * max(float(np.std(self._rows(moved)[number])), 1e-9)

    def motion(self, component: str, plant: Plant) -> Motion:  # noqa: ARG002
        moved = self.move(plant)
        force = moved[2]
        if not force.any():
            # No actuator acts: the force is inertia times acceleration.
            _, inertia = self._joint.mechanics(plant)
            force = inertia.mass * np.gradient(moved[1], self._joint.interval)
        return Motion(moved[0], moved[1], force)

    def missing_force(self, plant: Plant) -> Array | None:
        """Return the residual force required to reproduce the measured motion, N, shape (ticks,).

        It is the force by inverse dynamics less the actuator's. None unless a position sensor sees
        a pushed joint.
        """
        row = next((row for row in self.rows if row.kind == "position"), None)
        if row is None or not self._joint.pushed:
            return None
        if row.name not in self._smoothed:
            self._smoothed[row.name] = smooth(self._signals.column(*row.channel), self._period)
        measured, error, *_ = self._smoothed[row.name]
        position = recover_motion(sensor_of(plant, row.name), measured, self._period)
        velocity = np.gradient(position, self._period)
        motion = np.stack([position, velocity, np.gradient(velocity, self._period)])
        required = self._joint.required_force(plant, np.ascontiguousarray(motion), error)
        return required - self._joint.recorded_push(plant, position, velocity)

    def undetermined(self) -> NDArray[np.bool_] | None:
        """Return the ticks at which the measured motion does not determine the force.

        They are those at rest, and both ends of the motion, whose acceleration is unknown there.
        None where no force follows from a smoothed motion.
        """
        joint = self._joint
        if joint.smoothed is None or joint.error == 0.0:
            return None
        velocity = self.move(self._configuration.plant)[1]
        ticks = len(velocity)
        smoothed = joint.smoothed
        # Smoothing spoils the inertial force alone.
        spread = smoothed.resolution if math.isfinite(self.band) else 0.0
        rests = may_be_at_rest(velocity, smoothed.rate_error, spread, joint.interval)
        unknown = np.tile(rests, (len(self.rows), 1))
        # A short recording keeps most of its ticks.
        end = min(round(ENDS / joint.interval), ticks // SHORTEST_END)
        unknown[:, :end] = unknown[:, unknown.shape[1] - end :] = True
        return unknown

    def propagated_noise(self, plant: Plant) -> Array | None:
        """Return the change of the predictions by the noise of the inputs, shape (rows, ticks).

        For a prescribed motion, the noise of its sensor changes the force. In closed loop, the
        noise of the controller's sensors changes the command.
        """
        random, joint, ticks = np.random.default_rng(SEED), self._joint, self._signals.ticks
        if joint.smoothed is not None and joint.error > 0.0:
            assert joint.mover.channel is not None
            level = white_noise(self._signals.column(*joint.mover.channel))
            motion = joint.smoothed.motion
            again = smooth(motion + level * random.standard_normal(ticks), self._period)
            shift = (again.motion - motion)[:: self.every]
            noisy = self._rows(self.move(plant, shift=shift))
            return self._apply_sensors(plant, noisy) - self.predict(plant)
        if not joint.control.sensors:
            return None
        noise = joint.control.draw_noise(random)
        disturbed = joint.integrate_pushed(plant, np.zeros(ticks), noise)
        change = np.zeros((len(self.rows), ticks))
        commands = [row.kind == "command" for row in self.rows]
        change[commands] = disturbed[3] - self.move(plant)[3]
        return change
