"""Compiled MJCF of a description: its named elements, and the mechanics of its joints."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from rigtwin.description.actuator_law import (
    falls_with_speed,
    find_obstacle,
    is_dc_motor,
    lies_at_command,
    read_timing,
    rest_position,
    velocity_law,
)
from rigtwin.description.closed_loops import refuse_closed_loops
from rigtwin.description.model_checks import check_text, check_values
from rigtwin.description.naming import lacks_names, name_elements
from rigtwin.description.replay import Joint
from rigtwin.errors import RigtwinError

OBJECTS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "contact": mujoco.mjtObj.mjOBJ_PAIR,
}
"""Element of an MJCF that can be a component → MuJoCo's object type."""
GRID = 1441
"""Number of positions at which a joint's gravity load is tabulated: every 0.25° of a whole turn."""
TURN = float(np.pi)
"""Range of a hinge without limits, to either side, rad."""
SENSORS = {
    mujoco.mjtSensor.mjSENS_JOINTPOS: "position",
    mujoco.mjtSensor.mjSENS_ACTUATORPOS: "position",
    mujoco.mjtSensor.mjSENS_TENDONPOS: "position",
    mujoco.mjtSensor.mjSENS_TENDONVEL: "velocity",
    mujoco.mjtSensor.mjSENS_JOINTVEL: "velocity",
    mujoco.mjtSensor.mjSENS_ACTUATORVEL: "velocity",
    mujoco.mjtSensor.mjSENS_JOINTACTFRC: "force",
    mujoco.mjtSensor.mjSENS_ACTUATORFRC: "force",
    mujoco.mjtSensor.mjSENS_FORCE: "force",
}
"""Type of a MuJoCo sensor → quantity that it measures."""


class Tie(NamedTuple):
    """Linear equality between two joints: q_joint = offset + ratio · q_to.

    Attributes
    ----------
    joint
        Dependent joint.
    to
        Joint that it follows.
    ratio
        Ratio of the two positions, in their units.
    offset
        Position of the dependent joint where the other one is at 0, m or rad.
    number
        Index of the equality in the model.
    """

    joint: str
    to: str
    ratio: float
    offset: float
    number: int

    def swapped(self) -> Tie:
        """Return the same equality solved for the other joint. The ratio must not be zero."""
        return Tie(self.to, self.joint, 1.0 / self.ratio, -self.offset / self.ratio, self.number)


LARGEST_PULLEY = 0.1
"""Largest radius of a pulley, m: larger coefficients of a fixed tendon are ratios of angles."""
MASSLESS = 1e-6
"""Mass of a URDF link without inertia, kg. MuJoCo refuses moving bodies without mass; the square
of this number is the inertia, kg m²."""


def compile_model(
    path: Path, alter: Callable[[mujoco.MjSpec], None] | None = None
) -> mujoco.MjModel:
    """Return the compiled model of an MJCF or a URDF, whose joints and actuators all have names.

    Parameters
    ----------
    path
        Path of the MJCF or URDF.
    alter
        Function that changes the model's specification before it is compiled.

    Raises
    ------
    ValueError
        If MuJoCo cannot compile the file.
    """
    urdf = path.suffix.lower() == ".urdf"
    if not urdf and alter is None:
        model = mujoco.MjModel.from_xml_path(str(path))
        if not lacks_names(model):
            return model
    spec = mujoco.MjSpec.from_file(str(path))
    name_elements(spec)
    if urdf:
        # URDFs often have links without inertia, such as frames of tools, which MuJoCo refuses
        # where they move.
        spec.compiler.boundmass, spec.compiler.boundinertia = MASSLESS, MASSLESS**2
    if alter is not None:
        alter(spec)
    return spec.compile()


