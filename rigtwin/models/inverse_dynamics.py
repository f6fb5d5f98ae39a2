"""Model of coupled joints whose motions are all measured: inverse dynamics.

The forces that the measured motion q(t) requires are

    τ = M(q)·q'' + c(q, q') + Y(q, q', q'')·Δπ + Σ_g a_g·f_g + Σ_r a_r·J_r·(a_r·q'')

MuJoCo computes M and c of the MJCF's bodies. Forces are linear in the bodies' inertial parameters,
so their changes Δπ enter through the regressor Y (Atkeson, An and Hollerbach 1986; see
`components.body`). Guides (friction and springs f_g) and rotors (inertia J_r) act along directions
of their own: one joint, or the sum of joints that a fixed tendon makes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rigtwin.components import Base, Body, Guide, Rotor, Schedule, Warming
from rigtwin.components.body import list_surplus
from rigtwin.components.guide import acts
from rigtwin.components.guide_step import guide_step_of
from rigtwin.components.plant import Plant, component_of, select
from rigtwin.components.scales import Motion
from rigtwin.components.schedule import follow, scheduled_force
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.models.basis import Passage, forms
from rigtwin.models.joint import SEED, SMALL
from rigtwin.models.joint_inverse import resist, resist_at_once
from rigtwin.models.joint_simulation import KEPT
from rigtwin.models.measured_motion import (
    ELASTIC,
    ENDS,
    may_be_at_rest,
    recover_motion,
    softest_contact,
)
from rigtwin.models.model import Form, Model
from rigtwin.models.rigid import RigidBodies
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.memo import Memo
from rigtwin.recording import Inputs
from rigtwin.signals.band import limit_band
from rigtwin.signals.motion import SmoothedMotion, smooth
from rigtwin.signals.noise import white_noise

REGRESSORS = 40
"""Number of remembered regressors. A search returns to few motions."""
ROW_EFFORT = 2e-7
"""Estimated processor time of a tick for each joint, s."""
DRAWS = 2
"""Number of draws of the motions' noise."""
Kinematics = Array
"""Positions, velocities and accelerations, shape (3, joints, ticks)."""


