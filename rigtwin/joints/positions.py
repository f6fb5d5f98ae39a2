"""Where a machine's joints stand, from its signals alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.components import PositionActuator, measures
from rigtwin.description.machine import Component, Machine
from rigtwin.numerics.arrays import Array


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
    found: dict[str, Array] = {}
    for wanted in ("position", "command", "velocity"):
        for name, component in machine.components.items():
            part = getattr(machine.plant, name)
            says = "command" if isinstance(part, PositionActuator) else measures(part)
            signal = _find_signal(component, columns)
            if says != wanted or signal is None or component.joint in ("", *found):
                continue
            summed = np.cumsum(signal - np.mean(signal)) * period
            found[component.joint] = summed if wanted == "velocity" else signal
    for name, component in machine.components.items():
        # What is measured between joints says where the last of them is.
        signal = _find_signal(component, columns)
        unknown = [(joint, share) for joint, share in component.acts_on if joint not in found]
        if measures(getattr(machine.plant, name)) == "position" and len(unknown) == 1:
            known = [share * found[joint] for joint, share in component.acts_on if joint in found]
            if signal is not None:
                ((joint, share),) = unknown
                found[joint] = (signal - sum(known)) / share
    return found


def _find_signal(component: Component, columns: Mapping[str, Mapping[str, Array]]) -> Array | None:
    if component.channel is None:
        return None
    topic, name = component.channel
    return columns.get(topic, {}).get(name)
