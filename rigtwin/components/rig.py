"""Plant of the hybrid suspension rig: a quarter car between two hydraulic cylinders."""

from __future__ import annotations

from typing import NamedTuple

from rigtwin.components.computer import Computer, Mains
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.gas_spring import GasSpring
from rigtwin.components.guide import Rail
from rigtwin.components.mass import Carriage
from rigtwin.components.motor import Motor
from rigtwin.components.sensors import LoadCell, Lvdt
from rigtwin.components.tyre import Tyre


class RigPlant(NamedTuple):
    """Parameters of the whole suspension rig; the defaults are the nominal rig."""

    # Mechanics.
    carriage: Carriage = Carriage()
    rail: Rail = Rail()
    tyre: Tyre = Tyre()
    motor: Motor = Motor()
    gas_spring: GasSpring = GasSpring()
    ground_cylinder: Cylinder = Cylinder()
    structure_cylinder: Cylinder = Cylinder()
    # Sensors, computer and mains.
    ground_lvdt: Lvdt = Lvdt()
    structure_lvdt: Lvdt = Lvdt()
    suspension_lvdt: Lvdt = Lvdt()
    load_cell: LoadCell = LoadCell()
    computer: Computer = Computer()
    mains: Mains = Mains()