class InverseDynamicsModel(Model[Plant]):
    """Inverse-dynamics model of all coupled joints of one recording.

    Parameters
    ----------
    machine, replay, inputs
        Machine, its replay and the recorded signals, as in `Physics.model`.
    every
        Ticks of the recording from one predicted tick to the next.
    like
        Model of the same recording whose smoothed motions are reused.

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
        every: int = 1,
        like: InverseDynamicsModel | None = None,
    ) -> None:
        self._machine, self._replay, self._signals = machine, replay, inputs
        self._period = inputs.period
        self.every = every
        self.rows: tuple[Row, ...] = replay.rows
        components = machine.components
        self._movers = replay.moved_by
        joints = [components[name].joint for name in self._movers]
        self._place = {joint: number for number, joint in enumerate(joints)}
        self._row_of = {
            components[row.name].joint: number for number, row in enumerate(replay.rows)
        }
        guides, rotors = machine.components_of(Guide), machine.components_of(Rotor)
        schedules, warming = machine.components_of(Schedule), machine.components_of(Warming)
        self._bodies = RigidBodies(machine.model, joints, guides, rotors)
        self._rests = {guide.name: self._bodies.rest_of(guide) for guide in guides}
        self._heavy = {body.name: body.mjcf for body in machine.components_of(Body)}
        self._base = next((base.name for base in machine.components_of(Base)), None)
        self._along: dict[str, Array] = {}
        """Component → its direction in the joints, shape (joints,)."""
        self._onto: dict[str, Array] = {}
        """Component → share of its force in each observed row, shape (rows,)."""
        for component in (*guides, *rotors, *schedules, *warming):
            along, onto = np.zeros(len(joints)), np.zeros(len(self.rows))
            for joint, coefficient in component.acts_on:
                if joint in self._place:
                    along[self._place[joint]] = coefficient
                if joint in self._row_of:
                    onto[self._row_of[joint]] = coefficient
            if onto.any():
                self._along[component.name], self._onto[component.name] = along, onto
        self._schedules = {
            component.name: inputs.column(*component.channel)
            for component in schedules
            if component.channel is not None
        }
        """Name of each schedule → values of its channel, shape (ticks,)."""
        self._read: Mapping[str, SmoothedMotion] = (
            like._read
            if like is not None
            else {name: smooth(self._measured(name), self._period) for name in self._movers}
        )
        self._motions: Memo[tuple[Kinematics, Array]] = Memo(KEPT)
        self._columns: Memo[Array] = Memo(REGRESSORS)
        self._shares: Memo[Array] = Memo(KEPT * max(len(self._along), 1))
        self._drawn: Memo[list[tuple[Kinematics, Array]]] = Memo(1)

    @property
    def band(self) -> float:
        return math.inf if self._replay.band is None else self._replay.band

    @property
    def _interval(self) -> float:
        """Time from one predicted tick to the next, s."""
        return self.every * self._period

    def _measured(self, name: str) -> Array:
        channel = self._machine.components[name].channel
        assert channel is not None
        return self._signals.column(*channel)

    def thin(self, longest: float) -> InverseDynamicsModel:
        every = max(int(longest / self._period), 1)
        if every <= self.every:
            return self
        return InverseDynamicsModel(self._machine, self._replay, self._signals, every, self)

    @property
    def effort(self) -> float:
        return ROW_EFFORT * len(self._movers) * (self._signals.ticks // self.every)

    def _move(self, plant: Plant, shifts: Mapping[str, Array] | None = None) -> Kinematics:
        """Return the joints' motion by the sensors.

        `shifts` maps a sensor to a displacement of its motion, m or rad, shape (ticks,), at the
        recording's own ticks.
        """
        positions = []
        for name in self._movers:
            signal = self._read[name].motion
            if shifts is not None and name in shifts:
                signal = signal + shifts[name]
            positions.append(recover_motion(sensor_of(plant, name), signal, self._period))
        position = np.stack(positions)
        # Differentiate before thinning: differences over dropped ticks would smooth the motion.
        velocity = np.gradient(position, self._period, axis=1)
        acceleration = np.gradient(velocity, self._period, axis=1)
        return np.stack([position, velocity, acceleration])[:, :, :: self.every]

    def _moved(self, plant: Plant) -> tuple[Kinematics, Array]:
        """Return the joints' motion and the forces of the MJCF's bodies, N, shape (joints, ticks).

        Gravity is that of the plant's base, which may be tilted.
        """

        def compute() -> tuple[Kinematics, Array]:
            motion = self._move(plant)
            return motion, self._bodies.forces(motion, self._gravity(plant))

        return self._motions.recall(self._key(plant), compute)

    def _key(self, plant: Plant) -> tuple[object, ...]:
        """Return all components that motion and gravity depend on."""
        names = (*self._movers, self._base) if self._base is not None else self._movers
        return select(plant, names)

    def _gravity(self, plant: Plant) -> Array | None:
        if self._base is None:
            return None
        return self._bodies.turn(component_of(plant, self._base, Base))

    def _loaded(self, plant: Plant) -> tuple[Kinematics, Array]:
        """Return the joints' motion and the forces of the plant's bodies, N."""
        motion, forces = self._moved(plant)
        return motion, forces + self._surplus(plant, motion, self._key(plant))

    def _surplus(self, plant: Plant, motion: Kinematics, key: tuple[object, ...]) -> Array | float:
        """Return Y·Δπ, the forces of the plant's bodies less those of the MJCF's, N.

        `key` names the motion, whose regressors are remembered.
        """
        surplus: Array | float = 0.0
        for name, mjcf in self._heavy.items():
            body = component_of(plant, name, Body)
            more = list_surplus(body, *self._bodies.list_nominal(mjcf))
            if not more.any():
                continue
            compute = partial(self._bodies.regressor, motion, mjcf, self._gravity(plant))
            columns = self._columns.recall((name, key), compute)
            surplus = surplus + np.tensordot(more, columns, 1)
        return surplus

    def _share_of(self, name: str, plant: Plant, motion: Kinematics, bodies: Array) -> Array:
        """Return the force of a guide or rotor along its own direction, N, shape (ticks,)."""
        along = self._along[name]
        component = component_of(plant, name, Guide, Rotor, Schedule, Warming)
        if isinstance(component, Rotor):
            return component.inertia * (along @ motion[2])
        if isinstance(component, Schedule | Warming):
            own_motion = np.einsum("j,kjt->kt", along, motion)
            error = self._position_error(along)
            over = max(ELASTIC * error, 1e-9 * max(float(np.ptp(own_motion[0])), 1e-12))
            if isinstance(component, Warming):
                level = component.fade(motion.shape[2], self._interval)
                return scheduled_force(component.schedule, level, own_motion, 1.0 / over)
            level = follow(component, self._schedules[name], self._period)[:: self.every]
            return scheduled_force(component, level, own_motion, 1.0 / over)
        guide = Guide(*(float(value) for value in component))
        # A guide whose only values are the shapes of absent effects exerts no force.
        if not acts(guide):
            return np.zeros(motion.shape[2])
        guide_motion = np.ascontiguousarray(np.einsum("j,kjt->kt", along, motion))
        load = along @ bodies / float(along @ along)
        out = load.copy()
        at_once = guide.compliance == guide.mount_compliance == guide.backlash == 0.0
        softest = softest_contact(guide, load, guide_motion[0], self._position_error(along))
        guide_step = guide_step_of(guide, 1.0 / softest, self._rests[name], self._interval)
        (resist_at_once if at_once else resist)(guide_step, guide_motion, out)
        return out - load

    def _position_error(self, along: Array) -> float:
        """Return the standard error of the measured position along a direction, m."""
        errors = np.array([self._read[name].error for name in self._movers])
        return float(np.sqrt(np.sum((along * errors) ** 2)))

    def _may_be_at_rest(self, along: Array, speeds: Array) -> NDArray[np.bool_]:
        """Return the ticks at which the motion along a direction may be at rest."""
        read = [self._read[name] for name in self._movers]
        errors = np.array([each.rate_error for each in read])
        error = float(np.sqrt(np.sum((along * errors) ** 2)))
        moving = [each.resolution for each, share in zip(read, along, strict=True) if share]
        return may_be_at_rest(along @ speeds, error, max(moving, default=0.0), self._interval)

    def _force_of(self, name: str, plant: Plant) -> Array:
        """Return `_share_of` at the plant's own motion, remembered."""
        key = (name, *select(plant, [name, *self._heavy]), *self._key(plant))
        return self._shares.recall(key, lambda: self._share_of(name, plant, *self._loaded(plant)))

    def _rows_of(self, bodies: Array) -> Array:
        places = [self._place[self._machine.components[row.name].joint] for row in self.rows]
        return bodies[places]

    def predict_true(self, plant: Plant) -> Array:
        forces = self._rows_of(self._loaded(plant)[1]).copy()
        for name, onto in self._onto.items():
            force = self._force_of(name, plant)
            for row in np.nonzero(onto)[0]:
                forces[row] += onto[row] * force
        return forces

    def _apply_sensors(self, plant: Plant, true: Array) -> Array:
        sensed = np.stack(
            [
                apply_sensor(sensor_of(plant, row.name), signal, self._interval)
                for row, signal in zip(self.rows, true, strict=True)
            ]
        )
        return limit_band(sensed, self.band, self._interval)

    def predict(self, plant: Plant) -> Array:
        return self._apply_sensors(plant, self.predict_true(plant))

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        if entry in self._onto:
            true = self.predict_true(plant) + self._onto[entry][:, None] * amount
            return self._apply_sensors(plant, true)
        predicted = self.predict(plant)
        predicted[[row.name for row in self.rows].index(entry)] += amount
        return predicted

    def components(self) -> tuple[str, ...]:
        mechanical = (name for name in self._onto if name not in self._schedules)
        return (*mechanical, *(row.name for row in self.rows))

    def _passage(self, component: str, plant: Plant) -> tuple[Kinematics, Array, Array]:
        """Return a component's motion, shape (3, ticks), its load and its force, N."""
        motion, bodies = self._loaded(plant)
        along = self._along.get(component)
        if along is None:
            row = [row.name for row in self.rows].index(component)
            along = np.zeros(len(self._place))
            along[self._place[self._machine.components[component].joint]] = 1.0
            force = self.predict(plant)[row]
        else:
            onto = self._onto[component]
            force = onto @ self.predict_true(plant) / float(onto @ onto)
        component_motion = np.einsum("j,kjt->kt", along, motion)
        return component_motion, along @ bodies / float(along @ along), force

    def forms(self, component: str, plant: Plant) -> list[Form]:
        (position, speed, _), load, force = self._passage(component, plant)
        known = self._machine.components[component]
        rotates = known.component_type is Rotor
        role = "sensor" if known.quantity else "mass" if rotates else "guide"
        return forms(role, component, Passage(force, position, speed, load, self._interval))

    def disturbance_size(self, entry: str) -> float:
        return SMALL * max(float(np.std(self._passage(entry, self._machine.plant)[2])), 1e-9)

    def motion(self, component: str, plant: Plant) -> Motion:
        if component not in self._along and component not in {row.name for row in self.rows}:
            component = self.rows[0].name
        (position, speed, _), _, force = self._passage(component, plant)
        return Motion(position, speed, force)

    def undetermined(self) -> NDArray[np.bool_]:
        """Return the ticks at which the measured motion does not determine the forces.

        They are those at which a joint is at rest, and both ends of the recording, where
        accelerations are unknown.
        """
        speeds = self._moved(self._machine.plant)[0][1]
        unknown = np.zeros((len(self.rows), speeds.shape[1]), bool)
        end = round(ENDS / self._interval)
        unknown[:, :end] = unknown[:, -end:] = True
        for name, onto in self._onto.items():
            if self._machine.components[name].component_type is Guide:
                unknown |= (onto != 0.0)[:, None] & self._may_be_at_rest(self._along[name], speeds)
        return unknown

    def propagated_noise(self, plant: Plant) -> Array | None:
        """Return the change of the forces by the noise of the measured motions.

        The noise passes through smoothing, differentiation, the dynamics of all joints and the
        sensors of the forces. Several draws are added and divided by the root of their number,
        which keeps the strength of one: the error where dry friction reverses comes from few ticks,
        so a single draw is uncertain.
        """
        undisturbed, total = self.predict(plant), np.zeros(())
        motions = self._draw_motions(plant)
        for number, (motion, forces) in enumerate(motions):
            bodies = forces + self._surplus(plant, motion, (number, *self._key(plant)))
            forces_drawn = self._rows_of(bodies).copy()
            for name, onto in self._onto.items():
                forces_drawn += onto[:, None] * self._share_of(name, plant, motion, bodies)
            measured = self._apply_sensors(plant, forces_drawn)
            total = total + (measured - undisturbed) / math.sqrt(len(motions))
        return total if total.shape else None

    def _draw_motions(self, plant: Plant) -> list[tuple[Kinematics, Array]]:
        """Return motions with redrawn noise, and the forces of the MJCF's bodies for them.

        The list is empty if the motions have no noise. The last list is remembered.
        """

        def draw() -> list[tuple[Kinematics, Array]]:
            # The seed is fixed, or the same candidate would get another misfit when tried again.
            random, drawn = np.random.default_rng(SEED), []
            for _ in range(DRAWS):
                shifts = {}
                for name in self._movers:
                    signal, error, *_ = self._read[name]
                    if error > 0.0:
                        level = white_noise(self._measured(name))
                        noise = level * random.standard_normal(len(signal))
                        shifts[name] = smooth(signal + noise, self._period).motion - signal
                if shifts:
                    motion = self._move(plant, shifts)
                    drawn.append((motion, self._bodies.forces(motion, self._gravity(plant))))
            return drawn

        return self._drawn.recall(self._key(plant), draw)
