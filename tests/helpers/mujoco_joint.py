"""Any machine's joint in MuJoCo itself: the reference that the faster model is held to.

MuJoCo has the masses, the geometry and gravity; the components' laws act on the joint tick by tick.
It is slow, and takes no shortcut that needs the joint to be alone. Contacts, joint limits and the
MJCF's own actuators are left out.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from rigtwin.components import Guide, Mass
from rigtwin.components.conditioning import actuator, condition, hold
from rigtwin.components.dry_friction import dry_limits, friction, slide
from rigtwin.components.guide_force import damping, position_force, quick_damping
from rigtwin.components.guide_step import guide_step_of
from rigtwin.components.mount import MountState, give_way
from rigtwin.components.plant import Plant, component_of
from rigtwin.components.sensors import apply_sensor, sensor_of
from rigtwin.components.servo import pull, push, push_law, pusher_of
from rigtwin.description.control import FormulaControl
from rigtwin.models.commanding import (
    Command,
    Readings,
    command_by_formula,
    commands_of,
)
from rigtwin.models.joint import PLACES
from rigtwin.models.joint_motion import Inertia
from rigtwin.models.joint_simulation import JointSimulation
from rigtwin.numerics.arrays import Array

FIXED = 1e12
"""kg or kg m²; other joints are so heavy that they stay where they are."""
STIFF = 0.05
"""Times inertia / step², the stiffest spring that an explicit step bears."""
OFF = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_LIMIT
    | mujoco.mjtDisableBit.mjDSBL_ACTUATION
)


class MujocoModel(JointSimulation):
    """One joint of a machine in MuJoCo."""

    def predict(self, plant: Plant) -> Array:
        """The readings of the observed sensors, without noise."""
        moved, rows = self.move(plant), self._replay.rows
        return np.stack(
            [
                apply_sensor(sensor_of(plant, row.name), moved[PLACES[row.kind]], self._period)
                for row in rows
            ]
        )

    def _mechanics(
        self, plant: Plant, timestep: float
    ) -> tuple[mujoco.MjModel, mujoco.MjData, int, int]:
        """Model and data with the plant's mass, and where the joint's position and velocity are."""
        model = mujoco.MjModel.from_xml_path(str(self._machine.model))
        joint = self._replay.joint
        number = model.joint(joint.name).id
        at, place = int(model.jnt_dofadr[number]), int(model.jnt_qposadr[number])
        nominal, mass, share = joint.inertia - joint.armature, self._replay.mass, 1.0
        if mass is not None and nominal > 0.0:
            share = component_of(plant, mass, Mass).mass / nominal
        model.body_mass[:] *= share
        model.body_inertia[:] *= share
        model.dof_armature[at] = self._armature(plant)
        model.jnt_stiffness[:] = model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
        others = np.arange(model.nv) != at
        model.dof_armature[others] = FIXED
        model.opt.timestep = timestep
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.opt.disableflags |= OFF
        # Two timesteps: the fastest friction constraint MuJoCo takes as it is, so the least creep.
        model.dof_solref[at] = (2.0 * timestep, 1.0)
        model.dof_solimp[at] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model, mujoco.MjData(model), place, at

    def _inverse_dynamics(self, plant: Plant, position: Array, error: float) -> Array:
        """The force that moves the joint as prescribed, by inverse dynamics."""
        model, data, place, at = self._mechanics(plant, self._period)
        guide, inertia = self.mechanics(plant)
        dry = friction(guide)
        velocity = np.gradient(position, self._period)
        acceleration = np.gradient(velocity, self._period)
        softest = self._softest(guide, inertia, position, acceleration, error)
        out = np.zeros((4, len(position)))
        out[0], out[1] = position, velocity
        slider, viscous = float(position[0]), 0.0
        rest = self._replay.joint.rest
        guide_step = guide_step_of(guide, 1.0 / softest, rest, self._period)
        share, behind = guide_step.share, MountState(slider, 0.0, slider, viscous)
        for tick in range(len(position)):
            x, v = float(position[tick]), float(velocity[tick])
            data.qpos[place], data.qvel[at] = x, v
            data.qacc[:] = 0.0
            if inertia.mass > 0.0:
                data.qacc[at] = acceleration[tick]
            mujoco.mj_inverse(model, data)
            load = float(data.qfrc_inverse[at])
            if guide.mount_compliance > 0.0:
                behind, held_back = give_way(guide_step, behind, load, x)
                out[2, tick] = load + held_back
                continue
            load += position_force(guide, x, rest)
            forward, backward = dry_limits(dry, v, load)
            rubbed, by = slide(x - slider, 0.5 * guide.backlash, 1.0 / softest, forward, backward)
            slider += by
            viscous += share * (damping(guide, v) * v - viscous)
            out[2, tick] = load + rubbed + viscous + quick_damping(guide, x, v) * v
        return out

    def integrate_pushed(
        self, plant: Plant, disturbance: Array, noise: Array | None = None
    ) -> Array:
        """The joint under its force actuator or servo."""
        h = self._period / self._steps
        model, data, place, at = self._mechanics(plant, h)
        guide, inertia = self.mechanics(plant)
        data.qpos[place], data.qvel[at] = self._start_of(plant)
        rest = self._replay.joint.rest
        passive = _Passive(guide, h, inertia, rest, float(data.qpos[place]))
        mover = pusher_of(plant, self.mover.name)
        drive = actuator(mover, plant.computer, h)
        held = hold(drive, float(self._command[0]))
        law, wanted = push_law(mover), float(held.memory[3])
        follows = law.position_gain > 0.0
        out, force = np.zeros((4, len(disturbance))), 0.0
        loop = self._reader(plant)
        for tick in range(len(disturbance)):
            x, v = float(data.qpos[place]), float(data.qvel[at])
            out[0, tick], out[1, tick] = x, v
            out[2, tick] = push(law, wanted, x, v) if follows else force
            command = loop(tick, x, v)
            out[3, tick] = command
            for _ in range(self._steps):
                x, v = float(data.qpos[place]), float(data.qvel[at])
                wanted, held_by = condition(drive, held, command), 0.0
                force = push(law, wanted, x, v)
                if follows and abs(force) < law.limit:
                    force, held_by = pull(law, wanted, x), law.damping_gain
                model.dof_damping[at] = 0.0
                passive.act(model, data, at, x, v, force)
                # MuJoCo's own damping is implicit.
                model.dof_damping[at] += held_by
                data.qfrc_applied[at] += force + float(disturbance[tick])
                mujoco.mj_step(model, data)
        return out

    def _reader(self, plant: Plant) -> Callable[[int, float, float], float]:
        """The command of a tick for the joint's position and velocity, as the controller sees
        them."""
        names = list(self.control.sensors) or self.sensors_of_joint()
        ticks, columns = self._signals.ticks, self._signals.columns
        readings = Readings(plant, names, {}, self._period, ticks)
        components = self._machine.components
        rates = {name: components[name].quantity == "velocity" for name in names}
        channel = self.mover.channel
        output = [self._replay.moved_by[0] if channel is None else channel[1]]
        recorded = self._command
        own: Command = lambda tick, _: float(recorded[tick])  # noqa: E731
        control = self._machine.control
        if self.control.runs and isinstance(control, FormulaControl):
            settings = self._configuration.controller._asdict()
            sensors = {c: name for name in names if (c := components[name].channel) is not None}
            own = command_by_formula(control, settings, columns, sensors, self._period)

        def command(tick: int, position: float, velocity: float) -> float:
            true = {name: velocity if rate else position for name, rate in rates.items()}
            (found,) = commands_of(own(tick, readings.take(tick, true)), output)
            return found

        return command

    def sensors_of_joint(self) -> list[str]:
        """The sensors of the joint's position and velocity."""
        joint = self._replay.joint.name
        return [
            name
            for name, component in self._machine.components.items()
            if component.joint == joint and component.quantity in ("position", "velocity")
        ]


