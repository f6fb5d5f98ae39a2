"""What goes into and out of the controller at each tick. Field names are the channel names of a
recording."""

from __future__ import annotations

from typing import NamedTuple


class Measurements(NamedTuple):
    """`/sensor`: raw samples. Positions in m; force in N, positive in compression."""

    ground_lvdt: float
    structure_lvdt: float
    suspension_lvdt: float
    load_cell: float


class Demand(NamedTuple):
    """What the test asks for: ground motion (m) always; structure motion (m) and force (N) in
    imposed tests only."""

    ground: float
    structure: float
    force: float


class Commands(NamedTuple):
    """`/command`: cylinder positions (m), suspension force demanded (N), motor amplifier voltage
    (V)."""

    ground: float
    structure: float
    force: float
    voltage: float
