"""Components of a machine, one noun a file.

A component has parameters (unit, bounds, source), a law in compilable functions, the kinds of
effect that it can have, and the values from which a search for each effect starts.
"""

from rigtwin.components.actuators import ForceActuator, PositionActuator
from rigtwin.components.body import Base, Body
from rigtwin.components.computer import Computer, Mains
from rigtwin.components.cylinder import Cylinder
from rigtwin.components.effect import Effect, Kind, Starts
from rigtwin.components.gas_spring import GasSpring
from rigtwin.components.guide import Guide, Rail
from rigtwin.components.library import KINDS, candidates, find, title
from rigtwin.components.mass import Carriage, Mass
from rigtwin.components.motor import Motor
from rigtwin.components.plant import Plant, component_of, with_parameters
from rigtwin.components.quantity import UNLIMITED
from rigtwin.components.rig import RigPlant
from rigtwin.components.rotor import Rotor
from rigtwin.components.scales import Motion, Scales, Swing
from rigtwin.components.schedule import Schedule
from rigtwin.components.sensors import (
    ForceSensor,
    LoadCell,
    Lvdt,
    PositionSensor,
    VelocitySensor,
    measures,
)
from rigtwin.components.servo import PUSHERS, SERVOS, Pusher, Servo, VelocityServo
from rigtwin.components.tyre import Tyre
from rigtwin.components.warming import Warming

__all__ = [
    "KINDS",
    "PUSHERS",
    "SERVOS",
    "UNLIMITED",
    "Base",
    "Body",
    "Carriage",
    "Computer",
    "Cylinder",
    "Effect",
    "ForceActuator",
    "ForceSensor",
    "GasSpring",
    "Guide",
    "Kind",
    "LoadCell",
    "Lvdt",
    "Mains",
    "Mass",
    "Motion",
    "Motor",
    "Plant",
    "PositionActuator",
    "PositionSensor",
    "Pusher",
    "Rail",
    "RigPlant",
    "Rotor",
    "Scales",
    "Schedule",
    "Servo",
    "Starts",
    "Swing",
    "Tyre",
    "VelocitySensor",
    "VelocityServo",
    "Warming",
    "candidates",
    "component_of",
    "find",
    "measures",
    "title",
    "with_parameters",
]
