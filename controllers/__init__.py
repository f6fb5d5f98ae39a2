"""The controllers of the rig: plain functions of settings, state and input.

They run as Python or compiled, on the rig and on the twin, and import nothing of the twin.
`update` is one tick of the whole controller.
"""

from controllers.mil import (
    SIZE,
    Controller,
    MilState,
    controller,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.settings import (
    Compensator,
    Mode,
    PlateCompensator,
    Settings,
    Skyhook,
    Structure,
    Travel,
)
from controllers.signals import Commands, Demand, Measurements

__all__ = [
    "SIZE",
    "Commands",
    "Compensator",
    "Controller",
    "Demand",
    "Measurements",
    "MilState",
    "Mode",
    "PlateCompensator",
    "Settings",
    "Skyhook",
    "Structure",
    "Travel",
    "controller",
    "initial_state",
    "packed",
    "unpacked",
    "update",
]
