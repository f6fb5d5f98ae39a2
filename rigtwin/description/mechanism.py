"""What a description needs of an MJCF: its named elements, and what moves with a joint."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from rigtwin.description.actuator_law import (
    find_obstacle,
    lies_at_command,
    read_timing,
    rest_position,
)
from rigtwin.description.machine import Joint
from rigtwin.description.model_checks import check_text, check_values
from rigtwin.errors import RigtwinError

OBJECTS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "contact": mujoco.mjtObj.mjOBJ_PAIR,
}
"""Element of an MJCF that can be a component → MuJoCo's name for it."""
GRID = 1441
"""Positions at which a joint's gravity load is worked out."""
TURN = float(np.pi)
"""rad; how far to either side a joint without a range turns."""
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
"""Sensor of an MJCF → what it measures."""


class Tie(NamedTuple):
    """An equality between joints: joint = apart + ratio · to; number: of the equality."""

    joint: str
    to: str
    ratio: float
    apart: float
    number: int

    def turned(self) -> Tie:
        """The same with both joints exchanged; its ratio must not be zero."""
        return Tie(self.to, self.joint, 1.0 / self.ratio, -self.apart / self.ratio, self.number)


MASSLESS = 1e-6
"""kg, and kg m² times as much again, of a link that a URDF gives no mass: MuJoCo wants some."""


def compile_model(
    path: Path, alter: Callable[[mujoco.MjSpec], None] | None = None
) -> mujoco.MjModel:
    """The model of an MJCF or a URDF, altered before it is compiled. Raises ValueError if it is
    none."""
    urdf = path.suffix.lower() == ".urdf"
    if not urdf and alter is None:
        return mujoco.MjModel.from_xml_path(str(path))
    spec = mujoco.MjSpec.from_file(str(path))
    if urdf:
        spec.compiler.boundmass, spec.compiler.boundinertia = MASSLESS, MASSLESS**2
    if alter is not None:
        alter(spec)
    return spec.compile()


