"""The mechanics: the MJCF model with a plant's values written into it, and the views of it that
compiled code needs."""

from __future__ import annotations

from copy import copy
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import mujoco

from rigtwin.components import RigPlant
from rigtwin.numerics.arrays import Array

SCENE = files("models") / "xml" / "scene.xml"
"""The rig with lights and cameras."""
MECHANICS = files("models") / "xml" / "suspension_rig.xml"
"""The rig alone."""


class Handles(NamedTuple):
    """Addresses of MuJoCo's structures, live views of their arrays, and where each part stands in
    them."""

    model: int
    data: int
    timestep: float
    qpos: Array
    qvel: Array
    activation: Array
    control: Array
    applied: Array
    sensors: Array
    ground: int
    carriage: int
    structure: int
    load_cell: int
    motor_constant: float
    constraint: Array
    passive: Array
    rail_friction: Array
    motor_friction: Array
    motor_bias: Array
    tyre: Array
    tyre_scale: float


@cache
def _nominal() -> mujoco.MjModel:
    """The model as the XML has it, compiled once; never changed. With its lights and cameras, so
    that a running twin can be looked at; they change no digit of its motion."""
    return mujoco.MjModel.from_xml_path(str(SCENE))


def build(plant: RigPlant, timestep: float) -> mujoco.MjModel:
    """The mechanics of that plant. timestep in s."""
    model = copy(_nominal())
    model.opt.timestep = timestep
    model.body("carriage").mass = plant.carriage.mass
    mujoco.mj_setConst(model, mujoco.MjData(model))
    carriage, rod = model.joint("carriage").dofadr[0], model.tendon("motor").id
    model.dof_frictionloss[carriage] = plant.rail.coulomb
    model.dof_damping[carriage] = plant.rail.viscous
    model.tendon_frictionloss[rod] = plant.motor.coulomb
    model.tendon_damping[rod] = plant.motor.viscous
    # Two timesteps: the fastest friction constraint MuJoCo takes as it is, so the least creep.
    model.dof_solref[:, 0] = 2 * timestep
    model.tendon_solref_fri[:, 0] = 2 * timestep
    scale = tyre_scale(model)
    model.pair("tyre").solref[:] = (-scale * plant.tyre.stiffness, -scale * plant.tyre.damping)
    motor = model.actuator("motor")
    motor.gainprm[0] = plant.motor.constant
    motor.dynprm[0] = plant.motor.time_constant
    limit = min(plant.motor.voltage_limit, plant.motor.force_limit / plant.motor.constant)
    motor.ctrlrange[:] = (-limit, limit)
    return model


def tyre_scale(model: mujoco.MjModel) -> float:
    """What to multiply a stiffness (N/m) or damping (Ns/m) by for −solref of the tyre's contact,
    1/kg.

    MuJoCo solves f·(A + R) = −k·r − b·v with R = (1 − d)/d·D, k and b = −solref/d, where d is the
    impedance, A the contact's exact inverse mass and D its approximate one (MuJoCo documentation,
    computation, "Parameters"). Solved for solref here.
    """
    pair = model.pair("tyre")
    impedance = float(pair.solimp[0])
    bodies = [int(model.geom_bodyid[geom]) for geom in (pair.geom1[0], pair.geom2[0])]
    exact = sum(1.0 / float(model.body_mass[body]) for body in bodies)
    approximate = sum(float(model.body_invweight0[body, 0]) for body in bodies)
    return impedance * exact + (1.0 - impedance) * approximate


def _one(number: int) -> slice:
    """The place of one element, as a view."""
    return slice(int(number), int(number) + 1)


def handles(model: mujoco.MjModel, data: mujoco.MjData) -> Handles:
    """Views of one simulation. They live as long as `model` and `data` do."""
    return Handles(
        model=model._address,
        data=data._address,
        timestep=float(model.opt.timestep),
        qpos=data.qpos,
        qvel=data.qvel,
        activation=data.act,
        control=data.ctrl,
        applied=data.qfrc_applied,
        sensors=data.sensordata,
        ground=int(model.joint("ground").qposadr[0]),
        carriage=int(model.joint("carriage").qposadr[0]),
        structure=int(model.joint("structure").qposadr[0]),
        load_cell=int(model.sensor("load_cell").adr[0]),
        motor_constant=float(model.actuator("motor").gainprm[0]),
        constraint=data.qfrc_constraint,
        passive=data.qfrc_passive,
        rail_friction=model.dof_frictionloss[_one(model.joint("carriage").dofadr[0])],
        motor_friction=model.tendon_frictionloss[_one(model.tendon("motor").id)],
        motor_bias=model.actuator("motor").biasprm,
        tyre=model.pair("tyre").solref,
        tyre_scale=tyre_scale(model),
    )
