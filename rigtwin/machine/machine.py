"""A machine as its description gives it: components with nominal values and tolerances, and how recordings replay them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controllers.formula import Formula
from controllers.quantity import Quantity
from rigtwin.machine.effects import Effect, candidates
from rigtwin.machine.tolerance import Tolerance

FORM = {"position": 0.003, "velocity": 0.003, "force": 0.01, "command": 0.01}
"""Kind of signal → share of it that no model is held to, where a description does not say: of forces less is known."""
TURNING = {
    "m": "rad",
    "N": "Nm",
    "kg": "kg m^2",
    "Ns/m": "Nms/rad",
    "N/m": "Nm/rad",
    "m/s": "rad/s",
    "m/N": "rad/Nm",
    "Ns^2/m^2": "Nms^2/rad^2",
}
"""Unit of a joint that slides → that of one that turns."""


@dataclass(frozen=True)
class Component:
    """One component. element: what of the MJCF it is, with that name; joint: the joint that it belongs to; channel: where
    recordings hold its signal, topic and field; unit: of that signal; kinds: of effects that it may have, None for all."""

    name: str
    element: str
    mjcf: str
    joint: str
    channel: tuple[str, str] | None = None
    unit: str = ""
    kinds: frozenset[str] | None = None


@dataclass(frozen=True)
class Row:
    """One observed signal. kind: position, velocity, force or command; name: its component's, or the command's."""

    name: str
    kind: str
    channel: tuple[str, str]
    unit: str


@dataclass(frozen=True)
class Joint:
    """What the MJCF says of a replay's joint. inertia: kg, or kg m² if it turns; gravity: load N or Nm at each of `positions`;
    rest: where its spring is slack; low, high: its range."""

    name: str
    turns: bool
    inertia: float
    positions: tuple[float, ...]
    gravity: tuple[float, ...]
    rest: float


@dataclass(frozen=True)
class ReplayOf:
    """How a joint is replayed. moved_by: the components whose signals move it: a position sensor prescribes its motion, a
    position actuator its motion through that actuator, a force actuator pushes it. closed: whether the controller commands
    that actuator, or the recording does."""

    name: str
    joint: Joint
    moved_by: tuple[str, ...]
    rows: tuple[Row, ...]
    guide: str | None
    mass: str | None
    closed: bool


@dataclass(frozen=True)
class Control:
    """The controller that was running. output: the command that it computes; inputs: name → channel; exact: rms in the
    command's unit within which its replay counts as exact, None for the recording's rounding."""

    output: str
    formula: Formula
    inputs: Mapping[str, tuple[str, str]]
    exact: float | None


@dataclass(frozen=True)
class Machine:
    """The whole description. plant: a NamedTuple of components, as rigtwin.components.parts and rigtwin.components.parameters define them; rough:
    whether its nominal values are only a start; form: share of a signal that no model is held to, None for
    the usual one."""

    name: str
    title: str
    path: Path
    model: Path
    plant: Any = field(repr=False)
    components: Mapping[str, Component]
    tolerances: tuple[Tolerance, ...]
    replays: tuple[ReplayOf, ...]
    control: Control | None
    rough: bool
    form: float | None
    sources: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def rows(self) -> tuple[Row, ...]:
        """All observed signals, replay by replay."""
        return tuple(row for replay in self.replays for row in replay.rows)

    def form_of(self, row: Row) -> float:
        """Share of a signal that no model is held to."""
        return self.form if self.form is not None else FORM[row.kind]

    def effects(self) -> Iterator[Effect]:
        """All effects that this machine can have. A computer's delay is only told from an actuator's where there are
        several."""
        movers = {mover for replay in self.replays for mover in replay.moved_by}
        for effect in candidates(self.plant):
            if effect.group == "computer" and len(movers) < 2:
                continue
            known = self.components.get(effect.group)
            if known is None or known.kinds is None or effect.kind.name in known.kinds:
                yield effect

    def tolerance_of(self, group: str, parameter: str) -> Tolerance | None:
        """The declared tolerance of a parameter, or of one that means the same, if there is one."""
        for wanted in (parameter, SAME_AS.get(parameter)):
            for each in self.tolerances:
                if (each.group, each.parameter) == (group, wanted):
                    return each
        return None

    def unit(self, group: str, quantity: Quantity) -> str:
        """The unit of a component's parameter."""
        component = self.components.get(group)
        unit = quantity.unit
        if component is None:
            return unit
        if "unit of the command" in unit:
            unit = unit.replace("unit of the command", component.unit or "1")
        turning = any(r.joint.turns and r.joint.name == component.joint for r in self.replays)
        return TURNING.get(unit, unit) if turning else unit


SAME_AS = {"gain": "constant"}
"""Parameter → the one that has the same meaning and may have the declared tolerance."""