class _Passive:
    """What a guide does to its joint over a timestep."""

    def __init__(
        self, guide: Guide, timestep: float, inertia: Inertia, rest: float, position: float
    ) -> None:
        self._guide, self._dry, self._rest = guide, friction(guide), rest
        # As stiff as an explicit step bears, where the description gives a play no spring.
        self._spring = STIFF * inertia.mass / timestep**2
        if guide.compliance > 0.0:
            self._spring = min(self._spring, 1.0 / guide.compliance)
        self._slider, self._viscous = position, 0.0
        self._resistance = guide_step_of(guide, self._spring, rest, timestep)
        self._share = self._resistance.share
        self._behind = MountState(position, 0.0, position, 0.0)

    def act(
        self, model: mujoco.MjModel, data: mujoco.MjData, at: int, x: float, v: float, load: float
    ) -> None:
        """Writes friction into the model and all other forces into the joint's applied force."""
        guide = self._guide
        if guide.mount_compliance > 0.0:
            data.qfrc_applied[at] = -self._hold_back(x, load)
            return
        forward, backward = dry_limits(self._dry, v, load)
        force = -position_force(guide, x, self._rest) - quick_damping(guide, x, v) * v
        if guide.relaxation > 0.0:
            self._viscous += self._share * (damping(guide, v) * v - self._viscous)
            force -= self._viscous
        else:
            model.dof_damping[at] = damping(guide, v)
        if guide.compliance > 0.0 or guide.backlash > 0.0:
            half = 0.5 * guide.backlash
            rubbed, by = slide(x - self._slider, half, self._spring, forward, backward)
            self._slider += by
            force -= rubbed
        else:
            # MuJoCo's dry friction is the same both ways; what one way has more is a force besides.
            model.dof_frictionloss[at] = 0.5 * (forward + backward)
            force += 0.5 * (backward - forward)
        data.qfrc_applied[at] = force

    def _hold_back(self, x: float, load: float) -> float:
        """The force of a guide behind its mount."""
        self._behind, force = give_way(self._resistance, self._behind, load, x)
        return force
