"""How near to its limits a test came."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import VELOCITY_SPAN


@dataclass(frozen=True)
class Peak:
    """One limited quantity of a test. peak and limit in the unit; margin: share of the limit that
    is left."""

    name: str
    peak: float
    limit: float
    unit: str

    @property
    def margin(self) -> float:
        return 1.0 - self.peak / self.limit


def peaks(commands: Array, measurements: Array, configuration: Configuration) -> tuple[Peak, ...]:
    """Every limited quantity of a test. commands, measurements: shape (ticks, 4), columns of
    controllers.Commands and .Measurements."""
    limits, period = configuration.safety, configuration.timing.period
    ground, structure, force, voltage = commands.T
    ground_lvdt, structure_lvdt, travel, load_cell = measurements.T
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
