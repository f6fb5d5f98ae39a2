"""Contact of the tyre and yielding of the cylinders, as compiled code takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigtwin.components import GasSpring, RigPlant
from rigtwin.components.dry_friction import Friction, friction, gap_at
from rigtwin.numerics.arrays import Array


class RigContacts(NamedTuple):
    """Forces of the mechanics that change with the motion, and their states."""

    changing: bool  # Whether anything but constant friction and a linear tyre acts.
    rail: Friction  # Dry friction of the rail.
    rail_gap: Array  # State of the rail's backlash, m, shape (1,).
    motor: Friction  # Dry friction of the motor.
    motor_gap: Array  # State of the motor's backlash, m, shape (1,).
    cogging: float  # Amplitude of the motor's cogging, N.
    cogging_pitch: float  # Wavelength of the cogging, m.
    cogging_phase: float  # Phase of the cogging at zero travel, rad.
    stiffness: float  # Stiffness of the tyre at small deflection, N/m.
    damping: float  # Damping of the tyre, Ns/m.
    hardening: float  # Hardening of the tyre, 1/m.
    hardening_power: float  # Power of the hardening.
    ground_compliance: float  # Compliance of the ground cylinder, m/N.
    ground_unloaded: float  # Yield of the ground plate without load, m.
    ground_lag: float  # Lag of the ground plate's yielding, s.
    structure_compliance: float  # Compliance of the structure cylinder, m/N.
    structure_unloaded: float  # Yield of the structure plate without load, m.
    structure_lag: float  # Lag of the structure plate's yielding, s.
    mass: float  # Mass of the carriage, kg.
    rail_viscous: float  # Viscous friction of the rail, Ns/m.
    motor_viscous: float  # Viscous friction of the motor, Ns/m.
    gas: GasSpring  # Gas spring parallel to the motor.
    yielded: Array  # Yield of ground and structure plate, m, shape (2,).


def contacts(plant: RigPlant, carriage: float, travel: float, preload: float) -> RigContacts:
    """Return a plant's contacts before anything moves.

    Parameters
    ----------
    plant
        Parameters of the rig.
    carriage, travel
        Position of the carriage and travel of the suspension, m.
    preload
        Motor force at the start, N.

    Returns
    -------
    RigContacts
        Contacts with new states.
    """
    rail, motor, tyre = friction(plant.rail), friction(plant.motor), plant.tyre
    compliances = plant.ground_cylinder.compliance, plant.structure_cylinder.compliance
    unloaded = unloaded_yield(plant)
    forces = (tyre.hardening, plant.motor.cogging, *compliances, plant.gas_spring.force)
    return RigContacts(
        changing=rail.changing or motor.changing or any(forces),
        rail=rail,
        rail_gap=gap_at(carriage),
        motor=motor,
        motor_gap=gap_at(travel),
        cogging=plant.motor.cogging,
        cogging_pitch=plant.motor.cogging_pitch,
        cogging_phase=plant.motor.cogging_phase,
        stiffness=tyre.stiffness,
        damping=tyre.damping,
        hardening=tyre.hardening,
        hardening_power=tyre.hardening_power,
        ground_compliance=compliances[0],
        ground_unloaded=unloaded[0],
        ground_lag=plant.ground_cylinder.yield_lag,
        structure_compliance=compliances[1],
        structure_unloaded=unloaded[1],
        structure_lag=plant.structure_cylinder.yield_lag,
        mass=plant.carriage.mass,
        rail_viscous=plant.rail.viscous,
        motor_viscous=plant.motor.viscous,
        gas=plant.gas_spring,
        yielded=np.array(initial_yield(plant, preload)),
    )


def initial_deflection(plant: RigPlant, preload: float) -> float:
    """Return the tyre's deflection at the start, m.

    The tyre carries the motor's preload, N, and the force of the extended gas spring.
    """
    return (preload + plant.gas_spring.force) / plant.tyre.stiffness


def initial_yield(plant: RigPlant, preload: float) -> tuple[float, float]:
    """Return the yield of ground and structure plate at the start, m, under a preload, N."""
    tyre, unloaded = preload + plant.gas_spring.force, unloaded_yield(plant)
    return (
        unloaded[0] - plant.ground_cylinder.compliance * tyre,
        unloaded[1] + plant.structure_cylinder.compliance * preload,
    )


def unloaded_yield(plant: RigPlant) -> tuple[float, float]:
    """Return the yield of ground and structure plate without load, m."""
    ground, structure = plant.ground_cylinder, plant.structure_cylinder
    return ground.compliance * ground.zero_load, -structure.compliance * structure.zero_load
