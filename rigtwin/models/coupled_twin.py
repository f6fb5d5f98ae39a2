"""The twin of joints that act on each other, some of them free: what their sensors read in a
test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigtwin.components import measures
from rigtwin.components.sensors import apply_sensor
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine, Row
from rigtwin.errors import RigtwinError
from rigtwin.models.coupled import CoupledModel
from rigtwin.models.demanded import pose_as_recorded
from rigtwin.numerics.arrays import RUNAWAY, Array


def move_freely(
    machine: Machine, configuration: Configuration, demands: dict[str, Array]
) -> dict[str, Array]:
    """What the sensors read, noise and bits apart.

    Parameters
    ----------
    machine
        Its description.
    configuration
        With the effects that it has.
    demands
        Component → the command of an actuator, or where a joint goes that a sensor prescribes,
        shape (ticks,).

    Returns
    -------
    dict
        Component → reading, shape (ticks,), of all its sensors.

    Raises
    ------
    RigtwinError
        If it runs away.
    """
    (replay,) = machine.replays
    plant, period = configuration.plant, configuration.timing.period
    found = {
        name: apply_sensor(getattr(plant, name), demand, period)
        for name, demand in demands.items()
        if measures(getattr(plant, name))
    }
    recording = pose_as_recorded(machine, {**demands, **found}, period)
    unobserved = replace(replay, rows=())
    model = CoupledModel(machine, unobserved, recording, configuration, configuration.substeps)
    moved = model.move(plant)
    if not np.isfinite(moved).all() or np.max(np.abs(moved[:2])) >= RUNAWAY:
        raise RigtwinError(f"{machine.name}: {', '.join(replay.free)} run away")
    for name, component in machine.components.items():
        kind = measures(getattr(plant, name))
        if kind and name not in found and component.channel is not None and component.acts_on:
            row = Row(name, kind, component.channel, component.unit)
            found[name] = apply_sensor(getattr(plant, name), model.observe(row, moved), period)
    return found
