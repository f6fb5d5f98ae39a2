"""Joints that hardly move beside others, so that stiction may hold any of their force."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.describing.log import Log
from rigtwin.numerics.arrays import Array

LARGEST = {True: 0.05, False: 1e-3}
"""Whether a joint turns → largest range of a joint that hardly moves, rad or m. Gears and bearings
yield by about as much before they slip."""
SHARE = 0.03
"""Largest range of a joint that hardly moves, as a share of that of the joint that moves most."""


def joints_at_rest(log: Log, positions: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the joints that hardly move.

    Parameters
    ----------
    log
        The log.
    positions
        Joint → position, SI, shape (rows,).
    """
    turns = {joint: log.mechanism.turns(joint) for joint in positions}
    ranges = {joint: float(np.ptp(values)) for joint, values in positions.items()}
    most = {
        sort: max((ranges[joint] for joint in positions if turns[joint] is sort), default=0.0)
        for sort in LARGEST
    }
    return tuple(
        joint
        for joint, sort in turns.items()
        if ranges[joint] < min(LARGEST[sort], SHARE * most[sort])
    )
