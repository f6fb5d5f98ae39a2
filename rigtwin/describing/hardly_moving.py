"""Joints that hardly move beside others, so that stiction may hold any of their force."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigtwin.describing.log import Log
from rigtwin.numerics.arrays import Array

LARGEST_TURN, LARGEST_SLIDE = 0.05, 1e-3
"""Largest range of a joint that hardly moves, rad and m. Gears and bearings yield by about as much
before they slip."""
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
    resting: list[str] = []
    for turns, largest in ((True, LARGEST_TURN), (False, LARGEST_SLIDE)):
        ranges = {
            joint: float(np.ptp(values))
            for joint, values in positions.items()
            if log.mechanism.turns(joint) == turns
        }
        least = min(largest, SHARE * max(ranges.values(), default=0.0))
        resting += [joint for joint, width in ranges.items() if width < least]
    return tuple(resting)
