"""Where a machine's joints stand, from its signals alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, sosfiltfilt

from rigtwin.components import PositionActuator, measures
from rigtwin.description.machine import Machine, Structure
from rigtwin.numerics.arrays import Array

SMOOTHING = 20.0
"""Hz; what is shown is filtered forwards and backwards, or the mains hum would shake the rig."""


def joint_positions(
    machine: Machine, columns: Mapping[str, Mapping[str, Array]], period: float
) -> dict[str, Array]:
    """Positions of a machine's joints.

    Parameters
    ----------
    machine
        That the signals are of.
    columns
        Topic → field → values, shape (ticks,), as recordings have them.
    period
        s, from tick to tick.

    Returns
    -------
    dict of Array
        Joint → position at every tick, m or rad: as measured, else as commanded, else as its
        velocity adds up to. Joints that the signals say nothing of are left out.
    """
    if machine.structure is Structure.QUARTER_CAR:
        sensed = columns.get("/sensor", {})
        if not {"structure_lvdt", "suspension_lvdt"} <= set(sensed):
            return {}
        structure = _smooth(sensed["structure_lvdt"], period)
        travel = _smooth(sensed["suspension_lvdt"], period)
        ground = np.zeros_like(structure)
        if "ground_lvdt" in sensed:
            ground = _smooth(sensed["ground_lvdt"], period)
        return {"ground": ground, "carriage": structure - travel, "structure": structure}
    found: dict[str, Array] = {}
    for wanted in ("position", "command", "velocity"):
        for name, component in machine.components.items():
            part = getattr(machine.plant, name)
            says = "command" if isinstance(part, PositionActuator) else measures(part)
            if says != wanted or component.joint in found or component.channel is None:
                continue
            topic, label = component.channel
            signal = columns.get(topic, {}).get(label)
            if signal is not None:
                summed = np.cumsum(signal - np.mean(signal)) * period
                found[component.joint] = summed if wanted == "velocity" else signal
    return found


def _smooth(signal: Array, period: float) -> Array:
    if 0.45 / period <= SMOOTHING or len(signal) < 50:
        return signal
    return sosfiltfilt(butter(2, SMOOTHING, fs=1.0 / period, output="sos"), signal)
