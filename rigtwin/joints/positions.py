"""Positions of a machine's joints, from its signals alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.components import PositionActuator
from rigtwin.description.component import Component
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array


def joint_positions(
    machine: Machine, columns: Mapping[str, Mapping[str, Array]], period: float
) -> dict[str, Array]:
    """Return the positions of a machine's joints.

    Parameters
    ----------
    machine
        Machine the signals belong to.
    columns
        Topic → field → values, shape (ticks,), as in recordings.
    period
        Time from tick to tick, s.

    Returns
    -------
    dict of Array
        Joint → position at every tick, m or rad: measured, else commanded, else the integral of the
        velocity. Joints without any of these signals are left out.
    """
    positions: dict[str, Array] = {}
    for wanted in ("position", "command", "velocity"):
        for component in machine.components.values():
            positioned = component.component_type is PositionActuator
            quantity = "command" if positioned else component.quantity
            signal = _find_signal(component, columns)
            if quantity != wanted or signal is None or component.joint in ("", *positions):
                continue
            # The mean velocity is an offset of the sensor and would integrate to a drift.
            summed = np.cumsum(signal - np.mean(signal)) * period
            positions[component.joint] = summed if wanted == "velocity" else signal
    for component in machine.components.values():
        # A sensor of a sum of joints gives the one unknown joint among them.
        signal = _find_signal(component, columns)
        unknown = [(joint, share) for joint, share in component.acts_on if joint not in positions]
        if component.quantity == "position" and len(unknown) == 1:
            known = [
                share * positions[joint] for joint, share in component.acts_on if joint in positions
            ]
            if signal is not None:
                ((joint, share),) = unknown
                positions[joint] = (signal - sum(known)) / share
    return positions


def _find_signal(component: Component, columns: Mapping[str, Mapping[str, Array]]) -> Array | None:
    if component.channel is None:
        return None
    topic, name = component.channel
    return columns.get(topic, {}).get(name)