class Mechanism:
    """Compiled MJCF or URDF.

    Attributes
    ----------
    model
        Compiled model.
    is_urdf
        Whether the file is a URDF, which cannot hold actuators.
    """

    def __init__(self, path: Path) -> None:
        """Compile a file. Raises RigtwinError if it is missing or cannot be compiled."""
        if not path.is_file():
            raise RigtwinError(f"model {path} does not exist")
        # The text is checked first: compiling a hostile file may take for ever or all memory.
        check_text(path)
        self.is_urdf = path.suffix.lower() == ".urdf"
        try:
            self.model = compile_model(path)
        except ValueError as error:
            # MuJoCo's messages have several lines; ours have one.
            raise RigtwinError(f"model {path}: {' '.join(str(error).split())}") from None
        check_values(path, self.model)
        refuse_closed_loops(path, self.model)
        try:
            mujoco.mj_forward(self.model, mujoco.MjData(self.model))
        except mujoco.FatalError as error:
            # Such as contacts of more bodies than fit into MuJoCo's memory.
            raise RigtwinError(f"model {path}: {' '.join(str(error).split())}") from None

    @cached_property
    def _without_contacts(self) -> mujoco.MjModel:
        """The model without contacts, which slow a gravity load down and do not enter it."""
        model = copy(self.model)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        return model

    def names(self, element: str) -> list[str]:
        """Return the names of all elements of a kind; elements without a name are left out."""
        kind = OBJECTS[element]
        count = {
            "body": self.model.nbody,
            "joint": self.model.njnt,
            "actuator": self.model.nactuator,
            "sensor": self.model.nsensor,
            "tendon": self.model.ntendon,
            "contact": self.model.npair,
        }[element]
        names = [mujoco.mj_id2name(self.model, kind, number) for number in range(count)]
        return [name for name in names if name]

    def number(self, element: str, name: str) -> int:
        """Return the index of a named element in the model; -1 without one."""
        return int(mujoco.mj_name2id(self.model, OBJECTS[element], name))

    def joint_name(self, number: int) -> str:
        """Return the name of the joint with an index; empty if it has no name."""
        return mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_JOINT, number) or ""

    def joint_of(self, element: str, name: str) -> str:
        """Return the joint that an element belongs to; empty if it belongs to none or several."""
        model, number = self.model, self.number(element, name)
        if element == "joint":
            return name
        if element == "body":
            # A body without a joint is welded to its parent, and moves with the parent's joint.
            while number > 0 and model.body_jntnum[number] == 0:
                number = int(model.body_parentid[number])
            return (
                self.joint_name(int(model.body_jntadr[number]))
                if model.body_jntnum[number] == 1
                else ""
            )
        if element == "actuator":
            through = int(model.actuator_trntype[number])
            # For a hinge or slide, the frame of the parent makes no difference.
            if through in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
                return self.joint_name(int(model.actuator_trnid[number, 0]))
            return ""
        if element == "sensor":
            kind, target = int(model.sensor_objtype[number]), int(model.sensor_objid[number])
            if kind == mujoco.mjtObj.mjOBJ_JOINT:
                return self.joint_name(target)
            if kind == mujoco.mjtObj.mjOBJ_ACTUATOR:
                return self.joint_of(
                    "actuator", mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, target) or ""
                )
        return ""

    def measures(self, name: str) -> str:
        """Return the quantity that a sensor measures: position, velocity or force, else empty."""
        return SENSORS.get(
            mujoco.mjtSensor(int(self.model.sensor_type[self.number("sensor", name)])), ""
        )

    def sensor_gear(self, name: str) -> float:
        """Return what a sensor reads per unit of its joint: the gear where it is on an actuator."""
        model, number = self.model, self.number("sensor", name)
        if self.measures(name) not in ("position", "velocity"):
            return 1.0
        if int(model.sensor_objtype[number]) != mujoco.mjtObj.mjOBJ_ACTUATOR:
            return 1.0
        return float(model.actuator_gear[int(model.sensor_objid[number]), 0]) or 1.0

    def positions(self, name: str) -> bool:
        """Return whether an actuator takes a position as its command."""
        return lies_at_command(self.model, self.number("actuator", name))

    def falls_with_speed(self, name: str) -> bool:
        """Return whether an actuator's force depends on its command and on velocity alone."""
        return bool(name) and falls_with_speed(self.model, self.number("actuator", name))

    def is_dc_motor(self, name: str) -> bool:
        """Return whether an actuator is a DC motor, whose command is a voltage."""
        return bool(name) and is_dc_motor(self.model, self.number("actuator", name))

    def velocity_law(self, name: str) -> tuple[float, float]:
        """Return gain and damping of an actuator whose force falls with speed."""
        return velocity_law(self.model, self.number("actuator", name))

    def actuator_timing(self, name: str) -> dict[str, float]:
        """Return delay and lag of an actuator's command, s; see `actuator_law.read_timing`."""
        return read_timing(self.model, self.number("actuator", name))

    def rest_position(self, name: str) -> dict[str, float]:
        """Return gain and offset of an actuator's rest position; see `actuator_law`."""
        return rest_position(self.model, self.number("actuator", name))

    def actuator_obstacle(self, name: str, kind: str) -> str | None:
        """Return the first property of an actuator that a component of this type cannot express."""
        return find_obstacle(self.model, self.number("actuator", name), kind)

    def command_limits(self, name: str) -> tuple[float, float]:
        """Return the range of an actuator's command; infinite without limits."""
        number = self.number("actuator", name)
        if not self.model.actuator_ctrllimited[number]:
            return -np.inf, np.inf
        low, high = self.model.actuator_ctrlrange[number]
        return float(low), float(high)

    def force_per_command(self, name: str) -> tuple[float, float]:
        """Return a force actuator's force per command, and its limit, N or Nm (or infinite)."""
        number = self.number("actuator", name)
        gear = float(self.model.actuator_gear[number, 0])
        gain = float(self.model.actuator_gainprm[number, 0])
        return gear * gain, self._force_limit(number)

    def _force_limit(self, number: int) -> float:
        """Return the largest force of an actuator at what it moves, N or Nm; infinite without."""
        model, limit = self.model, np.inf
        # MuJoCo limits the force before the gear, so the limit at the joint is |gear| · forcerange.
        if model.actuator_forcelimited[number]:
            gear = abs(float(model.actuator_gear[number, 0]))
            limit = gear * float(model.actuator_forcerange[number, 1])
        moved = int(model.actuator_trnid[number, 0])
        at_joint = int(model.actuator_trntype[number]) == mujoco.mjtTrn.mjTRN_JOINT
        if at_joint and model.jnt_actfrclimited[moved]:
            limit = min(limit, float(model.jnt_actfrcrange[moved, 1]))
        return limit

    def servo(self, name: str) -> dict[str, float] | None:
        """Return a position actuator's gains and force limit as parameters of a Servo.

        The force of a servo is kp · (command − position) − kv · velocity, so that bias₁ = −gain.
        The result is None for an actuator with another law or with a gear.
        """
        model, number = self.model, self.number("actuator", name)
        gain, bias = float(model.actuator_gainprm[number, 0]), model.actuator_biasprm[number]
        affine = int(model.actuator_biastype[number]) == mujoco.mjtBias.mjBIAS_AFFINE
        # kp enters MuJoCo's law twice, as gain and as −bias₁; only equal values make it an error
        # times kp.
        proportional = np.isclose(bias[1], -gain) and gain != 0.0
        if not affine or not proportional or float(model.actuator_gear[number, 0]) != 1.0:
            return None
        parameters = {"position_gain": gain, "damping_gain": max(-float(bias[2]), 0.0)}
        limit = self._force_limit(number)
        return parameters | ({"force_limit": limit} if np.isfinite(limit) else {})

    def acts_on(self, element: str, name: str) -> tuple[tuple[str, float], ...]:
        """Return the joints on which a force along an element's coordinate acts.

        Every joint comes with the change of the coordinate per unit of the joint's position. The
        coordinate of a fixed tendon is Σ cᵢ · qᵢ, which has several joints. An element without a
        coordinate, such as a spatial tendon, has none.
        """
        model, number = self.model, self.tendon_of(element, name)
        if number is None:
            joint = self.joint_of(element, name)
            return ((joint, 1.0),) if joint else ()
        first = int(model.tendon_adr[number])
        wraps = range(first, first + int(model.tendon_num[number]))
        # A spatial tendon runs through sites, and its lever changes with the pose.
        if any(model.wrap_type[at] != mujoco.mjtWrap.mjWRAP_JOINT for at in wraps):
            return ()
        return tuple(
            (self.joint_name(int(model.wrap_objid[at])), float(model.wrap_prm[at])) for at in wraps
        )

    def tendon_of(self, element: str, name: str) -> int | None:
        """Return the index of the tendon that an element is, pulls or measures; None without."""
        model, number = self.model, self.number(element, name)
        if element == "tendon":
            return number
        if element == "actuator":
            pulls = int(model.actuator_trntype[number]) == mujoco.mjtTrn.mjTRN_TENDON
            return int(model.actuator_trnid[number, 0]) if pulls else None
        if element == "sensor":
            kind, target = int(model.sensor_objtype[number]), int(model.sensor_objid[number])
            if kind == mujoco.mjtObj.mjOBJ_TENDON:
                return target
            if kind == mujoco.mjtObj.mjOBJ_ACTUATOR:
                actuator = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, target) or ""
                return self.tendon_of("actuator", actuator) if actuator else None
        return None

    def ties(self) -> tuple[Tie, ...]:
        """Return the active equalities that make one joint follow another one linearly."""
        model, ties = self.model, []
        for number in range(model.neq):
            # MuJoCo: y − y₀ = a₀ + a₁(x − x₀) + a₂(x − x₀)² + …, where qpos0 holds x₀ and y₀.
            polynomial = model.eq_data[number, :5]
            if (
                model.eq_type[number] != mujoco.mjtEq.mjEQ_JOINT
                or not model.eq_active0[number]
                or model.eq_obj2id[number] < 0
                # Only linear equalities: a curved one would make the inertia depend on the
                # coordinate.
                or np.any(polynomial[2:])
            ):
                continue
            tied, to = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
            y_zero, x_zero = (float(model.qpos0[model.jnt_qposadr[joint]]) for joint in (tied, to))
            ratio = float(polynomial[1])
            offset = y_zero + float(polynomial[0]) - ratio * x_zero
            ties.append(Tie(self.joint_name(tied), self.joint_name(to), ratio, offset, number))
        return tuple(ties)

    def ties_of(self, moving: Iterable[str]) -> tuple[tuple[Tie, ...], tuple[Tie, ...]]:
        """Return the ties that make further joints follow moving ones.

        The order of the ties in the MJCF does not matter: a chain is followed link by link, and a
        tie is solved for its second joint where that joint is the one that follows.

        Parameters
        ----------
        moving
            Joints that move by themselves.

        Returns
        -------
        tuple
            Ties in the order of evaluation, in which every `to` is known before its `joint`; and
            the ties between two joints that already move.
        """
        known, remaining = set(moving), list(self.ties())
        ordered: list[Tie] = []
        while True:
            tie = next((t for t in remaining if (t.joint in known) != (t.to in known)), None)
            if tie is None:
                break
            remaining.remove(tie)
            # With a ratio of 0 the dependent joint is fixed, and says nothing of the other one.
            if tie.joint in known and tie.ratio == 0.0:
                continue
            ordered.append(tie if tie.to in known else tie.swapped())
            known.add(ordered[-1].joint)
        return tuple(ordered), tuple(t for t in remaining if t.joint in known and t.to in known)

    def _dof(self, joint: str) -> int:
        return int(self.model.jnt_dofadr[self.number("joint", joint)])

    def _place(self, joint: str) -> int:
        return int(self.model.jnt_qposadr[self.number("joint", joint)])

    def turns(self, joint: str) -> bool:
        """Return whether a joint is a hinge."""
        kind = int(self.model.jnt_type[self.number("joint", joint)])
        return kind == mujoco.mjtJoint.mjJNT_HINGE

    def is_angle(self, acts_on: tuple[tuple[str, float], ...]) -> bool:
        """Return whether a coordinate Σ cᵢ · qᵢ is an angle.

        MJCF does not say so: hinges with small coefficients are taken for pulleys of a cable.
        """
        hinges = bool(acts_on) and all(self.turns(joint) for joint, _ in acts_on)
        return hinges and max(abs(ratio) for _, ratio in acts_on) > LARGEST_PULLEY

    def armature(self, element: str, name: str) -> float:
        """Return the armature of a joint or a tendon, kg or kg m²."""
        number = self.number(element, name)
        if element == "tendon":
            return float(self.model.tendon_armature[number])
        return float(self.model.dof_armature[int(self.model.jnt_dofadr[number])])

    def rest_length(self, tendon: str) -> float:
        """Return the length of a tendon in the middle of the gap of its spring, m or rad."""
        return float(np.mean(self.model.tendon_lengthspring[self.number("tendon", tendon)]))

    def friction(self, element: str, name: str) -> dict[str, float]:
        """Return friction, damping and stiffness of a joint or tendon as parameters of a Guide.

        MuJoCo's polynomials hold more than a Guide: see `beyond_guide`.
        """
        model, number = self.model, self.number(element, name)
        if element == "tendon":
            dry, damping = model.tendon_frictionloss[number], model.tendon_damping[number]
            stiffness, weight = model.tendon_stiffness[number], model.tendon_invweight0[number]
            slack = float(np.ptp(model.tendon_lengthspring[number]))
            reference, impedance = model.tendon_solref_fri[number], model.tendon_solimp_fri[number]
            springs, dampers = model.tendon_stiffnesspoly[number], model.tendon_dampingpoly[number]
        else:
            at = int(model.jnt_dofadr[number])
            dry, damping = model.dof_frictionloss[at], model.dof_damping[at]
            stiffness, weight = model.jnt_stiffness[number], model.dof_invweight0[at]
            slack = 0.0
            reference, impedance = model.dof_solref[at], model.dof_solimp[at]
            springs, dampers = model.jnt_stiffnesspoly[number], model.dof_dampingpoly[at]
        # The constraint asks for the acceleration −v / T within ± the friction. Its reference is a
        # time constant and a damping ratio, or, where negative, a stiffness and a damping.
        low, high = float(impedance[0]), float(impedance[1])
        damped = 2.0 / (high * reference[0]) if reference[0] > 0.0 else -reference[1] / high
        soft_time = 1.0 / float(damped) if damped > 0.0 else 0.0
        return {
            "coulomb": float(dry),
            "viscous": float(np.ravel(damping)[0]),
            "stiffness": float(np.ravel(stiffness)[0]),
            # F = −k·d − k₁·d² − k₂·d³ and F = −c·v − c₁·v·|v| − c₂·v³.
            "cubic_stiffness": float(springs[1]),
            "drag": float(dampers[0]),
            "slack": slack,
            "soft_time": soft_time,
            "soft_speed": soft_time * (1.0 - low) / low * float(weight),
        }

    def beyond_guide(self, element: str, name: str) -> tuple[str, ...]:
        """Return the parts of a joint's or tendon's polynomials that a Guide cannot express."""
        model, number = self.model, self.number(element, name)
        if element == "tendon":
            springs, dampers = model.tendon_stiffnesspoly[number], model.tendon_dampingpoly[number]
        else:
            springs = model.jnt_stiffnesspoly[number]
            dampers = model.dof_dampingpoly[model.jnt_dofadr[number]]
        parts = {"quadratic part of its stiffness": springs[0], "cubic damping": dampers[1]}
        return tuple(part for part, value in parts.items() if value != 0.0)

    def body(self, name: str) -> dict[str, float]:
        """What the MJCF says of a body alone: mass, kg, its centre in the body's frame, m, and how
        far it reaches from there, m."""
        model, number = self.model, self.number("body", name)
        mass, centre = float(model.body_mass[number]), model.body_ipos[number]
        # Half the trace is the second moment of mass about the centre.
        second = 0.5 * float(np.sum(model.body_inertia[number])) / mass if mass > 0.0 else 0.0
        return {
            "mass": mass,
            **{f"centre_{axis}": float(at) for axis, at in zip("xyz", centre, strict=True)},
            "reach": max(float(np.sqrt(centre @ centre + second)), 1e-6),
        }

    def joint(self, name: str) -> Joint:
        """Return the mechanics of a joint with all others at rest, except those that follow it.

        Raises RigtwinError unless the joint is a slide or a hinge.
        """
        model, number = self._without_contacts, self.number("joint", name)
        kind = int(model.jnt_type[number])
        if kind not in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE):
            raise RigtwinError(f"joint {name}: expected one that slides or turns about one axis")
        turns = kind == mujoco.mjtJoint.mjJNT_HINGE
        at, place = int(model.jnt_dofadr[number]), int(model.jnt_qposadr[number])
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        # A joint that an equality ties to this one moves with it: q' = along * q'_joint.
        ties = self.ties_of([name])[0]
        along = np.zeros(model.nv)
        along[at] = 1.0
        for tie in ties:
            along[self._dof(tie.joint)] = tie.ratio * along[self._dof(tie.to)]
        low, high = (float(v) for v in model.jnt_range[number])
        if not model.jnt_limited[number]:
            # Without limits: a whole turn, or 1 m to either side.
            low, high = (-TURN, TURN) if turns else (-1.0, 1.0)
        # At rest MuJoCo's bias force c(q, 0) is the gravity load alone.
        positions = np.linspace(low, high, GRID)
        load = np.empty(GRID)
        for step, position in enumerate(positions):
            data.qpos[place] = position
            for tie in ties:
                followed = data.qpos[self._place(tie.to)]
                data.qpos[self._place(tie.joint)] = tie.offset + tie.ratio * followed
            mujoco.mj_forward(model, data)
            # Bodies with `gravcomp` are held up by a passive force.
            load[step] = along @ (data.qfrc_bias - data.qfrc_gravcomp)
        rest = float(model.qpos_spring[place])
        # Without gravity two points are enough, which keeps interpolation fast.
        gravity = tuple(load.tolist()) if np.any(np.abs(load) > 1e-12) else (0.0, 0.0)
        where = tuple(positions.tolist()) if len(gravity) == GRID else (low, high)
        armature = self.armature("joint", name)
        return Joint(
            name=name,
            turns=turns,
            # The armature is part of MuJoCo's inertia matrix.
            inertia=float(along @ full @ along),
            positions=where,
            gravity=gravity,
            rest=rest,
            armature=armature,
            pull=0.0 if turns else -float(data.xaxis[number] @ model.opt.gravity),
        )
