"""Peaks of a test in relation to its limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import VELOCITY_SPAN


@dataclass(frozen=True)
class Peak:
    """Peak of one limited quantity of a test.

    Attributes
    ----------
    name : str
        Name of the quantity.
    peak, limit : float
        Largest magnitude and limit, in the unit.
    unit : str
        Unit of both.
    """

    name: str
    peak: float
    limit: float
    unit: str

    @property
    def margin(self) -> float:
        """Share of the limit that the test did not use; negative beyond the limit."""
        return 1.0 - self.peak / self.limit


def peaks(commands: Array, measurements: Array, configuration: Configuration) -> tuple[Peak, ...]:
    """Return the peaks of all limited quantities of a test.

    Parameters
    ----------
    commands, measurements
        Columns of `Commands` and `Measurements`, shape (ticks, 4).
    configuration
        Settings of the test, with its limits.

    Returns
    -------
    tuple of Peak
        One peak for each limit.
    """
    limits, period = configuration.safety, configuration.timing.period
    ground, structure, force, voltage = commands.T
    ground_lvdt, structure_lvdt, travel, load_cell = measurements.T
    # The same averaging as the limit's own (`safety`), or noise would count as velocity.
    span = min(VELOCITY_SPAN, len(travel) - 1)
    moved = (travel[span:] - travel[:-span]) / (span * period) if span else np.zeros(1)

    def peak(values: Array) -> float:
        return float(np.max(np.abs(values)))

    def rate(values: Array) -> float:
        return peak(np.diff(values)) / period if len(values) > 1 else 0.0

    return (
        Peak("force", peak(load_cell), limits.force, "N"),
        Peak("travel", peak(travel), limits.travel, "m"),
        Peak("structure", peak(structure_lvdt), limits.structure, "m"),
        Peak("ground", peak(ground_lvdt), limits.ground, "m"),
        Peak("velocity of travel", peak(moved), limits.velocity, "m/s"),
        Peak("voltage", peak(voltage), configuration.controller.voltage_limit, "V"),
        Peak("rate of the ground command", rate(ground), limits.command_rate, "m/s"),
        Peak("rate of the structure command", rate(structure), limits.command_rate, "m/s"),
        Peak("structure off its command", peak(structure - structure_lvdt), limits.following, "m"),
        Peak("force off its demand", peak(force - load_cell), limits.following_force, "N"),
    )
