"""Replay of a part of a machine, and the signals that it predicts."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One observed signal, which a replay predicts.

    Attributes
    ----------
    name
        Name of the sensor, or of the controller's command.
    kind
        Kind of signal: `position`, `velocity`, `force` or `command`.
    channel
        Topic and field in recordings.
    unit
        Unit of the signal.
    """

    name: str
    kind: str
    channel: tuple[str, str]
    unit: str


@dataclass(frozen=True)
class Joint:
    """Mechanics of a replay's joint, from the MJCF, with all other joints at rest.

    Attributes
    ----------
    name
        Name of the joint.
    turns
        Whether the joint is a hinge.
    inertia
        Moving inertia with the armature, kg, or kg m² of a hinge.
    positions
        Positions over the joint's range, m or rad.
    gravity
        Gravity load at these positions, N or Nm.
    rest
        Position at which the joint's spring is relaxed, m or rad.
    armature
        Part of the inertia that turns with the motor and has no weight, kg or kg m².
    pull
        Weight of one more kilogram on a slide, along its axis, N/kg; 0 of a hinge.
    """

    name: str
    turns: bool
    inertia: float
    positions: tuple[float, ...]
    gravity: tuple[float, ...]
    rest: float
    armature: float = 0.0
    pull: float = 0.0

    @property
    def goes_round(self) -> bool:
        """Whether the range is a whole turn, so that both of its ends are the same position."""
        whole = self.positions[-1] - self.positions[0]
        return self.turns and math.isclose(whole, 2.0 * math.pi)


@dataclass(frozen=True)
class ReplayOf:
    """Replay of one joint, or of several coupled joints.

    Attributes
    ----------
    name
        Name of the replay.
    joint
        Replayed joint; the first one of coupled joints.
    moved_by
        Components whose recorded signals move the joint. A position sensor prescribes the measured
        motion, a position actuator the motion that follows its command, and a force actuator or
        servo exerts a force.
    rows
        Observed signals.
    guide
        Component with the joint's friction, stiffness and gravity; None without one.
    mass
        Component with the moving mass; None without one.
    closed
        Whether the simulated controller commands the actuator, instead of the recorded command.
    band
        Frequency up to which signals are judged, Hz; None for the whole measured band.
    rotor
        Component with the inertia of the joint's motor; None without one.
    free
        Joints whose motion follows by forward dynamics.
    """

    name: str
    joint: Joint
    moved_by: tuple[str, ...]
    rows: tuple[Row, ...]
    guide: str | None
    mass: str | None
    closed: bool
    band: float | None = None
    rotor: str | None = None
    free: tuple[str, ...] = ()