class Mechanism:
    """An MJCF, compiled."""

    def __init__(self, path: Path) -> None:
        """Raises RigtwinError if it is none."""
        if not path.is_file():
            raise RigtwinError(f"model {path} does not exist")
        check_text(path)
        try:
            self.model = compile_model(path)
        except ValueError as error:
            raise RigtwinError(f"model {path}: {' '.join(str(error).split())}") from None
        check_values(path, self.model)

    def names(self, element: str) -> list[str]:
        """Names of all elements of a sort."""
        kind = OBJECTS[element]
        count = {
            "body": self.model.nbody,
            "joint": self.model.njnt,
            "actuator": self.model.nactuator,
            "sensor": self.model.nsensor,
            "tendon": self.model.ntendon,
            "contact": self.model.npair,
        }[element]
        found = [mujoco.mj_id2name(self.model, kind, number) for number in range(count)]
        return [name for name in found if name]

    def number(self, element: str, name: str) -> int:
        return int(mujoco.mj_name2id(self.model, OBJECTS[element], name))

    def joint_name(self, number: int) -> str:
        return mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_JOINT, number) or ""

    def joint_of(self, element: str, name: str) -> str:
        """The joint that an element belongs to; empty if it belongs to none alone."""
        model, number = self.model, self.number(element, name)
        if element == "joint":
            return name
        if element == "body":
            while number > 0 and model.body_jntnum[number] == 0:
                number = int(model.body_parentid[number])
            return (
                self.joint_name(int(model.body_jntadr[number]))
                if model.body_jntnum[number] == 1
                else ""
            )
        if element == "actuator":
            through = int(model.actuator_trntype[number])
            if through in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
                return self.joint_name(int(model.actuator_trnid[number, 0]))
            return ""
        if element == "sensor":
            kind, what = int(model.sensor_objtype[number]), int(model.sensor_objid[number])
            if kind == mujoco.mjtObj.mjOBJ_JOINT:
                return self.joint_name(what)
            if kind == mujoco.mjtObj.mjOBJ_ACTUATOR:
                return self.joint_of(
                    "actuator", mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, what) or ""
                )
        return ""

    def measures(self, name: str) -> str:
        """What a sensor measures: position, velocity or force; empty for anything else."""
        return SENSORS.get(
            mujoco.mjtSensor(int(self.model.sensor_type[self.number("sensor", name)])), ""
        )

    def positions(self, name: str) -> bool:
        """Whether an actuator takes a position as its command."""
        return lies_at_command(self.model, self.number("actuator", name))

    def actuator_timing(self, name: str) -> dict[str, float]:
        """Delay and lag of an actuator's command, s, as far as the MJCF gives them."""
        return read_timing(self.model, self.number("actuator", name))

    def rest_position(self, name: str) -> dict[str, float]:
        """Gain and offset of a position actuator's rest position, where it is not its command."""
        return rest_position(self.model, self.number("actuator", name))

    def actuator_obstacle(self, name: str, kind: str) -> str | None:
        """What of an actuator a component of this type cannot express; None for nothing."""
        return find_obstacle(self.model, self.number("actuator", name), kind)

    def command_limits(self, name: str) -> tuple[float, float]:
        """Between which an actuator takes its command (infinite if there are none)."""
        number = self.number("actuator", name)
        if not self.model.actuator_ctrllimited[number]:
            return -np.inf, np.inf
        low, high = self.model.actuator_ctrlrange[number]
        return float(low), float(high)

    def force_per_command(self, name: str) -> tuple[float, float]:
        """A force actuator's constant and limit, N or Nm (infinite if there is none)."""
        number = self.number("actuator", name)
        gear, gain = (
            float(self.model.actuator_gear[number, 0]),
            float(self.model.actuator_gainprm[number, 0]),
        )
        limit = np.inf
        if self.model.actuator_forcelimited[number]:
            limit = abs(gear) * float(self.model.actuator_forcerange[number, 1])
        return gear * gain, limit

    def servo(self, name: str) -> dict[str, float] | None:
        """A position actuator's gains and its force's limit, by the parameters of a Servo; None if
        it is none, or acts through a gear."""
        model, number = self.model, self.number("actuator", name)
        gain, bias = float(model.actuator_gainprm[number, 0]), model.actuator_biasprm[number]
        affine = int(model.actuator_biastype[number]) == mujoco.mjtBias.mjBIAS_AFFINE
        same = np.isclose(bias[1], -gain) and gain != 0.0
        if not affine or not same or float(model.actuator_gear[number, 0]) != 1.0:
            return None
        found = {"position_gain": gain, "damping_gain": max(-float(bias[2]), 0.0)}
        if model.actuator_forcelimited[number]:
            found["force_limit"] = float(model.actuator_forcerange[number, 1])
        return found

    def acts_on(self, element: str, name: str) -> tuple[tuple[str, float], ...]:
        """Joints that a force along an element's own coordinate acts on, and how far that goes for
        each unit of theirs: a fixed tendon has several; none where there is no such coordinate."""
        model, number = self.model, self.tendon_of(element, name)
        if number is None:
            joint = self.joint_of(element, name)
            return ((joint, 1.0),) if joint else ()
        first = int(model.tendon_adr[number])
        wraps = range(first, first + int(model.tendon_num[number]))
        if any(model.wrap_type[at] != mujoco.mjtWrap.mjWRAP_JOINT for at in wraps):
            return ()
        return tuple(
            (self.joint_name(int(model.wrap_objid[at])), float(model.wrap_prm[at])) for at in wraps
        )

    def tendon_of(self, element: str, name: str) -> int | None:
        """The number of the tendon that an element is, pulls or measures; None if it is none."""
        model, number = self.model, self.number(element, name)
        if element == "tendon":
            return number
        if element == "actuator":
            pulls = int(model.actuator_trntype[number]) == mujoco.mjtTrn.mjTRN_TENDON
            return int(model.actuator_trnid[number, 0]) if pulls else None
        if element == "sensor":
            kind, what = int(model.sensor_objtype[number]), int(model.sensor_objid[number])
            if kind == mujoco.mjtObj.mjOBJ_TENDON:
                return what
            if kind == mujoco.mjtObj.mjOBJ_ACTUATOR:
                by = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, what) or ""
                return self.tendon_of("actuator", by) if by else None
        return None

    def ties(self) -> tuple[Tie, ...]:
        """The joints that equalities tie to another, one in proportion to the other."""
        model, found = self.model, []
        for number in range(model.neq):
            polynomial = model.eq_data[number, :5]
            if (
                model.eq_type[number] != mujoco.mjtEq.mjEQ_JOINT
                or not model.eq_active0[number]
                or model.eq_obj2id[number] < 0
                or np.any(polynomial[2:])
            ):
                continue
            tied, to = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
            here, there = (float(model.qpos0[model.jnt_qposadr[joint]]) for joint in (tied, to))
            ratio = float(polynomial[1])
            apart = here + float(polynomial[0]) - ratio * there
            found.append(Tie(self.joint_name(tied), self.joint_name(to), ratio, apart, number))
        return tuple(found)

    def ties_of(self, moving: Iterable[str]) -> tuple[tuple[Tie, ...], tuple[Tie, ...]]:
        """The ties that make further joints move with some joints, whatever the order in which the
        MJCF has them: a chain is followed link by link, and a tie is turned round where the joint
        that it names second is the one that moves along.

        Parameters
        ----------
        moving
            Joints that move by themselves.

        Returns
        -------
        tuple
            Ties in an order in which each one's `to` is known before, and the ties between two
            joints that move anyway.
        """
        known, rest = set(moving), list(self.ties())
        ordered: list[Tie] = []
        while True:
            ahead = next((t for t in rest if (t.joint in known) != (t.to in known)), None)
            if ahead is None:
                break
            rest.remove(ahead)
            if ahead.joint in known and ahead.ratio == 0.0:
                continue
            ordered.append(ahead if ahead.to in known else ahead.turned())
            known.add(ordered[-1].joint)
        return tuple(ordered), tuple(t for t in rest if t.joint in known and t.to in known)

    def turns(self, joint: str) -> bool:
        """Whether a joint is a hinge."""
        kind = int(self.model.jnt_type[self.number("joint", joint)])
        return kind == mujoco.mjtJoint.mjJNT_HINGE

    def armature(self, element: str, name: str) -> float:
        """The inertia that the MJCF gives a joint or a tendon for itself, kg or kg m²."""
        number = self.number(element, name)
        if element == "tendon":
            return float(self.model.tendon_armature[number])
        return float(self.model.dof_armature[int(self.model.jnt_dofadr[number])])

    def friction(self, element: str, name: str) -> dict[str, float]:
        """What the MJCF gives a joint or a tendon of friction and stiffness, by the parameters of a
        Guide."""
        model, number = self.model, self.number(element, name)
        if element == "tendon":
            dry, damping = model.tendon_frictionloss[number], model.tendon_damping[number]
            stiffness = model.tendon_stiffness[number]
        else:
            at = int(model.jnt_dofadr[number])
            dry, damping = model.dof_frictionloss[at], model.dof_damping[at]
            stiffness = model.jnt_stiffness[number]
        return {
            "coulomb": float(dry),
            "viscous": float(np.ravel(damping)[0]),
            "stiffness": float(np.ravel(stiffness)[0]),
        }

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
        """What moves with a joint, all others at rest. Raises RigtwinError if it neither slides nor
        turns about one axis."""
        model, number = self.model, self.number("joint", name)
        kind = int(model.jnt_type[number])
        if kind not in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE):
            raise RigtwinError(f"joint {name}: expected one that slides or turns about one axis")
        turns = kind == mujoco.mjtJoint.mjJNT_HINGE
        at, place = int(model.jnt_dofadr[number]), int(model.jnt_qposadr[number])
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        low, high = (float(v) for v in model.jnt_range[number])
        if not model.jnt_limited[number]:
            low, high = (-TURN, TURN) if turns else (-1.0, 1.0)
        positions = np.linspace(low, high, GRID)
        load = np.empty(GRID)
        for step, position in enumerate(positions):
            data.qpos[place] = position
            mujoco.mj_forward(model, data)
            load[step] = data.qfrc_bias[at]
        rest = float(model.qpos_spring[place])
        gravity = tuple(load.tolist()) if np.any(np.abs(load) > 1e-12) else (0.0, 0.0)
        where = tuple(positions.tolist()) if len(gravity) == GRID else (low, high)
        armature = self.armature("joint", name)
        return Joint(
            name=name,
            turns=turns,
            inertia=float(full[at, at]),
            positions=where,
            gravity=gravity,
            rest=rest,
            armature=armature,
        )
