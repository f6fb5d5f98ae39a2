"""Tracking errors of a hybrid test: ideal system, model output and sensor readings compared.

e1 = ideal − model output (numerical model error, thesis, eq. 3.1) and e2 = model output − sensed
(tracking error, thesis, eq. 3.2).
"""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import rms
from rigtwin.simulation.ideal import Ideal


@dataclass(frozen=True)
class Tracking:
    """rms errors of a test.

    Attributes
    ----------
    position_e1, position_e2 : float
        rms of e1 and e2 of the structure's position, m.
    position_total : float
        rms of e1 + e2 of the structure's position, m.
    force_e1, force_e2 : float
        rms of e1 and e2 of the suspension's force, N.
    force_total : float
        rms of e1 + e2 of the suspension's force, N.
    """

    position_e1: float
    position_e2: float
    position_total: float
    force_e1: float
    force_e2: float
    force_total: float


def compute_tracking(
    target: Ideal, commands: Array, structure: Array, load_cell: Array
) -> Tracking:
    """Compute e1 and e2 of a model-in-the-loop test.

    Parameters
    ----------
    target
        Motion of the ideal system in the same test.
    commands
        Output of the models, columns of `Commands`, shape (ticks, 3 or more).
    structure, load_cell
        Sensed position of the structure, m, and force, N, shape (ticks,).

    Returns
    -------
    Tracking
        rms errors.
    """
    position, force = commands[:, 1], commands[:, 2]
    return Tracking(
        position_e1=rms(target.structure - position),
        position_e2=rms(position - structure),
        position_total=rms(target.structure - structure),
        force_e1=rms(target.force - force),
        force_e2=rms(force - load_cell),
        force_total=rms(target.force - load_cell),
    )
