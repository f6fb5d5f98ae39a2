"""Inputs and outputs of the controller at every tick.

The names of the fields are the channel names of a recording.
"""

from __future__ import annotations

from typing import NamedTuple


class Measurements(NamedTuple):
    """Raw samples, topic `/sensor`: positions, m, and force, N, positive in compression."""

    ground_lvdt: float
    structure_lvdt: float
    suspension_lvdt: float
    load_cell: float


class Demand(NamedTuple):
    """Demands of the test: ground motion, m, structure motion, m, and force, N.

    Structure motion and force count in imposed tests only.
    """

    ground: float
    structure: float
    force: float


class Commands(NamedTuple):
    """Commands, topic `/command`: cylinder positions, m, demanded force, N, motor voltage, V."""

    ground: float
    structure: float
    force: float
    voltage: float
