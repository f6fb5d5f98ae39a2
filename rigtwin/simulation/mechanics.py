"""Mechanics of the suspension rig: the MJCF model with a plant's values, and views of its data."""

from __future__ import annotations

from copy import copy
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import mujoco

from rigtwin.components import RigPlant
from rigtwin.numerics.arrays import Array

SCENE = files("models") / "xml" / "scene.xml"
"""MJCF of the rig with lights and cameras."""
MECHANICS = files("models") / "xml" / "suspension_rig.xml"
"""MJCF of the rig alone."""


class Handles(NamedTuple):
    """Addresses of MuJoCo's structures and live views of their arrays, for compiled code."""

    model: int  # Address of MuJoCo's model.
    data: int  # Address of MuJoCo's data.
    timestep: float  # Integration step, s.
    qpos: Array  # Positions, m.
    qvel: Array  # Velocities, m/s.
    activation: Array  # State of the motor's first-order lag, V.
    control: Array  # Command of the motor, V.
    applied: Array  # Forces applied to the joints, N.
    sensors: Array  # Readings of MuJoCo's sensors.
    ground: int  # Index of the ground plate's joint.
    carriage: int  # Index of the carriage's joint.
    structure: int  # Index of the structure plate's joint.
    load_cell: int  # Index of the load cell among the sensors.
    motor_constant: float  # Force per unit of voltage, N/V.
    passive: Array  # Forces of springs and dampers, N.
    rail_friction: Array  # View of the rail's dry friction, N, shape (1,).
    motor_friction: Array  # View of the motor's dry friction, N, shape (1,).
    motor_bias: Array  # View of the motor's constant force, N.
    tyre: Array  # View of the tyre's `solref`, −stiffness and −damping times `tyre_scale`.
    tyre_scale: float  # Factor from `tyre_scale`, 1/kg.


@cache
def _nominal() -> mujoco.MjModel:
    """Return the model of the MJCF, compiled once and never changed.

    It has lights and cameras, so that a running twin can be rendered. They change no digit of its
    motion.
    """
    return mujoco.MjModel.from_xml_path(str(SCENE))


def build(plant: RigPlant, timestep: float) -> mujoco.MjModel:
    """Return the mechanics of a plant, integrated with a timestep, s."""
    model = copy(_nominal())
    model.opt.timestep = timestep
    model.body("carriage").mass = plant.carriage.mass
    mujoco.mj_setConst(model, mujoco.MjData(model))
    carriage, rod = model.joint("carriage").dofadr[0], model.tendon("motor").id
    model.dof_frictionloss[carriage] = plant.rail.coulomb
    model.dof_damping[carriage] = plant.rail.viscous
    model.tendon_frictionloss[rod] = plant.motor.coulomb
    model.tendon_damping[rod] = plant.motor.viscous
    # MuJoCo regularises dry friction by a time constant and raises values below two timesteps. The
    # smallest one gives the least creep of a sticking contact.
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
    """Return the factor from a stiffness (N/m) or damping (Ns/m) to −solref of the tyre, 1/kg.

    MuJoCo solves f·(A + R) = −k·r − b·v with R = (1 − d)/d·D, k and b = −solref/d, where d is the
    impedance, A the contact's exact inverse mass and D its approximate one (MuJoCo documentation,
    computation, "Parameters"). This function solves that for solref.
    """
    pair = model.pair("tyre")
    impedance = float(pair.solimp[0])
    bodies = [int(model.geom_bodyid[geom]) for geom in (pair.geom1[0], pair.geom2[0])]
    exact = sum(1.0 / float(model.body_mass[body]) for body in bodies)
    approximate = sum(float(model.body_invweight0[body, 0]) for body in bodies)
    return impedance * exact + (1.0 - impedance) * approximate


def _single(number: int) -> slice:
    """Return the slice of one element, which indexes it as a view."""
    return slice(int(number), int(number) + 1)


def handles(model: mujoco.MjModel, data: mujoco.MjData) -> Handles:
    """Return the views of one simulation. They are valid as long as `model` and `data` live."""
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
        passive=data.qfrc_passive,
        rail_friction=model.dof_frictionloss[_single(model.joint("carriage").dofadr[0])],
        motor_friction=model.tendon_frictionloss[_single(model.tendon("motor").id)],
        motor_bias=model.actuator("motor").biasprm,
        tyre=model.pair("tyre").solref,
        tyre_scale=tyre_scale(model),
    )
